# SPDX-License-Identifier: GPL-3.0-or-later
"""Relative mean square error."""

from __future__ import annotations

import numpy as np

from ._base import METRICS, Array, Metric


@METRICS.register("relmse")
class RelMSE(Metric):
    """mean[(x−r)² / (r² + 0.01·mean(r)²)]."""

    @classmethod
    def compute(cls, candidate: Array, reference: Array) -> float:
        scale = reference**2 + 0.01 * reference.mean() ** 2
        square = (candidate - reference) ** 2
        ratio = np.divide(square, scale, out=np.full_like(scale, np.nan), where=scale > 0)
        return float(np.mean(ratio))
