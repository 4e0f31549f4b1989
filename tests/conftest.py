# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share: a seeded generator, and a word for those that need Blender."""

import signal
from importlib.util import find_spec

import numpy as np
import pytest

from tests import features

HAS_BLENDER = find_spec("bpy") is not None
collect_ignore_glob = [] if HAS_BLENDER else ["blender/test_*.py"]


# A shell's background jobs ignore interrupts, and so would the commands that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_report_header() -> str:
    return "bpy: " + ("found" if HAS_BLENDER else "not found, so nothing of it is tested")


@pytest.hookimpl(tryfirst=True)  # before any are deselected
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is in `blender`, and skip what needs Blender where there is none."""
    for item in items:
        if item.path.parent.name == "blender":
            item.add_marker(pytest.mark.blender)
        if not HAS_BLENDER and item.get_closest_marker("blender"):
            item.add_marker(pytest.mark.skip(reason="needs bpy: pip install '.[bpy]'"))
    features.collect(config, items)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)
