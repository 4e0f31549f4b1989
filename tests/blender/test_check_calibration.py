# SPDX-License-Identifier: GPL-3.0-or-later
"""A trial of the nightly calibration: Cycles agrees, and a stronger light is found."""

import pytest

from tests.nightly import calibration

TRIALS = 1  # of two comparisons each


def test_cycles_agrees_and_a_stronger_light_is_found() -> None:
    bench = calibration.Bench(calibration.build(), (32, 24))
    tally = calibration.Tally()
    for number in range(TRIALS):
        bench.trial(number, tally)
    assert tally.unchanged == {"agree": TRIALS}
    assert tally.stronger == {"differ": TRIALS}
    assert tally.found == TRIALS


@pytest.mark.parametrize(
    ("count", "trials", "interval"),
    [(0, 100, (0.0, 0.0362)), (1, 100, (0.00025, 0.0545)), (100, 100, (0.9638, 1.0))],
)
def test_binomial_intervals(count: int, trials: int, interval: tuple[float, float]) -> None:
    assert calibration.binomial_interval(count, trials) == pytest.approx(interval, abs=5e-5)
