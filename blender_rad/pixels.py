# SPDX-License-Identifier: GPL-3.0-or-later
"""What accumulates while a picture is rendered: samples in batches, sums by pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Batch:
    """Camera samples of some pixels, those of a pixel side by side.

    Attributes
    ----------
    rows : (p,) pixels; there are `each` samples of each.
    hits : (k,) samples that met a surface.
    weight : (samples, 3) what surfaces in front let pass; None where there are none.
    """

    def __init__(self, rows: Ints, each: int, hits: Ints, weight: Floats | None = None) -> None:
        self.rows, self.each, self.hits, self.weight = rows, each, hits, weight
        self.count = len(rows) * each
        self.pixel_of_hit = hits // each

    def spread(self, values: Floats) -> Floats:
        """Return `values` (k, ...) of hits as (samples, ...), 0 elsewhere."""
        if len(self.hits) == self.count:
            return values
        whole = np.zeros((self.count, *values.shape[1:]), order="F")
        for column, own in zip(whole.T, values.T, strict=True):
            column[self.hits] = own
        return whole

    def weighed(self, values: Floats) -> Floats:
        """Return what the camera sees of `values` (samples, 3)."""
        return values if self.weight is None else values * self.weight

    def by_pixel(self, values: Floats) -> Floats:
        """Return `values` (samples, ...) as (pixels, each, ...)."""
        return values.reshape(len(self.rows), self.each, *values.shape[1:])

    def total(self, values: Floats) -> Floats:
        """Return the sums (pixels, ...) of `values` (samples, ...)."""
        parts = self.by_pixel(values)
        return sum((parts[:, k] for k in range(1, self.each)), parts[:, 0])


class Pixels:
    """What accumulates for the pixels inside the border; a row a pixel.

    Batches of one round touch different rows, so threads need no lock.
    """

    def __init__(self, layers: int, count: int, streams: int) -> None:
        self.streams = np.zeros((streams, count, 3))
        self.taken = np.zeros(count, dtype=np.int64)
        self.lights = np.zeros((2, layers, count, 3), dtype=np.float32)  # by half of the streams
        self.shown = np.zeros((layers, count, 3), dtype=np.float32)  # of `seen`
        self.seen = np.zeros((count, 3))
        self.irradiance = np.zeros((count, 3))
        self.normal = np.zeros((count, 3))
        self.alpha = np.zeros(count)
        self.depth = np.full(count, np.inf)

    def layers(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the mean of each layer (layers, n, 3), and a draw of its noise.

        The noise is the difference of the halves' means, n₀ and n₁ samples, times √(n₀n₁)/(n₀+n₁),
        which gives it the variance of the mean of all; 0 for a single sample.
        """
        taken = np.maximum(self.taken, 1)
        halves = np.stack([(taken + 1) // 2, taken // 2])
        weight = np.sqrt(halves[::-1] / np.maximum(halves, 1)) / taken
        first, second = self.lights * weight[:, None, :, None].astype(np.float32)
        return self.lights.sum(axis=0) / taken[:, None].astype(np.float32), first - second

    def radiance(self) -> tuple[Floats, Floats]:
        """Return the mean (n, 3), and its variance (n, 3) from the spread of the streams.

        A single sample tells nothing of its error, which is then taken to be all of the value.
        """
        count = len(self.streams)
        each = [(self.taken + count - 1 - number) // count for number in range(count)]
        taken = _by_channel(np.maximum(self.taken, 1))
        mean = self.streams[0] / taken
        for total in self.streams[1:]:
            mean += total / taken
        spread = np.zeros_like(mean)
        for total, number in zip(self.streams, map(_by_channel, each), strict=True):
            own = total / np.maximum(number, 1.0)
            own -= mean
            own *= own
            own *= number
            spread += own
        spread /= np.maximum(np.minimum(taken, count) - 1.0, 1.0) * taken
        alone = self.taken < 2
        spread[alone] = mean[alone] ** 2
        return mean, spread


def _by_channel(values: Ints) -> Floats:
    """Return `values` (n,) thrice, (n, 3): faster in a sum than a short axis to spread over."""
    return np.repeat(values.astype(float), 3).reshape(-1, 3)
