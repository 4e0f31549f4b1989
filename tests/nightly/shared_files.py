# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.shared_files FOLDER``: other people's scenes through three verbs.

Every .blend, .glb and .gltf in a folder goes through `lights`, `lint` and `check`, in clay and in
full, one at a time. Prints a table: exit code and seconds of each, the number of findings, and of
checks the verdict, how much of the picture is supported, and why it is not all, or not `agree`.
Exits with 1 where the program itself has a fault.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

CHECK = ("check", "--resolution", "160x120", "--shading")
CLAY, FULL = (*CHECK, "clay"), (*CHECK, "full")
RUNS = {"lights": ("lights",), "lint": ("lint",), "clay": CLAY, "full": FULL}
PROMISED = {0, 1, 2, 3}
OVER = 3.0  # times its limit after which a run is ended: a picture in work is not


class Ran(NamedTuple):
    """How a run ended: `code` is None where it was ended."""

    code: int | None
    seconds: float
    document: dict[str, Any]
    said: str

    def __str__(self) -> str:
        told = [f"{'time' if self.code is None else self.code}", f"{self.seconds:.0f} s"]
        if coverage := self.document.get("coverage"):
            supported = f"{100 * coverage['supported_pixel_fraction']:.0f} % supported"
            told += [self.document["verdict"], supported]
        elif self.document:
            told.append(f"{len(self.document['findings'])} findings")
        return ", ".join(told)


def ran(file: Path, limit: float, verb: str, *options: str) -> Ran:
    if verb == "check":
        options = (*options, "--time-limit", str(limit))
    command = [sys.executable, "-m", "blender_rad", verb, str(file), "--json", *options]
    start = time.monotonic()
    try:
        process = subprocess.run(
            command, capture_output=True, encoding="utf-8", check=False, timeout=OVER * limit
        )
    except subprocess.TimeoutExpired:
        return Ran(None, time.monotonic() - start, {}, "")
    document = json.loads(process.stdout) if process.stdout.strip() else {}
    said = (process.stderr.strip().splitlines() or [""])[-1]
    return Ran(process.returncode, time.monotonic() - start, document, said)


def causes(run: Ran) -> list[str]:
    """Return why a check does not agree, or not on all of the picture."""
    if run.code not in PROMISED - {2}:
        return [run.said]
    left_out = run.document["coverage"]["unsupported"]
    said = [f"{u['feature']} of {u['name']}: {u['pixels']} pixels" for u in left_out]
    if run.code:
        found = (f for f in run.document["findings"] if f["severity"] != "info")
        said += [f"{f['code']} ({f['object']}): {f['message']}" for f in found]
    return said


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=180.0, help="for each run")
    options = parser.parse_args()
    files = sorted(f for f in options.folder.rglob("*") if f.suffix in {".blend", ".glb", ".gltf"})
    print(f"| file | {' | '.join(RUNS)} | why |\n" + "| --- " * (len(RUNS) + 2) + "|")
    fault = False
    for file in files:
        runs = {name: ran(file, options.seconds, *asked) for name, asked in RUNS.items()}
        why = dict.fromkeys(causes(runs["clay"]) + causes(runs["full"]))
        cells = [str(file.relative_to(options.folder)), *map(str, runs.values()), "; ".join(why)]
        print(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |", flush=True)
        fault |= any(run.code not in {None, *PROMISED} for run in runs.values())
    return int(fault)


if __name__ == "__main__":
    sys.exit(main())
