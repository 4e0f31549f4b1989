# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/FEATURES.md has the rows that the tests have, in the column of this Blender."""

from pathlib import Path

import pytest

from tests.features import COLLECTED, PAGE, blender_version, read

HINT = "run `python -m tests.features` on both Blenders, or on the JUnit files of what is new"


def test_rows_are_those_of_the_tests(request: pytest.FixtureRequest) -> None:
    files, rows = request.config.stash[COLLECTED]
    if {path.name for path in Path(__file__).parent.glob("test_*.py")} - files:
        pytest.skip("tells when all of this folder is collected")
    written = read(PAGE.read_text(encoding="utf-8"))[blender_version()]
    assert written.keys() == rows, HINT
    assert "differs" not in written.values()
