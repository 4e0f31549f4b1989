# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON that every parser reads."""

from __future__ import annotations

import json
from pathlib import PurePosixPath

import numpy as np
import pytest

from blender_rad.errors import Finding
from blender_rad.strict_json import dumps, plain


def test_what_is_not_finite_is_null() -> None:
    assert plain([float("nan"), np.float32("inf"), np.array([[1.0, -np.inf]])]) == [
        None,
        None,
        [[1.0, None]],
    ]


def test_numbers_keep_their_value_and_kind() -> None:
    document = {
        "a": np.int64(3),
        "b": np.float64(0.1),
        "c": np.bool_(True),
        4: PurePosixPath("x/y"),
    }
    assert plain(document) == {"a": 3, "b": 0.1, "c": True, "4": "x/y"}
    assert type(plain(np.bool_(True))) is bool


def test_dataclasses_are_objects() -> None:
    finding = Finding("code", "info", "Key", "a light", effect_percent=float("nan"))
    assert plain(finding)["effect_percent"] is None
    assert json.loads(dumps({"findings": (finding,)}))["findings"][0]["object"] == "Key"


def test_text_is_plain_ascii() -> None:
    assert dumps("λ").isascii()
    assert json.loads(dumps("λ\udcff")) == "λ\udcff"


def test_what_has_no_meaning_raises() -> None:
    with pytest.raises(TypeError, match="object has no meaning"):
        dumps({"a": object()})
