# SPDX-License-Identifier: GPL-3.0-or-later
"""What a change does to light, from pictures of the same seeds with and without it."""

from typing import NamedTuple

import numpy as np

from .pools import DARK, TILE, Picture, block_sums

SIGMAS = 4.0  # of the worst of hundreds of tiles


class Effect(NamedTuple):
    """What is there with a change, over what is there without, less one [%]."""

    whole: float  # of the picture's light
    error: float  # standard error of that
    tile: float  # of the 16×16 tile that changes most; 0 where that may be noise

    def is_beyond(self, percent: float, tile_percent: float) -> bool:
        """Return whether it is certain, and larger."""
        whole = max(abs(self.whole) - 2.0 * self.error, 0.0)
        return whole > percent or abs(self.tile) > tile_percent

    def __str__(self) -> str:
        tile = f", up to {self.tile:+.3g} % of a tile" if self.tile else ""
        return f"{self.whole:+.3g} ± {self.error:.1g} % of the light{tile}"


def effect_of(with_it: Picture, without: Picture) -> Effect:
    """Return the effect of what tells two sets of pictures (s, h, w, 3) apart, s ≥ 2 seeds."""
    theirs, ours = (
        block_sums(np.asarray(p, float).mean(axis=3, keepdims=True), TILE)
        for p in (with_it, without)
    )
    count, base = len(ours), ours.mean(axis=0)
    scale = np.maximum(np.maximum(np.abs(base), DARK * base.mean()), np.finfo(float).tiny ** 0.5)
    change = (theirs - ours) / scale
    noise = np.sqrt(change.var(axis=0, ddof=1).mean() / count)
    worst = float(max(change.mean(axis=0).ravel(), key=abs))
    total, wholes = base.sum() or 1.0, (theirs - ours).sum(axis=(1, 2, 3))
    error = 100.0 * wholes.std(ddof=1) / np.sqrt(count) / abs(total)
    tile = 100.0 * worst if abs(worst) > SIGMAS * noise else 0.0
    return Effect(100.0 * float(wholes.mean() / total), float(error), tile)
