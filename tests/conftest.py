# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share: a seeded generator, and a word for those that need Blender."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what needs Blender where there is none."""
    if find_spec("bpy") is None:
        reason = pytest.mark.skip(reason="needs bpy: pip install '.[bpy]'")
        for item in items:
            if item.get_closest_marker("blender"):
                item.add_marker(reason)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)
