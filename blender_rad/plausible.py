# SPDX-License-Identifier: GPL-3.0-or-later
"""What real surfaces were measured to be, and the ranges that a material's numbers lie in."""

import math
from typing import NamedTuple

CHECKER = "ColorChecker 24 of 2014, colour-science"
OKE = "Oke, Boundary Layer Climates, 1987, table 1.1"
METALS = "Akenine-Möller et al., Real-Time Rendering, 2018, table 9.2"
CRC = "CRC Handbook of Chemistry and Physics"


class Measured(NamedTuple):
    """A measured number: a luminous reflectance, that of metals at θ = 0, or an IOR."""

    value: float
    name: str
    source: str


MEASURED = {
    "reflectance": (
        Measured(0.00035, "Vantablack", "Theocharous et al., Optics Express 22, 2014"),
        Measured(0.0315, "black 2 of the ColorChecker", CHECKER),
        Measured(0.05, "wet asphalt", OKE),
        Measured(0.191, "neutral 5 of the ColorChecker", CHECKER),
        Measured(0.881, "white 9.5 of the ColorChecker", CHECKER),
        Measured(0.95, "fresh snow", OKE),
        Measured(0.99, "Spectralon", "Labsphere SRS-99"),
    ),
    "reflectance of metal": (
        Measured(0.50, "titanium", METALS),
        Measured(0.55, "chromium", METALS),
        Measured(0.56, "iron", METALS),
        Measured(0.92, "aluminium", METALS),
        Measured(0.96, "silver", METALS),
    ),
    "IOR": (
        Measured(1.0003, "air", CRC),
        Measured(1.31, "ice", CRC),
        Measured(1.33, "water", CRC),
        Measured(1.52, "crown glass", CRC),
        Measured(2.42, "diamond", CRC),
        Measured(2.9, "rutile", "DeVore, J. Opt. Soc. Am. 41, 1951"),
    ),
}
# Below the first is rarer than soot, above the last rarer than snow; no pure metal is darker than
# 0.4, and next to nothing clear bends more than rutile.
RANGES = {"reflectance": (0.01, 0.96), "reflectance of metal": (0.4, 1.0), "IOR": (1.0, 3.0)}


def nearest(quantity: str, value: float) -> str:
    """Return the two measured surfaces that are nearest by ratio, in words."""
    rows = MEASURED[quantity]
    order = sorted(rows, key=lambda row: abs(math.log(row.value / max(value, 1e-6))))[:2]
    return ", ".join(f"{row.name} has {row.value:.3g} ({row.source})" for row in sorted(order))
