# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the scenes beside this file: ``python scenes/build.py [NAME ...]``, with bpy 4.5."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCENES = ("lecture_point", "studio", "office", "hundred")


def main(names: list[str]) -> None:
    """Build and save the named scenes, all by default."""
    sys.path.insert(0, str(HERE))
    import bpy

    if bpy.app.version[:2] != (4, 5):
        raise SystemExit(
            "scenes are saved by Blender 4.5, so that later ones open them without loss"
        )
    for name in names or SCENES:
        importlib.import_module(name).build()
        importlib.import_module("kit").save(HERE / f"{name}.blend")


if __name__ == "__main__":
    main(sys.argv[1:])
