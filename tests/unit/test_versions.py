# SPDX-License-Identifier: GPL-3.0-or-later
"""One version: of the package, the extension, the changelog and the program."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import blender_rad
from blender_rad import cli

ROOT = Path(__file__).parents[2]


def test_manifest_and_changelog_have_the_packages_version() -> None:
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["version"] == blender_rad.__version__
    heading = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert heading is not None
    assert heading[1] == blender_rad.__version__


def test_the_program_says_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out == f"blender-rad {blender_rad.__version__}\n"
