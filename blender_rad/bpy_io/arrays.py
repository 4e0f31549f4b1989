# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's collections as arrays, without a Python loop over their elements."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats


def gathered(collection: Any, attribute: str, dtype: type, *width: int) -> NDArray[Any]:
    """Return `attribute` of all elements of a collection, (n,) or (n, width) of `dtype`."""
    values = np.zeros((len(collection), *width), dtype=dtype)
    collection.foreach_get(attribute, values.reshape(-1))
    return values


def matrix(bl_matrix: Any) -> Floats:
    """Return a Blender matrix as (4, 4) float64, target from source."""
    return np.array([tuple(row) for row in bl_matrix], dtype=np.float64)
