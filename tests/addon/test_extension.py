# SPDX-License-Identifier: GPL-3.0-or-later
"""The ZIP that users install: built, validated, installed, enabled and disabled."""

import importlib
from pathlib import Path
from zipfile import ZipFile

import pytest

from blender_rad.registry import Registry
from tests.addon.building import ROOT, builder, run

ENABLE_LIMIT_S = 0.2  # promised: an artist does not wait for an add-on
# Not NumPy: Blender loads that itself.
HEAVY = {"OpenEXR", "colour", "embreex", "jinja2", "matplotlib", "scipy", "tqdm"}


def test_blender_accepts_the_zip(zip_path: Path) -> None:
    run(builder(), "validate", zip_path)


def test_the_zip_holds_the_extension_and_nothing_else(zip_path: Path) -> None:
    names = [name for name in ZipFile(zip_path).namelist() if not name.endswith("/")]
    own = {"__init__.py", "blender_manifest.toml", "LICENSE", "README.md"}
    assert own <= set(names)
    held = {name.partition("/")[0] for name in names} - {"wheels"}
    assert held == own | {"addon", "blender_rad"}
    assert not [name for name in names if "__pycache__" in name or "/." in name]


def test_every_file_of_the_library_is_in_the_zip(zip_path: Path) -> None:
    sources = {
        path.relative_to(ROOT).as_posix()
        for folder in ("addon", "blender_rad")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert sources <= set(ZipFile(zip_path).namelist())


def test_it_enables_and_loads_nothing_heavy(story: dict[str, list[object]]) -> None:
    assert story["enabled"] == [True, True]
    assert not HEAVY & set(story["loaded_by_enabling"])


@pytest.mark.nightly
def test_it_enables_at_once(story: dict[str, list[float]]) -> None:
    assert max(story["seconds"]) < ENABLE_LIMIT_S


def test_it_leaves_nothing_behind(story: dict[str, object]) -> None:
    assert story["registered"], "the test would not notice what is never there"
    assert story["left_behind"] == [[], [], []], "after a render and a check, too"


def test_the_library_runs_inside_the_extension(story: dict[str, object]) -> None:
    assert story["library_version"] == story["manifest_version"]
    assert story["outside_package_loaded"] is False


@pytest.mark.parametrize("package", ["lights", "commands", "compare.metrics"])
def test_registries_hold_in_the_extension_what_they_hold_outside(
    story: dict[str, dict[str, list[str]]], package: str
) -> None:
    outside = importlib.import_module(f"blender_rad.{package}")
    (registry,) = {id(v): v for v in vars(outside).values() if isinstance(v, Registry)}.values()
    assert story["registries"][package] == sorted(registry) != []
