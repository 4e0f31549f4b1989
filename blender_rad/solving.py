# SPDX-License-Identifier: GPL-3.0-or-later
"""Which powers give the illuminances that are wanted: light is linear, so this is algebra."""

import numpy as np

from .arrays import Floats

HOLD = 1e-6  # weight of a factor's change, against the largest share: it decides only ties


def factors(shares: Floats, targets: Floats) -> Floats:
    """Return the factors x ≥ 0 (k,) on lights for which ``shares @ x`` is nearest to `targets`.

    `shares` (n, k) is what each light now gives to each meter, `targets` (n,) in the same unit. Of
    equally good answers it is the one that changes the lights least: |Ax - b|² + (εa)²|x - 1|² is
    minimised, a the largest share.
    """
    hold = HOLD * np.abs(shares).max(initial=0.0) or 1.0
    count = shares.shape[1]
    rows = np.concatenate([shares, hold * np.eye(count)])
    return nnls(rows, np.concatenate([targets, np.full(count, hold)]))


def nnls(a: Floats, b: Floats) -> Floats:
    """Return x ≥ 0 (k,) that minimises |Ax - b|; `a` (n, k) has full rank.

    The active set method of C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974.
    """
    length = np.linalg.norm(a, axis=0)
    a = a / length
    x, free = np.zeros(a.shape[1]), np.zeros(a.shape[1], dtype=bool)
    small = 1e-14 * np.abs(b).sum()
    for _ in range(10 * len(x)):
        gain = np.where(free, -np.inf, a.T @ (b - a @ x))
        if gain.max(initial=-np.inf) <= small:
            break
        free[np.argmax(gain)] = True
        while True:
            best = np.zeros_like(x)
            best[free] = np.linalg.lstsq(a[:, free], b, rcond=None)[0]
            falling = free & (best <= 0.0)
            if not falling.any():
                break
            ratio = np.where(falling, x / np.where(falling, x - best, 1.0), np.inf)
            x += ratio.min() * (best - x)
            free[np.argmin(ratio)] = False
            x[~free] = 0.0
        x = best
    return x / length
