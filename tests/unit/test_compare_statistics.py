# SPDX-License-Identifier: GPL-3.0-or-later
"""Student's t against tables and closed forms, Holm against its definition, metrics by hand."""

import doctest
import math

import numpy as np
import pytest

from blender_rad.compare import statistics
from blender_rad.compare.metrics import METRICS, compute_all
from blender_rad.compare.statistics import holm, p_outside, t_quantile, t_survival


def test_quantiles_are_those_of_abramowitz_and_stegun():
    """Table 26.10 of the Handbook of Mathematical Functions (1964)."""
    p = [0.10, 0.005, 0.025, 0.005, 0.025, 0.005, 0.0005, 0.025, 0.025, 0.0005]
    df = [1, 1, 2, 2, 7, 7, 7, 10, 30, 120]
    printed = [3.078, 63.657, 4.303, 9.925, 2.365, 3.499, 5.408, 2.228, 2.042, 3.373]
    np.testing.assert_allclose(t_quantile(p, df), printed, atol=5.1e-4)
    p, df = np.meshgrid(np.logspace(-12, np.log10(0.4), 30), [1.0, 2.5, 7.0, 31.0, 200.0])
    np.testing.assert_allclose(t_survival(t_quantile(p, df), df), p, rtol=1e-9)


def test_survival_has_its_closed_forms_far_into_the_tails():
    positive = np.logspace(-3, 6, 40)
    t = np.concatenate([-positive, positive])
    one = np.arctan2(1.0, t) / np.pi
    two = 1.0 / (np.hypot(positive, 2**0.5) * (np.hypot(positive, 2**0.5) + positive))
    three = 0.5 - (np.arctan(t / np.sqrt(3)) + t * np.sqrt(3) / (3 + t**2)) / np.pi
    np.testing.assert_allclose(t_survival(t, 1.0), one, rtol=1e-12)
    np.testing.assert_allclose(t_survival(positive, 2.0), two, rtol=1e-12)
    np.testing.assert_allclose(t_survival(t, 3.0), three, atol=1e-14)


def test_outside_of_no_tolerance_is_the_two_sided_test():
    one, seven = np.ones(1), np.full(1, 7.0)
    assert p_outside(2.365 * one, one, seven, 0.0 * one) == pytest.approx(0.05, abs=1e-4)
    assert p_outside(0.01 * one, 0.004 * one, seven, 0.01 * one) == pytest.approx(0.5, abs=1e-3)


def test_a_fractional_number_of_degrees_is_the_integral_of_the_density():
    """Midpoints of ∫ (1 + x²/df)^−(df+1)/2 dx, x = tan a, which is ∫ (1 + x²/df)^… (1 + x²) da."""

    def integral(end):
        x = np.tan((np.arange(20000) + 0.5) / 20000 * end)
        return end * np.mean((1.0 + x**2 / 4.6) ** -2.8 * (1.0 + x**2))

    expected = 0.5 * (1.0 - integral(np.arctan(3.0)) / integral(np.pi / 2))
    assert float(t_survival(3.0, 4.6)) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(
    ('p', 'alpha', 'weights', 'rejected'),
    [
        ([0.012, 0.3, 0.010, 0.04], 0.05, None, [True, False, True, False]),
        ([0.03, 0.02, 0.02], 0.05, None, [False] * 3),  # stops at the first that fails
        ([], 0.05, None, []),
        ([0.02, 0.0001], 0.03, [0.9, 0.1], [True, True]),
        ([0.02, 0.02], 0.03, [0.9, 0.1], [True, True]),
        ([0.02, 0.02], 0.03, [0.5, 0.5], [False, False]),
    ],
)
def test_holm_steps_down_by_weight(p, alpha, weights, rejected):
    weights = None if weights is None else np.array(weights)
    assert holm(np.array(p), alpha, weights).tolist() == rejected


def test_holm_keeps_the_chance_of_any_false_alarm_below_alpha():
    rng, alpha, repeats = np.random.default_rng(5), 0.05, 4000
    weights = np.concatenate([np.full(3, 0.2), np.full(20, 0.02)])
    false = sum(holm(rng.random(23), alpha, weights).any() for _ in range(repeats))
    assert 0.03 * repeats < false < (alpha + 3 * np.sqrt(alpha * 0.95 / repeats)) * repeats


def test_the_doctests_hold():
    assert doctest.testmod(statistics).failed == 0


REFERENCE = np.array([[1.0, 2.0, 0.0], [4.0, 0.0, 5.0]])  # mean 2
CANDIDATE = np.array([[1.1, 2.0, 0.01], [3.6, 0.0, 5.0]])
BY_HAND = {
    'energy_ratio': 11.71 / 12.0,
    'mean_signed_relative_error': (0.1 + 0.0 + 0.01 / 0.02 - 0.1 + 0.0 + 0.0) / 6.0,
    'relmse': (0.01 / 1.04 + 0.0001 / 0.04 + 0.16 / 16.04) / 6.0,
    # absolute errors 0, 0, 0, 0.1, 0.1, 0.5; rank 0.95 · 5 = 4.75
    'p95_absolute_relative_error': 0.1 + 0.75 * 0.4,
}


def test_metrics_are_their_formulas_worked_by_hand():
    assert compute_all(CANDIDATE, REFERENCE) == pytest.approx(BY_HAND, rel=1e-12)
    equal = {name: float(name == 'energy_ratio') for name in METRICS}
    assert compute_all(REFERENCE, REFERENCE) == equal
    for nothing in (np.zeros((0, 3)), np.zeros((4, 3))):
        assert all(math.isnan(v) for v in compute_all(nothing + 1.0, nothing).values())
