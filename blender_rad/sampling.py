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

from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Ints

Words = NDArray[np.uint32]

_INDEX_BITS = 16
MAX_POINTS = 1 << _INDEX_BITS


def _reverse_bits(x: Words) -> Words:
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F)):
        high = x >> np.uint32(shift)
        high &= np.uint32(mask)
        x = x & np.uint32(mask)
        x <<= np.uint32(shift)
        x |= high
    return x.byteswap()


def _sobol_tables() -> Words:
    """Return Sobol's first two dimensions, bit-reversed, by bit-reversed index of 16 bits."""
    index = np.arange(MAX_POINTS, dtype=np.uint32)
    first = _reverse_bits(index)
    second = np.zeros_like(first)
    direction = 1 << 31
    for bit in range(_INDEX_BITS):
        second ^= np.where((index >> bit) & 1, np.uint32(direction), np.uint32(0))
        direction ^= direction >> 1
    order = first >> np.uint32(32 - _INDEX_BITS)
    return np.stack([order, _reverse_bits(second).take(order)])


_BY_REVERSED_INDEX = _sobol_tables()
_AXES = np.array([[0x27D4EB2F], [0x4FA9D65E]], dtype=np.uint32)  # set the two apart


def _owen_mix(reversed_bits: Words, seed: Words) -> Words:
    """Scramble bit-reversed words so that each bit depends on itself and those below alone."""
    x = reversed_bits ^ (reversed_bits * np.uint32(0x3D20ADEA))
    x += seed
    x *= (seed >> np.uint32(16)) | np.uint32(1)
    x ^= x * np.uint32(0x05526C56)
    x ^= x * np.uint32(0x53A22864)
    return x


def _mixed(words: Words) -> Words:
    """Return well-mixed words, each from its own (the finaliser of MurmurHash3)."""
    h = words ^ (words >> np.uint32(16))
    h *= np.uint32(0x85EBCA6B)
    h ^= h >> np.uint32(13)
    h *= np.uint32(0xC2B2AE35)
    h ^= h >> np.uint32(16)
    return h


class Points:
    """One point of each of many sequences, in as many dimensions as are asked for.

    `index` (n,) below `MAX_POINTS` numbers the points of the sequences that `pixel` and `stream`
    (n,) stand for; `seed` is of the whole run.
    """

    def __init__(
        self, pixel: NDArray[Any], stream: NDArray[Any], index: NDArray[Any], seed: int
    ) -> None:
        start = np.full(1, seed & 0xFFFFFFFF, dtype=np.uint32)
        self._key = _mixed(start) ^ (pixel.astype(np.uint32) * np.uint32(0x9E3779B1))
        self._key = _mixed(self._key) ^ (stream.astype(np.uint32) * np.uint32(0x85EBCA77))
        self._key = _mixed(self._key)
        self._index = _reverse_bits(index.astype(np.uint32))

    def take(self, rows: Ints) -> Points:
        """Return those of the sequences `rows` (k,) alone."""
        chosen = copy(self)
        chosen._key, chosen._index = self._key.take(rows), self._index.take(rows)
        return chosen

    def pair(self, dimension: int) -> Floats:
        """Return points (n, 2) in [0, 1) of the pair `dimension`."""
        key = _mixed(self._key + np.uint32((dimension * 0xC2B2AE3D + 1) & 0xFFFFFFFF))
        place = _owen_mix(self._index, key) >> np.uint32(32 - _INDEX_BITS)
        points = _BY_REVERSED_INDEX.take(place, axis=1)
        words = _reverse_bits(_owen_mix(points, _mixed(key + _AXES)))
        return np.multiply(words, 2.0**-32, dtype=np.float64).T
