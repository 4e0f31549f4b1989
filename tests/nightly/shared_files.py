# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.shared_files FOLDER``: other people's scenes through three verbs.

Every .blend, .glb and .gltf in a folder goes through `lights`, `lint` and `check --shading clay`,
one at a time and each for so many seconds at most. Prints a table with exit code and seconds of
each, the verdict, and why it is not `agree`. Exits with 1 where the program itself has a fault.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

CHECK = ("--shading", "clay", "--resolution", "160x120")
VERBS: dict[str, tuple[str, ...]] = {"lights": (), "lint": (), "check": CHECK}
PROMISED = {0, 1, 2, 3}
SEVERITIES = ("error", "warning")


class Ran(NamedTuple):
    """How a run ended: `code` is None where its time was up."""

    code: int | None
    seconds: float
    document: dict[str, Any]
    said: str

    def __str__(self) -> str:
        return f"{'time' if self.code is None else self.code}, {self.seconds:.0f} s"


def ran(verb: str, file: Path, limit: float, *options: str) -> Ran:
    command = [sys.executable, "-m", "blender_rad", verb, str(file), "--json", *options]
    start = time.monotonic()
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command, stdout=pipe, stderr=pipe, encoding="utf-8", start_new_session=True
    )
    try:
        out, err = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return Ran(None, time.monotonic() - start, {}, "")
    document = json.loads(out) if out.strip() else {}
    said = (err.strip().splitlines() or [""])[-1]
    return Ran(process.returncode, time.monotonic() - start, document, said)


def causes(check: Ran) -> str:
    """Return why a check does not agree: its error, else what is not supported and its findings."""
    if check.code not in PROMISED - {2}:
        return check.said
    document = check.document
    left_out = document["coverage"]["unsupported"]
    said = [f"{u['feature']} of {u['name']}: {u['pixels']} pixels" for u in left_out]
    for severity in SEVERITIES:
        found = (f for f in document["findings"] if f["severity"] == severity)
        said += [f"{f['code']} ({f['object']}): {f['message']}" for f in found]
    return "; ".join(dict.fromkeys(said))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=180.0, help="for each verb")
    options = parser.parse_args()
    files = sorted(f for f in options.folder.rglob("*") if f.suffix in {".blend", ".glb", ".gltf"})
    print("| file | lights | lint | check | verdict | why |\n" + "| --- " * 6 + "|")
    fault = False
    for file in files:
        runs = {verb: ran(verb, file, options.seconds, *more) for verb, more in VERBS.items()}
        verdict = runs["check"].document.get("verdict", "–")
        why = "" if verdict == "agree" else causes(runs["check"]).replace("|", "/")
        name = str(file.relative_to(options.folder))
        print(f"| {' | '.join([name, *map(str, runs.values()), verdict, why])} |", flush=True)
        fault |= any(run.code not in {None, *PROMISED} for run in runs.values())
    return int(fault)


if __name__ == "__main__":
    sys.exit(main())
