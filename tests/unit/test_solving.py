# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers from targets: Karush, Kuhn and Tucker's conditions, and ties."""

import numpy as np
import pytest

from blender_rad.solving import factors, nnls


def test_nnls_meets_the_conditions_of_a_minimum():
    """x ≥ 0, Aᵀ(b - Ax) ≤ 0, and = 0 where x > 0: no other point is as near."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        rows, columns = rng.integers(1, 20, 2)
        a = rng.normal(size=(rows + columns, columns)) * 10.0 ** rng.uniform(-3, 3, columns)
        b = rng.normal(size=rows + columns)
        x = nnls(a, b)
        slope = a.T @ (b - a @ x) / np.linalg.norm(a, axis=0)
        assert (x >= 0.0).all() and slope.max() < 1e-10, seed
        assert np.abs(slope[x > 0.0]).max(initial=0.0) < 1e-10, seed


@pytest.mark.parametrize(
    ("shares", "targets", "expected"),
    [
        ([[100.0, 100.0]], [300.0], [1.5, 1.5]),  # of all that reach it, the least change
        ([[100.0, 0.0]], [300.0], [3.0, 1.0]),  # what gives nothing here stays
        ([[1.0, 1.0], [1.0, 0.0]], [0.5, 1.0], [0.75, 0.0]),  # (1, -0.5) without the limit
        ([[2.0], [2.0]], [3.0, 5.0], [2.0]),
        ([[0.0]], [3.0], [1.0]),
    ],
)
def test_factors(shares, targets, expected):
    found = factors(np.array(shares), np.array(targets))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
