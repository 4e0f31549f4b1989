# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees as arrays: a file a family of nodes; see `Expression`."""

from ._base import (
    COLOUR,
    GENERATED,
    NORMAL,
    SOURCES,
    TANGENT,
    TEXTURES,
    UV,
    Array,
    Context,
    Expression,
    constant,
    folded,
)

__all__ = [
    "COLOUR",
    "GENERATED",
    "NORMAL",
    "SOURCES",
    "TANGENT",
    "TEXTURES",
    "UV",
    "Array",
    "Context",
    "Expression",
    "constant",
    "folded",
]
