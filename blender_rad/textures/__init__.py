# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees as arrays: a file a family of nodes; see `Expression`."""

from ._base import (
    COLOUR,
    GENERATED,
    SOURCES,
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
    "SOURCES",
    "TEXTURES",
    "UV",
    "Array",
    "Context",
    "Expression",
    "constant",
    "folded",
]
