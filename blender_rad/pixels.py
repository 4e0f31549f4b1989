# SPDX-License-Identifier: GPL-3.0-or-later
"""What accumulates while a picture is rendered: samples in batches, sums by pixel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Ints, Singles

BLOCK = 16384  # pixels worked off at a time, so that arrays stay near the processor


class Batch:
    """Camera samples of some pixels, those of a pixel side by side.

    There are `each` samples of the pixels `rows` (p,); where these follow each other `span` is the
    slice of them, which is faster; else it is `rows`. The samples `hits` (k,) met a surface, and
    what surfaces in front of it let pass is `weight` (samples, 3), None where there are none.
    """

    def __init__(self, rows: Ints, each: int, hits: Ints, weight: Floats | None = None) -> None:
        self.rows, self.each, self.hits, self.weight = rows, each, hits, weight
        first, last = int(rows[0]), int(rows[-1]) + 1
        in_turn = last - first == len(rows) and bool(np.all(rows[1:] > rows[:-1]))
        self.span = slice(first, last) if in_turn else rows
        self.count = len(rows) * each
        self.pixel_of_hit = hits // each

    def spread(self, values: Floats) -> Floats:
        """Return `values` (k, ...) of hits as (samples, ...), 0 elsewhere."""
        if len(self.hits) == self.count:
            return values
        whole: Floats = np.zeros((self.count, *values.shape[1:]), order="F")
        for column, own in zip(whole.T, values.T, strict=True):
            column[self.hits] = own
        return whole

    def weighed(self, values: Floats) -> Floats:
        """Return what the camera sees of `values` (samples, 3)."""
        return values if self.weight is None else values * self.weight

    def by_pixel(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return `values` (samples, ...) as (pixels, each, ...)."""
        return values.reshape(len(self.rows), self.each, *values.shape[1:])

    def total(self, values: Floats) -> Floats:
        """Return the sums (pixels, ...) of `values` (samples, ...)."""
        parts = self.by_pixel(values)
        return sum((parts[:, k] for k in range(1, self.each)), parts[:, 0])

    def add(self, values: Floats, sums: NDArray[Any]) -> None:
        """Add `values` (pixels, ...) to the pixels of `sums` (n, ...)."""
        for column, own in zip(sums.T, values.T, strict=True):
            column[self.span] += own


class Pixels:
    """What accumulates for the pixels inside the border; a row a pixel.

    Batches of one round touch different rows, so threads need no lock. Channels lie one after the
    other.
    """

    def __init__(self, layers: int, count: int, streams: int) -> None:
        def zeros(*shape: int, kind: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
            return np.zeros((*shape, 3, count), dtype=kind).swapaxes(-1, -2)

        self.streams = zeros(streams)
        self.taken = np.zeros(count, dtype=np.int64)
        # By half of the streams:
        self.lights: Singles = zeros(2, layers, kind=np.float32)
        self.shown = zeros(layers, kind=np.float32)  # of `seen`
        self.seen, self.irradiance, self.normal = zeros(), zeros(), zeros()
        self.alpha = np.zeros(count)
        self.depth = np.full(count, np.inf)

    def layers(self) -> tuple[Singles, Singles]:
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
        mean, variance = np.empty_like(self.normal), np.empty_like(self.normal)
        for first in range(0, len(mean), BLOCK):
            rows = slice(first, first + BLOCK)
            mean[rows], variance[rows] = _moments(self.streams[:, rows], self.taken[rows])
        return mean, variance


def _moments(streams: Floats, samples: Ints) -> tuple[Floats, Floats]:
    """Return what `Pixels.radiance` does, of the sums (streams, n, 3) of `samples` (n,)."""
    count = len(streams)
    number = samples[:, None].astype(np.float64)
    taken = np.maximum(number, 1.0)
    mean = sum(streams[1:], start=streams[0]) / taken
    variance = np.zeros_like(mean)
    for stream, total in enumerate(streams):
        each = np.ceil((number - stream) / count)
        own = total / np.maximum(each, 1.0)
        own -= mean
        own *= own
        own *= each
        variance += own
    variance /= np.maximum(np.minimum(taken, count) - 1.0, 1.0) * taken
    alone = samples < 2
    if alone.any():
        variance[alone] = mean[alone] ** 2
    return mean, variance
