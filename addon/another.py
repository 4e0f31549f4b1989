# SPDX-License-Identifier: GPL-3.0-or-later
"""Another Blender, in the background, that has our library: this one stays free."""

import subprocess
import sys
from pathlib import Path

import bpy

_FIRST = "import sys; sys.path = [{root!r}, *sys.path, *{path!r}]\n"


def start(code: str, log: Path) -> subprocess.Popen[bytes]:
    """Return the process that runs `code`; what it says on standard error goes to `log`."""
    code = _FIRST.format(root=str(Path(__file__).parents[1]), path=sys.path) + code
    command = [sys.executable, "-c", code]
    if not bpy.app.module:
        options = ["--background", "--factory-startup", "--python-expr"]
        command = [bpy.app.binary_path, *options, code]
    with log.open("wb") as said:
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=said,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
