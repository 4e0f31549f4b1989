# SPDX-License-Identifier: GPL-3.0-or-later
"""The points are nets, uniform, independent between pixels, streams and dimensions."""

import numpy as np
import pytest

from blender_rad.sampling import Points

PIXELS, COUNT = 500, 64


def sequences(stream=0, dimension=0, seed=0):
    pixel, index = np.repeat(np.arange(PIXELS), COUNT), np.tile(np.arange(COUNT), PIXELS)
    made = Points(pixel, np.full_like(pixel, stream), index, seed)
    return made.pair(dimension).reshape(PIXELS, COUNT, 2)


def test_every_elementary_interval_holds_one_point():
    u = sequences()
    for across in 2 ** np.arange(7):
        column, row = np.floor(u[..., 0] * across), np.floor(u[..., 1] * COUNT / across)
        cells = np.sort(column * (COUNT // across) + row, axis=1)
        np.testing.assert_array_equal(cells, np.broadcast_to(np.arange(COUNT), cells.shape))


def test_single_points_are_uniform():
    first = sequences()[:, 0]
    histogram = np.histogram2d(*first.T, bins=5, range=[[0, 1], [0, 1]])[0]
    assert np.sum((histogram - PIXELS / 25) ** 2) / (PIXELS / 25) < 51.2  # 99.9 %, 24 degrees


@pytest.mark.parametrize("other", [{"stream": 1}, {"dimension": 1}, {"seed": 1}])
def test_randomisations_are_independent(other):
    a, b = sequences(), sequences(**other)
    assert not np.array_equal(a, b)
    assert abs(np.corrcoef(a[:, 0, 0], b[:, 0, 0])[0, 1]) < 4 / np.sqrt(PIXELS)
