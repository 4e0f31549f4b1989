# SPDX-License-Identifier: GPL-3.0-or-later
"""In a real Blender window: the first chapter of the guide with its pictures, or what redraws cost.

Usage: python -m tests.nightly.window IN_BLENDER ROOT [--redraw] [--zip FILE.zip]

IN_BLENDER is a program that runs a command in the folder ROOT, as `IN_BLENDER ROOT SHARE COMMAND…`
with the folder SHARE seen there as /share; `blender`, `xvfb-run` and ImageMagick have to be there.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE, DOCS = Path(__file__).parent, Path(__file__).parents[2] / "docs"
SCREEN = ("-screen 0 1200x720x24 -nolisten tcp", "1200", "720")
LIMIT_S = 1800
ENABLE_S, REDRAW_MS = 0.2, 16.0  # of the processor, promised


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("in_blender")
    parser.add_argument("root")
    parser.add_argument("--zip", type=Path, help="default: built with the wheels for its Python")
    parser.add_argument("--python", default="3.14", help="of the Blender there")
    parser.add_argument("--redraw", action="store_true", help="measure, take no pictures")
    given = parser.parse_args()
    script = "_redraw.py" if given.redraw else "_walk.py"
    with tempfile.TemporaryDirectory() as name:
        share = Path(name)
        (share / "home").mkdir()
        shutil.copy(HERE / script, share)
        packed = given.zip or _build(share, given.python)
        shutil.copy(packed, share / "radiometric.zip")
        inside = ["timeout", "-k", "5", str(LIMIT_S), given.in_blender, given.root, name]
        inside += ["env", "LIBGL_ALWAYS_SOFTWARE=1", "HOME=/share/home"]
        install = ["extension", "install-file", "-r", "user_default", "-e"]
        install = [*inside, "blender", "--command", *install, "/share/radiometric.zip"]
        subprocess.run(install, check=True)
        window = ["xvfb-run", "-a", "-s", SCREEN[0], "blender", "--gpu-backend", "opengl"]
        walk = ["-p", "0", "0", *SCREEN[1:], "-P", f"/share/{script}", "--", "/share"]
        command = [*inside, *window, *walk]
        said = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (share / "story.json").exists():
            print(said.stdout, said.stderr)
            return 1
        for picture in share.glob("*.png"):
            shutil.copy(picture, DOCS)
        story = json.loads((share / "story.json").read_text())
    print(json.dumps(story, indent=1))
    tracebacks = [line for line in said.stderr.splitlines() if "Traceback" in line]
    if given.redraw:
        good = story.get("enabling_s", 1) < ENABLE_S and story.get("ms_a_redraw", 99) < REDRAW_MS
    else:
        good = abs(story.get("meter_lx", 0) - 500) < 5 and story.get("verdict") == "agree"
        good &= abs(story.get("reopened_lx", 0) - 500) < 5
        good &= abs(story.get("typed_lm", 0) - 5000) < 1 and story.get("undone_lm", 5000) != 5000
    return 0 if good and not tracebacks else 1


def _build(folder: Path, python: str) -> Path:
    builder = str(DOCS.parent / "build_extension.py")
    only = ["--platform", "linux-x64", "--python", python]
    subprocess.run([sys.executable, builder, "-o", str(folder / "zip"), *only], check=True)
    (path,) = (folder / "zip").glob("*.zip")
    return path


if __name__ == "__main__":
    sys.exit(main())
