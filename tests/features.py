# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.features PYTHON...``: write docs/FEATURES.md, from the tests in each Blender.

Each Python runs the tests that are rows of the page; the JUnit file of a run that was
(``pytest -m feature --junitxml=FILE.xml``) may stand for one. An area that a run has tests of is
written anew in its Blender's column, the others stay. Exits with 1 where anything differs.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "FEATURES.md"
HEAD = """# What is held against Cycles, and what is not supported

Each row is a test, which has run on each Blender; `python -m tests.features` writes this page from
the results. What is not supported is named by every verb, and `check` leaves it out.
"""
ABSENT, NOT_TESTED, DIFFERS = "–", "not tested", "differs"
Row = tuple[str, str, str]  # area, feature, what is compared


COLLECTED = pytest.StashKey[tuple[set[str], set[Row]]]()


def collect(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tell the JUnit file the rows of `items`, and `config` all files and rows."""
    known: set[Row] = set()
    for item in items:
        rows, word = rows_of(item)
        known |= rows
        if rows:
            item.add_marker(pytest.mark.feature(""))  # for -m, where its file's name is its marker
            said = [("feature", " | ".join((*row, word))) for row in sorted(rows)]
            item.user_properties += [*said, ("blender", blender_version())]
    config.stash[COLLECTED] = {item.path.name for item in items}, known


def blender_version() -> str:
    """Return the head of this Blender's column."""
    import bpy

    return "Blender {}.{}".format(*bpy.app.version)


def rows_of(item: Any) -> tuple[set[Row], str]:
    """Return the rows of a pytest item, and what they say where the test passes.

    Each case of a test that is marked is a row; one that is not is a row as a whole.
    """
    marker, module = item.get_closest_marker("feature"), item.path.stem.removeprefix("test_")
    if marker is None and not module.endswith("_cycles"):
        return set(), ""
    case, options = getattr(item, "callspec", None), marker.kwargs if marker else {}
    name, compared = item.originalname.removeprefix("test_").replace("_", " "), "with Cycles"
    if marker:
        compared, name = marker.args[0], case.id if case else name
    area = options.get("area", module.removesuffix("_cycles").capitalize())
    rows = {(area, each, compared) for each in options.get("rows", [name])}
    return rows, options.get("holds", "agrees")


def results(report: Path) -> dict[str, dict[Row, str]]:
    """Return by Blender, by row, what a JUnit file says of it; of several tests the worst."""
    found: dict[str, dict[Row, str]] = {}
    for case in ElementTree.parse(report).iter("testcase"):
        said = [(p.get("name", ""), p.get("value", "")) for p in case.iter("property")]
        bad = {child.tag for child in case}
        for area, name, compared, passed in (v.split(" | ") for k, v in said if k == "feature"):
            word = NOT_TESTED if "skipped" in bad else passed
            word = DIFFERS if bad & {"failure", "error"} else word
            rows, key = found.setdefault(dict(said)["blender"], {}), (area, name, compared)
            rows[key] = word if rows.get(key) not in {NOT_TESTED, DIFFERS} else rows[key]
    return found


def read(text: str) -> dict[str, dict[Row, str]]:
    """Return what a page says, by Blender and row."""
    found: dict[str, dict[Row, str]] = {}
    area, columns = "", [""]
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if line.startswith("## "):
            area = line[3:]
        elif line.startswith("| | "):
            columns = cells[2:]
        elif line.startswith("| ") and "---" not in line:
            for column, word in zip(columns, cells[2:], strict=True):
                if word != ABSENT:
                    found.setdefault(column, {})[area, cells[0], cells[1]] = word
    return found


def page(columns: dict[str, dict[Row, str]]) -> str:
    """Return the page: a table for each area, a column for each Blender."""
    lines, area = [HEAD], ""
    for key in sorted(set().union(*columns.values())):
        if key[0] != area:
            area = key[0]
            heads = ["", "compared", *sorted(columns)]
            lines += [f"\n## {area}\n", _line(heads), _line(["---"] * len(heads))]
        lines.append(_line([*key[1:], *(columns[c].get(key, ABSENT) for c in sorted(columns))]))
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    return re.sub(" +", " ", f"| {' | '.join(cells)} |")


def merged(text: str, reports: list[Path]) -> dict[str, dict[Row, str]]:
    """Return what the page `text` says after the reports, taken together."""
    columns, fresh = read(text), dict[str, dict[Row, str]]()
    for report in reports:
        for blender, rows in results(report).items():
            fresh.setdefault(blender, {}).update(rows)
    for blender, rows in fresh.items():
        areas = {key[0] for key in rows}
        kept = {k: word for k, word in columns.get(blender, {}).items() if k[0] not in areas}
        columns[blender] = kept | rows
    return columns


def main(arguments: list[str]) -> int:
    reports: list[Path] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, argument in enumerate(arguments):
            reports.append(Path(argument))
            if reports[-1].suffix != ".xml":
                reports[-1] = Path(folder) / f"{number}.xml"
                command = [argument, "-m", "pytest", "-q", "-m", "feature", "tests/blender"]
                command.append(f"--junitxml={reports[-1]}")
                subprocess.run(command, cwd=PAGE.parents[1], check=False)
        text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
        columns = merged(text, reports)
    PAGE.write_text(page(columns), encoding="utf-8")
    return int(any(DIFFERS in rows.values() for rows in columns.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) if sys.argv[1:] else __doc__)
