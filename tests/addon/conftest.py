# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on as it lies in the tree, registered around each test of a fresh scene."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.addon.building import ROOT, build

NAME = "radiometric_tree"


@pytest.fixture(scope="session")
def package() -> ModuleType:
    """Return the root package, imported under a name of its own."""
    spec = spec_from_file_location(
        NAME, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    assert spec and spec.loader
    sys.modules[NAME] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])
    return sys.modules[NAME]


@pytest.fixture
def addon(package: ModuleType) -> Iterator[Any]:
    """Register the add-on in an empty file, and return its package."""
    bpy = pytest.importorskip("bpy")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    module = importlib.import_module(f"{NAME}.addon")
    module.register()
    yield module
    module.unregister()


@pytest.fixture(scope="session")
def zip_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the ZIP that users install."""
    return build(tmp_path_factory.mktemp("build"))
