# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the witness differs, at the finest scale at which it can be told from noise."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools
from ..compare.claims import TILE_TOLERANCES
from ..compare.pools import DARK, FLOAT32_ROUNDING, TILE, block_sums
from ..film import Image
from .data import ReportData

Scalar = TypeVar("Scalar", bound=np.generic)

SIZES = TILE, TILE // 2, TILE // 4  # of blocks, coarsest first [px]
CLEAR_OF_NOISE = 4.0  # standard errors: there are thousands of blocks


def spread(blocks: NDArray[Scalar], size: int, shape: tuple[int, int]) -> NDArray[Scalar]:
    """Return `blocks` blown up to pixels, (h, w); the reverse of `block_sums`."""
    return np.repeat(np.repeat(blocks, size, 0), size, 1)[: shape[0], : shape[1]]


def relative_difference(data: ReportData, size: int) -> tuple[Image, Image]:
    """Return (witness − ours) / ours of block means and its standard error, both by block.

    Blocks darker than 5 % of the picture's mean are measured against that, so that the dark does
    not shout. Channels of a pixel come from the same samples and are taken as fully correlated,
    σ = Σ wᵢ σᵢ, and pixels as independent, which they are less than (blue noise): both err on the
    side of more noise.
    """
    known = [v for v in (data.variance_ours, data.variance_witness) if v is not None]
    variances = [data.luminance(np.sqrt(np.maximum(v, 0.0))) ** 2 for v in known]
    planes = [np.ones(data.compared.shape), data.luminance(data.ours), data.luminance(data.witness)]
    pixels, ours, witness, variance = (
        block_sums(plane * data.compared, size, 0) for plane in (*planes, np.sum(variances, axis=0))
    )
    floor = DARK * ours.sum() / max(pixels.sum(), 1.0) * pixels
    scale = np.maximum(np.maximum(ours, floor), np.finfo(np.float64).tiny)
    return (witness - ours) / scale, np.hypot(np.sqrt(variance) / scale, FLOAT32_ROUNDING)


def difference(data: ReportData, tolerance: float) -> tuple[Image, NDArray[np.int8]]:
    """Return a signed map of witness over ours, and the tiles beyond their tolerance.

    The map (h, w) is (witness − ours) / ours of the finest block that stands clear of noise, 0
    where none does, nan where nothing is compared. Tiles (⌈h/16⌉, ⌈w/16⌉) are +1 where the witness
    is too bright by more than noise, −1 where it is too dark, else 0.
    """
    shape = data.ours.shape[0], data.ours.shape[1]
    shown, tiles = np.zeros(shape), np.zeros((0, 0), np.int8)
    for size in SIZES:
        relative, noise = relative_difference(data, size)
        noise *= CLEAR_OF_NOISE
        if size == TILE:
            off = np.abs(relative) - noise > TILE_TOLERANCES * tolerance
            tiles = (np.sign(relative) * off).astype(np.int8)
        clear = spread(np.abs(relative) > noise, size, shape)
        shown = np.where(clear, spread(relative, size, shape), shown)
    return np.where(data.compared, shown, np.nan), tiles


def outline(mask: Bools, shape: tuple[int, int]) -> str:
    """Return an SVG path [px] along the edges between tiles in and out of `mask`."""
    padded, path = np.pad(mask, 1), ""
    for cells, (tall, wide), across in ((padded, shape, "H"), (padded.T, shape[::-1], "V")):
        rows, columns = np.nonzero(cells[1:, 1:-1] != cells[:-1, 1:-1])
        ends = np.minimum([columns * TILE, (columns + 1) * TILE], wide).T
        for level, (start, end) in zip(np.minimum(rows * TILE, tall), ends, strict=True):
            x, y = (start, level) if across == "H" else (level, start)
            path += f"M{x} {y}{across}{end}"
    return path
