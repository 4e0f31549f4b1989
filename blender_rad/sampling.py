# SPDX-License-Identifier: GPL-3.0-or-later
"""Low-discrepancy points: Sobol's (0, 2)-sequence, shuffled and scrambled by hashing.

Every pixel, stream and dimension pair has a randomisation of its own, so pixels and streams are
independent of each other, while the points of one stream fill the square evenly. Pairs are padded:
each takes Sobol's first two dimensions in an order shuffled for itself.

References
----------
B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; the bit mixer is that of
N. Vegdahl, "Building a Better LK Hash", 2021.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]

_INDEX_BITS = 16
MAX_POINTS = 1 << _INDEX_BITS


def _reverse_bits(x: Words) -> Words:
    x = ((x >> 1) & np.uint32(0x55555555)) | ((x & np.uint32(0x55555555)) << 1)
    x = ((x >> 2) & np.uint32(0x33333333)) | ((x & np.uint32(0x33333333)) << 2)
    x = ((x >> 4) & np.uint32(0x0F0F0F0F)) | ((x & np.uint32(0x0F0F0F0F)) << 4)
    return x.byteswap()


def _sobol_tables() -> tuple[Words, Words]:
    """Return Sobol's first two dimensions, bit-reversed, for all indices of 16 bits."""
    index = np.arange(MAX_POINTS, dtype=np.uint32)
    first = _reverse_bits(index)
    second = np.zeros_like(first)
    direction = 1 << 31
    for bit in range(_INDEX_BITS):
        second ^= np.where((index >> bit) & 1, np.uint32(direction), np.uint32(0))
        direction ^= direction >> 1
    return index, _reverse_bits(second)


_FIRST_REVERSED, _SECOND_REVERSED = _sobol_tables()


def _owen_mix(reversed_bits: Words, seed: Words) -> Words:
    """Scramble bit-reversed words so that each bit depends on itself and those below alone."""
    x = reversed_bits ^ (reversed_bits * np.uint32(0x3D20ADEA))
    x = x + seed
    x *= (seed >> 16) | np.uint32(1)
    x ^= x * np.uint32(0x05526C56)
    x ^= x * np.uint32(0x53A22864)
    return x


def hash_words(*parts: Any) -> Words:
    """Return one well-mixed uint32 an element from integers or integer arrays that broadcast."""
    h = np.uint32(0x9E3779B9)
    with np.errstate(over="ignore"):
        for part in parts:
            h = h ^ (np.asarray(part).astype(np.uint32) * np.uint32(0xCC9E2D51))
            h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
            h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
            h = h ^ (h >> np.uint32(16))
    return np.asarray(h)


def points(
    pixel: NDArray[Any], stream: NDArray[Any], index: NDArray[Any], dimension: int, seed: int
) -> NDArray[np.float64]:
    """Return points (n, 2) in [0, 1) of the pair `dimension`.

    Parameters
    ----------
    pixel, stream, index : (n,) integers; `index` below `MAX_POINTS` numbers the points of a stream.
    dimension : which pair of dimensions.
    seed : of the whole run.
    """
    key = hash_words(pixel, stream, np.uint32(dimension), np.uint32(seed & _ALL))
    with np.errstate(over="ignore"):
        order = _reverse_bits(_owen_mix(_reverse_bits(index.astype(np.uint32)), key))
        order &= np.uint32(MAX_POINTS - 1)
        x = _reverse_bits(_owen_mix(_FIRST_REVERSED[order], hash_words(key, 1)))
        y = _reverse_bits(_owen_mix(_SECOND_REVERSED[order], hash_words(key, 2)))
    return np.stack([x, y], axis=-1) * 2.0**-32


_ALL = 0xFFFFFFFF
