# SPDX-License-Identifier: GPL-3.0-or-later
"""Mean signed relative error."""

from __future__ import annotations

import numpy as np

from ._base import METRICS, Array, Metric, relative_errors


@METRICS.register("mean_signed_relative_error")
class MeanSignedRelativeError(Metric):
    """mean[(x−r) / max(r, 0.01·mean(r))]: positive where the candidate is brighter."""

    better = "nearer"

    @classmethod
    def compute(cls, candidate: Array, reference: Array) -> float:
        return float(np.mean(relative_errors(candidate, reference)))
