# SPDX-License-Identifier: GPL-3.0-or-later
"""Ratio of the summed radiances."""

from __future__ import annotations

import numpy as np

from ._base import METRICS, Array, Metric


@METRICS.register("energy_ratio")
class EnergyRatio(Metric):
    """Σx / Σr: 1 when both pictures hold the same energy."""

    ideal = 1.0
    better = "nearer"

    @classmethod
    def compute(cls, candidate: Array, reference: Array) -> float:
        total = reference.sum()
        return float(np.sum(candidate) / total) if total else float("nan")
