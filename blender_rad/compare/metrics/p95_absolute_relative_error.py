# SPDX-License-Identifier: GPL-3.0-or-later
"""95th percentile of the absolute relative errors."""

from __future__ import annotations

import numpy as np

from ._base import METRICS, Array, Metric, relative_errors


@METRICS.register("p95_absolute_relative_error")
class P95AbsoluteRelativeError(Metric):
    """P95[|x−r| / max(r, 0.01·mean(r))]."""

    @classmethod
    def compute(cls, candidate: Array, reference: Array) -> float:
        return float(np.percentile(np.abs(relative_errors(candidate, reference)), 95.0))
