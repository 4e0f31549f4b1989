# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the witness differs, at the finest scale at which it can be told from noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..film import Image
from .data import ReportData

Scalar = TypeVar("Scalar", bound=np.generic)

TILE = 16
FINEST = 4
FLOOR = 0.05  # of the picture's mean: what darker tiles are compared with
TILE_TOLERANCES = 5.0  # a tile may be off by five times the tolerance
CLEAR_OF_NOISE = 4.0  # standard errors: there are thousands of blocks
ROUNDING = 1e-5  # relative, of float32 pictures


@dataclass(frozen=True)
class Difference:
    """A signed map of witness over ours.

    Attributes
    ----------
    relative : (h, w) (witness − ours) / ours, 0 where noise hides it, nan where not compared.
    tiles : (⌈h/16⌉, ⌈w/16⌉) +1 too bright beyond the tolerance of tiles, −1 too dark, else 0.
    noise_known : whether either side came with a variance.
    """

    relative: Image
    tiles: NDArray[np.int8]
    noise_known: bool


def pool(values: Image, size: int) -> Image:
    """Return the sums of `values` (h, w, …) over blocks of `size` pixels, (⌈h/size⌉, ⌈w/size⌉, …).

    Blocks at the right and lower edge may be smaller.
    """
    rows, columns = (np.arange(0, length, size, dtype=np.intp) for length in values.shape[:2])
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)


def spread(blocks: NDArray[Scalar], size: int, shape: tuple[int, int]) -> NDArray[Scalar]:
    """Return `blocks` blown up to pixels, (h, w); the reverse of `pool`."""
    return np.repeat(np.repeat(blocks, size, 0), size, 1)[: shape[0], : shape[1]]


def block_sums(data: ReportData) -> dict[int, Image]:
    """Return sums over blocks of 16, 8 and 4 pixels, coarsest first, each (⌈h/n⌉, ⌈w/n⌉, 4).

    Summed are: pixels compared, our luminance, the witness's, and the variance of their
    difference. Channels of a pixel come from the same samples and are taken as fully correlated,
    σ = Σ wᵢ σᵢ, and pixels as independent, which they are less than (blue noise): both err on the
    side of more noise.
    """
    use = data.compared.astype(np.float64)
    variances = [v for v in (data.variance_ours, data.variance_witness) if v is not None]
    noise = [data.luminance(np.sqrt(np.maximum(v, 0.0))) ** 2 for v in variances]
    variance = sum(noise, np.zeros_like(use))
    values = [np.ones_like(use), data.luminance(data.ours), data.luminance(data.witness), variance]
    sums = pool(np.stack([value * use for value in values], axis=-1), FINEST)
    coarser = pool(sums, 2)
    return {TILE: pool(coarser, 2), 2 * FINEST: coarser, FINEST: sums}


def relative_difference(sums: Image) -> tuple[Image, Image]:
    """Return (witness − ours) / ours of block means and its standard error, both by block.

    Blocks darker than 5 % of the picture's mean are measured against that, so that the dark does
    not shout.
    """
    pixels, ours, witness, variance = np.moveaxis(sums, -1, 0)
    floor = FLOOR * ours.sum() / max(pixels.sum(), 1.0) * pixels
    scale = np.maximum(np.maximum(ours, floor), np.finfo(np.float64).tiny)
    return (witness - ours) / scale, np.hypot(np.sqrt(variance) / scale, ROUNDING)


def difference(data: ReportData, tolerance: float) -> Difference:
    """Return the map of `data`: every pixel shows the finest block that stands clear of noise."""
    shape = data.ours.shape[0], data.ours.shape[1]
    shown, levels = np.zeros(shape), block_sums(data)
    for size, sums in levels.items():
        relative, noise = relative_difference(sums)
        clear = np.abs(relative) > CLEAR_OF_NOISE * noise
        shown = np.where(spread(clear, size, shape), spread(relative, size, shape), shown)
    tiles = _tiles_off(levels[TILE], tolerance) if data.tiles is None else data.tiles
    known = data.variance_ours is not None or data.variance_witness is not None
    return Difference(np.where(data.compared, shown, np.nan), tiles, known)


def _tiles_off(sums: Image, tolerance: float) -> NDArray[np.int8]:
    """Return which tiles are beyond their tolerance by more than noise, with their sign."""
    relative, noise = relative_difference(sums)
    off = np.abs(relative) - CLEAR_OF_NOISE * noise > TILE_TOLERANCES * tolerance
    return (np.sign(relative) * off).astype(np.int8)


def outline(mask: NDArray[np.bool_], shape: tuple[int, int]) -> str:
    """Return an SVG path [px] along the edges between tiles in and out of `mask`."""
    height, width = shape
    padded = np.pad(mask, 1)
    rows, columns = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])
    x, y = columns * TILE, np.minimum(rows * TILE, height)
    right = np.minimum(x + TILE, width)
    level = [f"M{a} {b}H{c}" for a, b, c in zip(x, y, right, strict=True)]
    rows, columns = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])
    x, y = np.minimum(columns * TILE, width), rows * TILE
    lower = np.minimum(y + TILE, height)
    return "".join(level + [f"M{a} {b}V{c}" for a, b, c in zip(x, y, lower, strict=True)])
