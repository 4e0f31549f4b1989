# SPDX-License-Identifier: GPL-3.0-or-later
r"""Light that leaves unevenly: a table over directions that dims or lifts a light's radiance.

The table stands in the frame of an IES Texture node, which Cycles turns so: with l the direction in
which light leaves, in the light's frame, v = acos(-l_z) and h = atan2(l_x, l_y) + π. Hence h = 0 is
-Y and h = 90° is -X: against LM-63, Cycles' planes turn with the clock seen from above.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..photometry.distribution import directions
from . import _geometry as geometry
from ._base import Array
from ._geometry import Mask

GRAZING = 1e-6  # cosine; nothing is left of a face that is seen so
FINEST = np.radians(1.0)  # the widest cell of the quadrature


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """A factor on radiance by direction.

    Attributes
    ----------
    longitude, latitude : (m,), (n,) [rad], rising or equal; latitude from the pole's opposite.
    table : (m + 2, n + 2) factors, with a row more on each side for the cubic.
    frame : (3, 3) rows are the table's longitude 0, longitude 90° and pole, from world directions
        that need no unit length.
    cubic : Catmull-Rom between the knots (Cycles), else linear.
    first : [rad] where longitudes start to be counted round.
    facing : (3,) normal of a flat emitter, which then shows the table as its intensity.
    """

    longitude: Array
    latitude: Array
    table: Array
    frame: Array
    cubic: bool = True
    first: float = 0.0
    facing: Array | None = None

    def factor(self, leaving: Array) -> Array:
        """Return the factor (n,) on light that leaves along world directions (n, 3), 0 or more."""
        x, y, z = self.frame @ leaving.T
        first = self.first
        longitude = first + np.mod(np.arctan2(y, x) - first, 2.0 * np.pi)
        i, along, inside = _cells(self.longitude, longitude, self.cubic)
        j, across, within = _cells(self.latitude, np.arctan2(z, np.hypot(x, y)), self.cubic)
        value = np.zeros(len(leaving))
        for a, share in enumerate(along):
            for b, part in enumerate(across):
                value += share * part * self.table[i + a, j + b]
        if self.facing is not None:  # Φ/(πA) · A cosθ · 4π/4cosθ: as of a point
            value /= 4.0 * np.maximum(leaving @ self.facing, GRAZING)
        return np.where(inside & within, np.maximum(value, 0.0), 0.0)

    def _quadrature(self) -> tuple[Array, Array]:
        """Return unit world directions (k, 3) and their solid angles (k,) over the whole table.

        A frame F that stretches has dω = |det F⁻¹|/|F⁻¹l|³ dl.
        """
        u, du = _gauss(self.longitude)
        v, dv = _gauss(self.latitude)
        world = directions(u, v).reshape(-1, 3) @ np.linalg.inv(self.frame).T
        length = np.sqrt(np.sum(world**2, axis=1))
        solid = np.outer(du, np.cos(v) * dv).ravel() / abs(np.linalg.det(self.frame))
        return world / length[:, None], solid / length**3

    def flux_and_peak(
        self, intensity: Callable[[Array], Array], axis: Array | None = None, cone: float = 2.0
    ) -> tuple[float, float]:
        """Return integral and greatest value of an `intensity` of leaving directions (n, 3).

        With an `axis` (3,), only the cone of 1 - cos(half angle) = `cone` about it is lit.
        """
        leaving, solid_angle = self._quadrature() if axis is None else _over_cone(axis, cone)
        values = intensity(leaving)
        return float(solid_angle @ values), float(values.max())


def _cells(knots: Array, at: Array, cubic: bool) -> tuple[NDArray[np.intp], list[Array], Mask]:
    """Return cells (n,), the weights (n,) of the four rows from there on, and whether inside."""
    # Cycles goes to the first knot that is not below, whatever the order.
    cell = np.searchsorted(np.maximum.accumulate(knots), at) - 1
    cell = np.clip(cell, 0, max(len(knots) - 2, 0))
    span = np.take(knots, cell + 1, mode="clip") - knots[cell]
    x = (at - knots[cell]) / np.where(span == 0.0, 1.0, span)
    inside = (at >= knots[0]) & (at <= knots[-1])
    if not cubic:
        return cell, [0.0 * x, 1.0 - x, x, 0.0 * x], inside
    weights = [
        ((2.0 - x) * x - 1.0) * x / 2.0,
        ((3.0 * x - 5.0) * x * x + 2.0) / 2.0,
        ((4.0 - 3.0 * x) * x + 1.0) * x / 2.0,
        (x - 1.0) * x * x / 2.0,
    ]
    return cell, weights, inside & (at < knots[-1])


def _over_cone(axis: Array, cone: float) -> tuple[Array, Array]:
    """Return unit world directions (k, 3) and their solid angles (k,) in a cone, its axis first."""
    side, part = 0.5 * np.array(_gauss(np.array([0.0, 2.0])))  # 230 points each way
    u = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    leaving = geometry.sample_cone(np.tile(axis, (len(u), 1)), np.full(len(u), cone), u)
    return leaving, 2.0 * np.pi * cone * np.outer(part, part).ravel()


def _gauss(knots: Array) -> tuple[Array, Array]:
    """Return two Gauss nodes and weights for each part of at most 1° (0.017) between knots."""
    edges = np.unique(knots)
    parts = np.maximum(np.ceil(np.diff(edges) / FINEST), 1).astype(int)
    width = np.repeat(np.diff(edges) / parts, parts)
    start = np.append(edges[:1], edges[0] + np.cumsum(width))[:-1]
    nodes = start[:, None] + width[:, None] * (0.5 + np.array([-1.0, 1.0]) / np.sqrt(12.0))
    weights = np.repeat(0.5 * width, 2)
    return np.append(nodes, edges), np.append(weights, 0.0 * edges)  # knots: for the peak
