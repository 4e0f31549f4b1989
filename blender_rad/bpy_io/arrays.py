# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's collections as arrays, without a Python loop over their elements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def floats(collection: Any, attribute: str, width: int) -> NDArray[np.float32]:
    """Return `attribute` of all elements of a collection, (n, width) float32."""
    values = np.zeros(len(collection) * width, dtype=np.float32)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width)


def integers(collection: Any, attribute: str, width: int = 1) -> NDArray[np.int32]:
    """Return `attribute` of all elements of a collection, (n,) or (n, width) int32."""
    values = np.zeros(len(collection) * width, dtype=np.int32)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width) if width > 1 else values


def booleans(collection: Any, attribute: str) -> NDArray[np.bool_]:
    """Return `attribute` of all elements of a collection, (n,) bool."""
    values = np.zeros(len(collection), dtype=np.bool_)
    collection.foreach_get(attribute, values)
    return values


def matrix(bl_matrix: Any) -> NDArray[np.float64]:
    """Return a Blender matrix as (4, 4) float64, target from source."""
    return np.array([tuple(row) for row in bl_matrix], dtype=np.float64)
