# SPDX-License-Identifier: GPL-3.0-or-later
"""Write FEATURES.md: what is held against Cycles, from the tests' own results in each Blender.

python -m pytest tests/blender -k cycles --junitxml=4.5.xml      # with each Blender's Python
python -m tests.features 4.5.xml 5.2.xml
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

PAGE = Path(__file__).parents[1] / "FEATURES.md"
HEAD = """# What is held against Cycles

Each row is a test that renders with Cycles and with our engine, and compares the two; `python -m
tests.features` writes this page from the results. What `check` cannot follow it names, and leaves
out of the comparison.
"""
Verdicts = dict[tuple[str, str], str]


def verdicts(report: Path) -> Verdicts:
    """Return by area and feature whether its tests passed, from a JUnit file."""
    found: Verdicts = {}
    for case in ElementTree.parse(report).iter("testcase"):
        module = re.search(r"test_(\w+)_cycles$", case.get("classname", ""))
        name = re.fullmatch(r"test_(\w+?)(?:\[(.+)\])?", case.get("name", ""))
        if module and name:
            words = name[1].replace("_", " ")
            key = module[1], f"{name[2]} ({words})" if name[2] else words
            bad = {child.tag for child in case} & {"failure", "error", "skipped"}
            found[key] = "not tested" if "skipped" in bad else "differs" if bad else "agrees"
    return found


def page(columns: dict[str, Verdicts]) -> str:
    """Return the page with a table for each area, a column for each Blender."""
    lines, area = [HEAD], ""
    for key in sorted(set().union(*columns.values())):
        if key[0] != area:
            area = key[0]
            heads = " | ".join(columns)
            lines += [
                f"\n## {area.capitalize()}\n",
                f"| | {heads} |",
                "| --- " * (len(columns) + 1) + "|",
            ]
        cells = " | ".join(found.get(key, "not tested") for found in columns.values())
        lines.append(f"| {key[1]} | {cells} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    reports = [Path(argument) for argument in sys.argv[1:]]
    if not reports:
        sys.exit(__doc__)
    PAGE.write_text(page({f"Blender {p.stem}": verdicts(p) for p in reports}), encoding="utf-8")
