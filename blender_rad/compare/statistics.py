# SPDX-License-Identifier: GPL-3.0-or-later
"""Student's t, the test of equivalence, and Holm's correction, on arrays and without SciPy."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats

_log_gamma = np.frompyfunc(math.lgamma, 1, 1)


def _continued_fraction(a: Floats, b: Floats, x: Floats) -> Floats:
    """Return the continued fraction of I_x(a, b) by Lentz's method; needs x < (a+1)/(a+b+2)."""
    c, d = np.ones_like(x), 1.0 / (1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, 2000):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        for term in (even, odd):
            d, c = 1.0 + term * d, 1.0 + term / c
            d, c = (np.where(np.abs(v) < 1e-300, 1e-300, v) for v in (d, c))
            d = 1.0 / d
            value = value * c * d
        if np.all(np.abs(c * d - 1.0) < 1e-14):
            return value
    raise ArithmeticError("the incomplete beta function did not converge")


def _incomplete_beta(a: Floats, b: Floats, x: Floats, one_minus_x: Floats) -> Floats:
    """Return the regularised I_x(a, b), accurate in both tails.

    I_x(a, b) = x^a (1−x)^b / (a B(a, b)) · CF(a, b, x) (NIST DLMF 8.17.22), and
    I_x(a, b) = 1 − I_{1−x}(b, a) where that converges faster. 1−x comes without cancellation.
    """
    swap = x > (a + 1.0) / (a + b + 2.0)
    p, q, u, v = np.where(swap, (b, a, one_minus_x, x), (a, b, x, one_minus_x))
    log_beta = np.asarray(_log_gamma(p) + _log_gamma(q) - _log_gamma(p + q), float)
    with np.errstate(divide="ignore"):
        front = np.exp(p * np.log(u) + q * np.log(v) - log_beta) / p
    value = front * _continued_fraction(p, q, u)
    return np.where(swap, 1.0 - value, value)


def t_survival(t: ArrayLike, df: ArrayLike) -> Floats:
    """Return P(T > t) for Student's t with `df` > 0 degrees of freedom, which need not be whole.

    P(T > t) = I_x(df/2, 1/2) / 2 for t ≥ 0, x = df / (df + t²).

    Examples
    --------
    >>> round(float(t_survival(1.0, 1.0)), 12)  # Cauchy: 1/2 − atan(1)/π
    0.25
    """
    t, df = np.broadcast_arrays(np.asarray(t, float), np.asarray(df, float))
    square = np.clip(t, -1e150, 1e150) ** 2
    x, y = df / (df + square), square / (df + square)
    tail = 0.5 * _incomplete_beta(0.5 * df, np.full_like(df, 0.5), x, y)
    return np.where(t >= 0, tail, 1.0 - tail)


def t_quantile(p: ArrayLike, df: ArrayLike) -> Floats:
    """Return t with P(T > t) = `p`, for 0 < p ≤ 1/2, by halving intervals of log(1 + t)."""
    p, df = np.broadcast_arrays(np.asarray(p, float), np.asarray(df, float))
    low, step = np.zeros(p.shape), 300.0
    for _ in range(64):
        step /= 2.0
        low = np.where(t_survival(np.expm1(low + step), df) >= p, low + step, low)
    return np.expm1(low)


@lru_cache(maxsize=256)
def critical_value(p: float, df: float) -> float:
    """Return `t_quantile` of one pair; the judge asks for the same few again and again."""
    return float(t_quantile(p, df))


def p_outside(delta: Floats, error: Floats, df: Floats, tolerance: Floats) -> Floats:
    """Return the p-value against |true difference| ≤ `tolerance`; small means outside.

    p = P(T > (|d|−τ)/σ) + P(T > (|d|+τ)/σ), the chance at |δ| = τ, where it is largest, of a
    difference at least as large on either side; for τ = 0 it is the two-sided t-test.
    """
    size = np.abs(delta)
    p = t_survival((size - tolerance) / error, df) + t_survival((size + tolerance) / error, df)
    return np.minimum(p, 1.0)


def p_equivalent(delta: Floats, error: Floats, df: Floats, tolerance: Floats) -> Floats:
    """Return the p-value against |true difference| ≥ `tolerance`; small means equivalent.

    The larger of two one-sided tests (TOST): P(T > (τ−|d|)/σ).
    """
    return t_survival((tolerance - np.abs(delta)) / error, df)


def holm(p: Floats, alpha: float, weights: Floats | None = None) -> Bools:
    """Return which hypotheses Holm's step-down procedure rejects.

    The chance of rejecting any true one is at most `alpha`, however the tests depend on each
    other. `weights` share `alpha` out, so that a few important tests need not pay for thousands:
    with p/w in ascending order, reject while p_(i)/w_(i) ≤ α / Σ_{k≥i} w_(k)
    (S. Holm, Scand. J. Statist. 6 (1979) 65-70, section 4).

    Examples
    --------
    >>> holm(np.array([0.01, 0.04, 0.03]), 0.05).tolist()
    [True, False, False]
    """
    w = np.ones(len(p)) if weights is None else weights
    order = np.argsort(p / w)
    remaining = np.cumsum(w[order][::-1])[::-1]
    passed = np.logical_and.accumulate(p[order] * remaining <= alpha * w[order])
    rejected = np.zeros(len(p), bool)
    rejected[order] = passed
    return rejected
