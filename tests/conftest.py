# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share: a seeded generator, and a word for those that need Blender."""

import signal
from importlib.util import find_spec

import numpy as np
import pytest

from tests import features

HAS_BLENDER = find_spec("bpy") is not None
FOLDERS = ("addon", "blender")  # of tests that need it
collect_ignore_glob = [] if HAS_BLENDER else [f"{folder}/test_*.py" for folder in FOLDERS]


# A shell's background jobs ignore interrupts, and so would the commands that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_report_header() -> str:
    return "bpy: " + ("found" if HAS_BLENDER else "not found (pip install '.[bpy]'), so not tested")


@pytest.hookimpl(tryfirst=True)  # before any are deselected
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.parent.name in FOLDERS:
            item.add_marker(pytest.mark.blender)
    features.collect(config, items)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)
