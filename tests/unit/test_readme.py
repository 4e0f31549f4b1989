# SPDX-License-Identifier: GPL-3.0-or-later
"""README's map is the house as it stands."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def mapped() -> set[str]:
    """Return the paths of README's map, folders with a slash at the end."""
    (block,) = re.findall(r"```\n(__init__.*?)```", README, re.DOTALL)
    paths: set[str] = set()
    folder = ""
    for line in block.splitlines():
        names = re.split(r"\s{2,}", line.strip())[0].split()
        if line.startswith(" "):
            paths |= {folder + name for name in names if re.search(r"/$|\.\w+$", name)}
        else:
            folder = names[0]
            paths.add(folder)
    return paths


def test_all_that_the_map_shows_is_there() -> None:
    assert not {path for path in mapped() if not (ROOT / path).exists()}


def test_every_package_is_on_the_map() -> None:
    packages = {
        path.parent.relative_to(ROOT).as_posix() + "/"
        for path in (ROOT / "blender_rad").glob("*/__init__.py")
    }
    assert packages
    assert packages <= mapped()
