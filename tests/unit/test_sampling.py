# SPDX-License-Identifier: GPL-3.0-or-later
"""The points are nets, uniform, independent between pixels, streams and dimensions."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.sampling import Points

PIXELS, COUNT = 500, 64


def sequences(stream: int = 0, dimension: int = 0, seed: int = 0) -> np.ndarray:
    pixel = np.repeat(np.arange(PIXELS), COUNT)
    index = np.tile(np.arange(COUNT), PIXELS)
    made = Points(pixel, np.full_like(pixel, stream), index, seed)
    return made.pair(dimension).reshape(PIXELS, COUNT, 2)


@pytest.mark.parametrize("across", [1, 2, 4, 8, 16, 32, 64])
def test_every_elementary_interval_holds_one_point(across: int) -> None:
    u = sequences()
    cells = np.floor(u[..., 0] * across) * (COUNT // across) + np.floor(u[..., 1] * COUNT / across)
    assert all(len(np.unique(row)) == COUNT for row in cells)


def test_single_points_are_uniform() -> None:
    first = sequences()[:, 0]
    histogram = np.histogram2d(first[:, 0], first[:, 1], bins=5, range=[[0, 1], [0, 1]])[0]
    chi2 = np.sum((histogram - PIXELS / 25) ** 2 / (PIXELS / 25))
    assert chi2 < 51.2  # 99.9 % quantile with 24 degrees of freedom


@pytest.mark.parametrize("other", [{"stream": 1}, {"dimension": 1}, {"seed": 1}])
def test_randomisations_are_independent(other: dict[str, int]) -> None:
    a, b = sequences(), sequences(**other)
    assert not np.array_equal(a, b)
    correlation = np.corrcoef(a[:, 0, 0], b[:, 0, 0])[0, 1]
    assert abs(correlation) < 4 / np.sqrt(PIXELS)


def test_integrates_far_better_than_chance() -> None:
    inside = (sequences() ** 2).sum(axis=-1) < 1.0
    variance = inside.mean(axis=1).var()
    by_chance = np.pi / 4 * (1 - np.pi / 4) / COUNT
    assert variance < 0.25 * by_chance
    assert inside.mean() == pytest.approx(np.pi / 4, abs=4 * np.sqrt(variance / PIXELS))
