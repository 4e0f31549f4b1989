# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiance by direction, on a grid of azimuth and elevation, and samples that follow it.

Between the centres of texels the radiance is bilinear, as Cycles has it. So is the density in the
plane of the map, whose corners are g = |L| cos(elevation) with |L| the channels' mean: it follows
the light to within what the cosine bends inside a cell, at any contrast. Of a map of all directions
|L| counts as far as it exceeds its mean: the rest is left to other samples, which find even light
better, so that a sun has all of the map's own. A cell is chosen by row and column, then a place in
it by inverting the linear densities of first v and then u.

    pdf(ω) = g(x, y) / (G cos(elevation)) · w h / (4 a b),  G = Σ cells ∫ g dx dy

with half ranges a, b of the angles that w by h texels span.

References
----------
O. Karlík, M. Šik, P. Vévoda, T. Skřivan, J. Křivánek, "MIS Compensation: Optimizing Sampling
Techniques in Multiple Importance Sampling", ACM TOG 38(6), 2019.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ._geometry import TINY, Array

WHOLE = (np.pi, 0.5 * np.pi)
LEAST = 0.125  # of |L| counts everywhere: no light without a chance


@dataclass(frozen=True)
class SkyMap:
    """Radiance of the sky, or of a window of it that is dark at its edges.

    Attributes
    ----------
    radiance : (h, w, 3) float32 [W/(m² sr)] at the centres of equal steps of elevation, row 0 the
        highest, and of azimuth about z, counter-clockwise from x, column 0 the greatest.
    map_from_world : (3, 3) rotation.
    half : greatest azimuth and elevation [rad]; `WHOLE` for all directions.
    """

    radiance: NDArray[np.float32]
    map_from_world: Array
    half: tuple[float, float] = WHOLE

    @cached_property
    def _corners(self) -> NDArray[np.float32]:
        """Radiance and g at the cells' corners, (h + 2, w + 1, 4)."""
        rows = np.pad(self.radiance, ((1, 1), (0, 1), (0, 0)), "edge")
        rows[:, -1] = rows[:, 0]
        g = np.abs(rows).mean(axis=2)
        if self.half == WHOLE:
            g = np.maximum(g - self.scale, LEAST * g)
        g = np.maximum(g * np.cos(self._elevation(self._edges))[:, None], 0.0)
        return np.concatenate([rows, g[..., None]], axis=2, dtype=np.float32)

    @cached_property
    def _edges(self) -> Array:
        """Place of the corners' rows (h + 2,) in texels: the outer cells are half as high."""
        h = len(self.radiance)
        return np.clip(np.arange(-0.5, h + 1.0), 0.0, h)

    @cached_property
    def _integral(self) -> Array:
        """Integral of g up to each cell, row by row, and over all: ((h + 1) w + 1,)."""
        g = self._corners[..., 3].astype(np.float64)
        g = g[1:] + g[:-1]
        cells = 0.25 * np.diff(self._edges)[:, None] * (g[:, 1:] + g[:, :-1])
        return np.concatenate([[0.0], np.cumsum(cells)])

    @property
    def _step(self) -> float:
        """Steps of azimuth and elevation, multiplied [rad²]."""
        (a, b), (h, w, _) = self.half, self.radiance.shape
        return 4.0 * a * b / (h * w)

    @cached_property
    def scale(self) -> float:
        """Mean |L| of the texels over their solid angles [W/(m² sr)]."""
        level = np.cos(self._elevation(np.arange(len(self.radiance), dtype=float) + 0.5))
        return float(np.average(np.abs(self.radiance).mean(axis=(1, 2)), weights=level))

    @cached_property
    def share(self) -> float:
        """Share of a light's samples that should follow the map: all where it is a window.

        In quarters, so that low-discrepancy points deal them out evenly, and never all or none.
        """
        if self.half != WHOLE:
            return 1.0
        followed = self._integral[-1] * self._step / (4.0 * np.pi * self.scale)
        return float(np.clip(0.25 * round(4.0 * followed), 0.125, 0.875))

    @property
    def peak(self) -> Array:
        """The brightest radiance (3,)."""
        return self.radiance.reshape(-1, 3)[np.argmax(np.sum(self.radiance, axis=2))].astype(float)

    def irradiance(self, normal: Array) -> Array:
        """Return E (3,) [W/m²] on a surface that faces `normal` (3,), by the sum over texels."""
        h, w, _ = self.radiance.shape
        column = np.arange(w) + 0.5
        x, y, z = self.map_from_world @ normal
        azimuth = self.half[0] * (1.0 - 2.0 * column / w)
        across = x * np.cos(azimuth) + y * np.sin(azimuth)
        total = np.zeros(3)
        for elevation, row in zip(self._elevation(np.arange(h) + 0.5), self.radiance, strict=True):
            cosine = np.maximum(across * np.cos(elevation) + z * np.sin(elevation), 0.0)
            total += np.cos(elevation) * (cosine @ row)
        return total * self._step

    def _elevation(self, y: Array) -> Array:
        return self.half[1] * (1.0 - 2.0 * y / len(self.radiance))

    def look(self, wi: Array) -> tuple[Array, Array]:
        """Return the radiance (n, 3) from `wi` (n, 3), and the density (n,) [1/sr] of samples."""
        (a, b), (h, w, _) = self.half, self.radiance.shape
        x, y, z = self.map_from_world @ wi.T
        azimuth, level = np.arctan2(y, x), np.hypot(x, y)
        elevation = np.arctan2(z, level)
        inside = (np.abs(azimuth) <= a) & (np.abs(elevation) <= b)
        column = w * (0.5 - 0.5 * azimuth / a) - 0.5
        row = np.clip(h * (0.5 - 0.5 * elevation / b), 0.0, h)
        i = np.floor(column)
        j = np.minimum(np.floor(row + 0.5), h).astype(np.int64)
        s = (column - i)[:, None]
        t = ((row - self._edges[j]) / (self._edges[j + 1] - self._edges[j]))[:, None]
        first = j * (w + 1) + i.astype(np.int64) % w
        corner = self._corners.reshape(-1, 4)
        upper = corner.take(first, axis=0) * (1.0 - s) + corner.take(first + 1, axis=0) * s
        first += w + 1
        lower = corner.take(first, axis=0) * (1.0 - s) + corner.take(first + 1, axis=0) * s
        value = np.where(inside[:, None], upper * (1.0 - t) + lower * t, 0.0)
        density = value[:, 3] / (np.maximum(level, TINY) * self._integral[-1] * self._step)
        return value[:, :3], density

    def sample(self, u: Array) -> Array:
        """Return directions (n, 3) with the density of `look`, from `u` (n, 2) in [0, 1)."""
        a, (h, w, _) = self.half[0], self.radiance.shape
        ends = self._integral[::w]
        place = u[:, 1] * ends[-1]
        j = np.clip(np.searchsorted(ends, place, side="right") - 1, 0, h)
        v = _share(place, ends[j], ends[j + 1])
        place = ends[j] + u[:, 0] * (ends[j + 1] - ends[j])
        cell = np.searchsorted(self._integral, place, side="right") - 1
        cell = np.clip(cell, j * w, j * w + w - 1)
        s = _share(place, self._integral[cell], self._integral[cell + 1])
        first = cell + j
        g = self._corners[..., 3].ravel()
        upper, lower = (g.take(k).astype(np.float64) for k in (first, first + w + 1))
        upper_next, lower_next = (g.take(k).astype(np.float64) for k in (first + 1, first + w + 2))
        t = _linear(upper + upper_next, lower + lower_next, v)
        s = _linear(upper + t * (lower - upper), upper_next + t * (lower_next - upper_next), s)
        row = self._edges[j] + t * (self._edges[j + 1] - self._edges[j])
        azimuth = a * (1.0 - 2.0 * (cell - j * w + 0.5 + s) / w)
        elevation = self._elevation(row)
        level = np.cos(elevation)
        local = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        return np.stack(local, axis=1) @ self.map_from_world


def _share(place: Array, low: Array, high: Array) -> Array:
    """Return how far between its ends `place` lies, in [0, 1]."""
    return np.clip((place - low) / np.maximum(high - low, TINY), 0.0, 1.0)


def _linear(first: Array, last: Array, u: Array) -> Array:
    """Return samples in [0, 1] of a density that goes straight from `first` to `last`."""
    root = np.sqrt(first**2 + u * (last**2 - first**2))
    return np.clip(u * (first + last) / np.maximum(root + first, TINY), 0.0, 1.0)
