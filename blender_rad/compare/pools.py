# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over cells of 4×4 and tiles of 16×16 pixels: what the statistics are made of.

Witness pixels within a seed depend on each other (blue noise), so nothing here ever adds up their
variances: differences are pooled seed by seed, and the spread over seeds is taken afterwards. Our
own pixels are independent, so their variances do add up.
"""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from ..arrays import Bools, Floats, Ints, Singles
from ..film import Film

Picture = Singles | Floats

MIN_TILE_PIXELS = 16
DARK = 0.05
CELL = 4
CELLS_A_TILE = 4
TILE = CELL * CELLS_A_TILE
FLOAT32_ROUNDING = 1e-5  # relative; seeds can agree to the last bit, which is not certainty
MAX_DF = 200.0  # beyond it t is normal for our purposes, and the incomplete beta stays cheap


def block_sums(image: Floats, size: int, first: int = -3) -> Floats:
    """Return sums over `size`×`size` blocks of two axes, those of (…, h, w, c) by default.

    Blocks at the right and lower edge may be smaller.
    """
    for axis in (first, first + 1):
        starts = np.arange(0, image.shape[axis], size, dtype=np.intp)
        image = np.add.reduceat(image, starts, axis=axis)
    return image


def spread_out(tiles: Floats, shape: tuple[int, ...]) -> Floats:
    """Return values of tiles (th, tw, ...) for each of their cells, `shape` (ch, cw, ...)."""
    cells = tiles.repeat(CELLS_A_TILE, axis=0).repeat(CELLS_A_TILE, axis=1)
    return cells[: shape[0], : shape[1]]


@dataclass(frozen=True)
class Cells:
    """Sums over the compared pixels of each cell of 4×4 pixels; replicates are seeds, or parts."""

    names: tuple[str, ...]  # of our lights
    counts: Floats  # (r, ch, cw, 1) compared pixels, or (1, ch, cw, 1) where all are alike
    witness: Floats  # (r, ch, cw, 3)
    ours: Floats  # (ch, cw, 3), as are the next two
    seen: Floats  # directly seen emission
    variance: Floats  # of the sum of ours
    layers: Floats  # (j, ch, cw, 3) our lights
    noise: Floats  # likewise, a draw of their noise

    def residual(self, model: Floats) -> Floats:
        """Return what a picture of cell sums (ch, cw, 3) leaves of the witness, (r, ch, cw, 3)."""
        return self.witness - np.where(self.counts > 0, model, 0.0)


def cells_from_seeds(film: Film, seeds: Picture, compared: Bools) -> Cells:
    """Return the cells of witness renders (s, h, w, 3): every seed sees every cell."""
    ours, seen, variance = (
        cell_sums(image, compared) for image in (film.radiance, film.seen, film.variance)
    )
    layers, noise = (
        np.array([cell_sums(one[name], compared) for name in film.lights]).reshape(-1, *ours.shape)
        for one in (film.lights, film.noise)
    )
    counts = block_sums(compared[..., None].astype(float), CELL)[None]
    witness = np.stack([cell_sums(seed, compared) for seed in seeds])
    return Cells(tuple(film.lights), counts, witness, ours, seen, variance, layers, noise)


def cell_sums(image: Picture, compared: Bools) -> Floats:
    """Return sums of an (h, w, 3) picture over the compared pixels of each cell."""
    return block_sums(np.where(compared[..., None], image, 0.0).astype(float), CELL)


def split_in_space(cells: Cells) -> Cells:
    """Return eight replicates of one picture: each sees two scattered cells of every tile.

    Their spread holds the picture's noise at the scale of cells and above, and any difference in
    structure; blue noise makes it too large, never too small.
    """
    rows, columns = np.indices(cells.counts.shape[1:3])
    group = (columns + 2 * (rows // 2 % 2)) % 4 + 4 * (rows % 2)
    chosen = (group == np.arange(8)[:, None, None])[..., None]
    mean = cells.witness.mean(axis=0)
    return replace(cells, counts=chosen * cells.counts[0], witness=chosen * mean)


@dataclass(frozen=True)
class Estimates:
    """Numbers with their noise; all (n,)."""

    value: Floats
    witness_variance: Floats
    our_variance: Floats
    df: Floats  # degrees of freedom of the sum of both (Welch and Satterthwaite)
    scale: Floats  # what tolerances are relative to

    @property
    def error(self) -> Floats:
        """Standard error, (n,)."""
        return np.sqrt(self.witness_variance + self.our_variance)

    def at(self, index: Bools | Ints) -> Self:
        """Return those at `index`."""
        return replace(self, **{f.name: getattr(self, f.name)[index] for f in fields(self)})


def estimate(replicates: Floats, our_variance: Floats, scale: Floats) -> Estimates:
    """Return the mean of `replicates` (r, n), with the spread over them as its noise.

    The float32 floor is relative to `scale` (n,). Our own variance is taken as known:
    df = (r−1) (σ_w² + σ_o²)² / σ_w⁴.
    """
    count = len(replicates)
    spread = np.var(replicates, axis=0, ddof=1) / count
    floor = np.maximum((FLOAT32_ROUNDING * scale) ** 2, np.finfo(float).tiny ** 0.5)
    witness = np.maximum(spread, floor)
    df = np.minimum((count - 1) * (1.0 + our_variance / witness) ** 2, MAX_DF)
    return Estimates(replicates.mean(axis=0), witness, our_variance, df, scale)


@dataclass(frozen=True)
class Pools:
    """Mean differences (witness less ours) of the frame and of each tile, by channel.

    Their scale is our mean, floored as the tolerance needs it.
    """

    frame: Estimates  # (3,)
    tiles: Estimates  # (t·3,), channels running fastest
    pixels: Floats  # (t·3,) compared pixels of the tile
    where: Ints  # (t, 2) row and column of each tile in the grid of tiles

    def worst(self, difference: Floats) -> tuple[float, int, int]:
        """Return the largest of `difference` (t·3) over the scale, and its tile's first (x, y)."""
        relative = difference / np.maximum(self.tiles.scale, np.finfo(float).tiny)
        worst = int(np.argmax(np.abs(relative)))
        row, column = self.where[worst // 3] * TILE
        return float(relative[worst]), int(column), int(row)


def kept_tiles(cells: Cells) -> Bools:
    """Return which tiles hold enough compared pixels, in every replicate, (th, tw)."""
    counts = block_sums(cells.counts, CELLS_A_TILE)[..., 0]
    whole = block_sums(cells.counts.max(axis=0), CELLS_A_TILE)[..., 0]
    return (whole >= MIN_TILE_PIXELS) & (counts > 0).all(axis=0)


def tile_means(cells: Cells, difference: Floats) -> Floats:
    """Return means over the kept tiles of sums over cells (r, ch, cw, 3), as (r, t, 3)."""
    kept = kept_tiles(cells)
    counts = block_sums(cells.counts, CELLS_A_TILE)[:, kept]
    return block_sums(difference, CELLS_A_TILE)[:, kept] / counts


def frame_means(cells: Cells) -> Floats:
    """Return the mean difference (witness less ours) over the frame, (r, 3)."""
    number = np.maximum(cells.counts.sum(axis=(1, 2)), 1.0)
    return cells.residual(cells.ours).sum(axis=(1, 2)) / number


def pool(cells: Cells) -> Pools:
    """Return the differences of the frame and the tiles.

    A channel counts relative to its own mean in the tile, but to no less than `DARK` times its mean
    in the picture, and a channel of the picture to no less than `DARK` times the mean of the three:
    the noise of a channel that holds next to nothing decides nothing. Tiles of fewer than
    `MIN_TILE_PIXELS` compared pixels are left to the frame.
    """
    total = cells.counts.max(axis=0)
    picture = np.abs(cells.ours.sum(axis=(0, 1))) / total.sum()
    variance = cells.variance.sum(axis=(0, 1)) / total.sum() ** 2
    scale = np.maximum(picture, DARK * picture.mean())
    frame = estimate(frame_means(cells), variance, scale)
    kept = kept_tiles(cells)
    number, ours, variance = (
        block_sums(sums, CELLS_A_TILE)[kept] for sums in (total, cells.ours, cells.variance)
    )
    scale = np.maximum(np.abs(ours) / number, DARK * scale).ravel()
    means = tile_means(cells, cells.residual(cells.ours))
    tiles = estimate(means.reshape(len(means), -1), (variance / number**2).ravel(), scale)
    return Pools(frame, tiles, np.repeat(number.ravel(), 3), np.argwhere(kept))
