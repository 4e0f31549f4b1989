# SPDX-License-Identifier: GPL-3.0-or-later
"""What accumulates while a picture is rendered: samples in batches, sums by pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Batch:
    """Camera samples of some pixels, the streams of a pixel side by side.

    Attributes
    ----------
    rows : (p,) pixels; there are `streams` samples of each.
    hits : (k,) samples that met a surface.
    """

    def __init__(self, rows: Ints, streams: int, hits: Ints) -> None:
        self.rows, self.streams, self.hits = rows, streams, hits
        self.count = len(rows) * streams
        self.pixel_of_hit = hits // streams

    def spread(self, values: Floats) -> Floats:
        """Return `values` (k, ...) of hits as (samples, ...), 0 elsewhere."""
        if len(self.hits) == self.count:
            return values
        whole = np.zeros((self.count, *values.shape[1:]))
        whole[self.hits] = values
        return whole

    def by_pixel(self, values: Floats) -> Floats:
        """Return `values` (samples, ...) as (pixels, streams, ...)."""
        return values.reshape(len(self.rows), self.streams, *values.shape[1:])

    def total(self, values: Floats) -> Floats:
        """Return the sums (pixels, ...) of `values` (samples, ...)."""
        return np.einsum("ps...->p...", self.by_pixel(values))


class Pixels:
    """What accumulates for the pixels inside the border; a row a pixel.

    Batches of one round touch different rows, so threads need no lock.
    """

    def __init__(self, layers: int, count: int, streams: int) -> None:
        self.streams = np.zeros((count, streams, 3))
        self.taken = np.zeros((count, streams), dtype=np.int64)
        self.lights = np.zeros((layers, count, 3), dtype=np.float32)
        self.seen = np.zeros((count, 3))
        self.irradiance = np.zeros((count, 3))
        self.normal = np.zeros((count, 3))
        self.alpha = np.zeros(count)
        self.depth = np.full(count, np.inf)

    @property
    def samples(self) -> Ints:
        """Camera samples (n,) a pixel."""
        return np.asarray(self.taken.sum(axis=1))

    def mean(self) -> Floats:
        """Radiance (n, 3)."""
        return np.einsum("nsk->nk", self.streams) / np.maximum(self.samples, 1)[:, None]

    def variance(self) -> Floats:
        """Variance (n, 3) of the mean, from the spread of the streams.

        A single sample tells nothing of its error, which is then taken to be all of the value.
        """
        mean, total = self.mean(), self.samples
        own = self.streams / np.maximum(self.taken, 1)[:, :, None] - mean[:, None]
        spread = np.einsum("ns,nsk->nk", self.taken, own**2)
        freedom = ((np.count_nonzero(self.taken, axis=1) - 1) * total).astype(float)
        spread[freedom == 0] = mean[freedom == 0] ** 2
        return spread / np.maximum(freedom, 1.0)[:, None]
