# SPDX-License-Identifier: GPL-3.0-or-later
"""Student's t against tables and closed forms, Holm against its definition."""

import doctest

import numpy as np
import pytest

from blender_rad.compare import statistics
from blender_rad.compare.statistics import (
    holm,
    p_equivalent,
    p_outside,
    t_quantile,
    t_survival,
)

# Abramowitz and Stegun, Handbook of Mathematical Functions (1964), table 26.10
TABLE = [
    (0.10, 1, 3.078),
    (0.005, 1, 63.657),
    (0.025, 2, 4.303),
    (0.005, 2, 9.925),
    (0.025, 7, 2.365),
    (0.005, 7, 3.499),
    (0.0005, 7, 5.408),
    (0.025, 10, 2.228),
    (0.025, 30, 2.042),
    (0.0005, 120, 3.373),
]


@pytest.mark.parametrize(("p", "df", "t"), TABLE)
def test_quantiles_are_those_of_the_table(p, df, t):
    assert float(t_quantile(p, df)) == pytest.approx(t, abs=5.1e-4)


def test_survival_has_its_closed_forms_far_into_the_tails():
    t = np.concatenate([-np.logspace(-3, 6, 40), np.logspace(-3, 6, 40)])
    one = np.arctan2(1.0, t) / np.pi
    two = 1.0 / (np.hypot(t, np.sqrt(2.0)) * (np.hypot(t, np.sqrt(2.0)) + t))
    three = 0.5 - (np.arctan(t / np.sqrt(3)) + t * np.sqrt(3) / (3 + t**2)) / np.pi
    positive = t > 0
    np.testing.assert_allclose(t_survival(t, 1.0), one, rtol=1e-12)
    np.testing.assert_allclose(t_survival(t, 2.0)[positive], two[positive], rtol=1e-12)
    np.testing.assert_allclose(t_survival(t, 3.0), three, atol=1e-14)


def test_a_fractional_number_of_degrees_is_the_integral_of_the_density():
    x = np.linspace(0.0, 3.0, 200001)
    density = (1.0 + x**2 / 4.6) ** -2.8
    tail = np.tan(np.linspace(0.0, np.pi / 2, 200001)[:-1])
    whole = np.sum((1.0 + tail**2 / 4.6) ** -2.8 * (1.0 + tail**2)) * (np.pi / 2) / 200000
    whole -= 0.5 * (np.pi / 2) / 200000  # trapezoid rule: half of the first sample, which is 1
    part = (np.sum(density) - 0.5 * (density[0] + density[-1])) * 3.0 / 200000
    assert float(t_survival(3.0, 4.6)) == pytest.approx(0.5 * (1.0 - part / whole), rel=1e-7)


def test_quantile_and_survival_undo_each_other():
    p, df = np.meshgrid(np.logspace(-12, np.log10(0.4), 30), [1.0, 2.5, 7.0, 31.0, 200.0])
    np.testing.assert_allclose(t_survival(t_quantile(p, df), df), p, rtol=1e-9)


def test_outside_and_equivalent_are_the_two_sides_of_the_tolerance():
    delta, error, df = np.array([0.0, 0.01, 0.05, -0.05]), np.full(4, 0.004), np.full(4, 7.0)
    tolerance = np.full(4, 0.01)
    outside = p_outside(delta, error, df, tolerance)
    equivalent = p_equivalent(delta, error, df, tolerance)
    assert outside[0] > 0.03
    assert outside[1] == pytest.approx(0.5, abs=1e-3)
    assert equivalent[1] == pytest.approx(0.5)
    assert outside[2] == outside[3] < 1e-4
    assert equivalent[2] > 0.999
    two_sided = p_outside(np.array([2.365]), np.ones(1), np.full(1, 7.0), np.zeros(1))
    assert float(two_sided[0]) == pytest.approx(0.05, abs=1e-4)


def test_holm_steps_down_and_stops_at_the_first_that_fails():
    p = np.array([0.012, 0.3, 0.010, 0.04])
    assert holm(p, 0.05).tolist() == [True, False, True, False]
    assert not holm(np.array([0.02, 0.02, 0.02]), 0.05).any()
    assert holm(np.zeros(0), 0.05).tolist() == []


def test_holm_weights_share_alpha_out():
    p, weights = np.array([0.02, 0.0001]), np.array([0.9, 0.1])
    assert holm(p, 0.03, weights).tolist() == [True, True]
    assert holm(p[:1].repeat(2), 0.03, weights).tolist() == [True, True]
    assert holm(np.array([0.02, 0.02]), 0.03, np.array([0.5, 0.5])).tolist() == [False, False]


def test_holm_keeps_the_chance_of_any_false_alarm_below_alpha():
    rng, alpha, repeats = np.random.default_rng(5), 0.05, 4000
    weights = np.concatenate([np.full(3, 0.2), np.full(20, 0.02)])
    false = sum(holm(rng.random(23), alpha, weights).any() for _ in range(repeats))
    assert 0.03 * repeats < false < (alpha + 3 * np.sqrt(alpha * 0.95 / repeats)) * repeats


def test_the_doctests_hold():
    assert doctest.testmod(statistics).failed == 0
