# SPDX-License-Identifier: GPL-3.0-or-later
"""The metrics against their formulas worked by hand."""

import math

import numpy as np
import pytest

from blender_rad.compare.metrics import METRICS, compute_all

REFERENCE = np.array([[1.0, 2.0, 0.0], [4.0, 0.0, 5.0]])  # mean 2
CANDIDATE = np.array([[1.1, 2.0, 0.01], [3.6, 0.0, 5.0]])

BY_HAND = {
    'energy_ratio': 11.71 / 12.0,
    'mean_signed_relative_error': (0.1 + 0.0 + 0.01 / 0.02 - 0.1 + 0.0 + 0.0) / 6.0,
    'relmse': (0.01 / 1.04 + 0.0001 / 0.04 + 0.16 / 16.04) / 6.0,
    # absolute errors 0, 0, 0, 0.1, 0.1, 0.5; rank 0.95 · 5 = 4.75
    'p95_absolute_relative_error': 0.1 + 0.75 * 0.4,
}


def test_the_registry_holds_what_the_report_promises():
    assert set(METRICS) == set(BY_HAND)


@pytest.mark.parametrize('name', sorted(BY_HAND))
def test_each_is_its_formula(name):
    assert METRICS[name](CANDIDATE, REFERENCE) == pytest.approx(BY_HAND[name], rel=1e-12)


@pytest.mark.parametrize('name', sorted(BY_HAND))
def test_equal_pictures_have_the_ideal_value(name):
    assert METRICS[name](REFERENCE, REFERENCE) == (name == 'energy_ratio')


def test_no_pixels_and_a_black_witness_have_no_numbers():
    assert all(math.isnan(v) for v in compute_all(np.zeros((0, 3)), np.zeros((0, 3))).values())
    assert all(math.isnan(v) for v in compute_all(np.ones((4, 3)), np.zeros((4, 3))).values())
