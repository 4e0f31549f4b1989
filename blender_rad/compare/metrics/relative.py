# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences relative to the reference, which dark pixels may not blow up."""

import numpy as np

from ...arrays import Floats
from . import metric

DARK = 0.01  # of the mean of the reference


def _ratio(numerator: Floats, denominator: Floats) -> Floats:
    nan = np.full_like(denominator, np.nan)
    return np.divide(numerator, denominator, out=nan, where=denominator > 0)


def _relative_errors(candidate: Floats, reference: Floats) -> Floats:
    return _ratio(candidate - reference, np.maximum(reference, DARK * reference.mean()))


@metric
def energy_ratio(candidate: Floats, reference: Floats) -> float:
    """Σx / Σr: 1 when both pictures hold the same energy."""
    total = reference.sum()
    return float(candidate.sum() / total) if total else float("nan")


@metric
def mean_signed_relative_error(candidate: Floats, reference: Floats) -> float:
    """mean[(x−r) / max(r, 0.01·mean(r))]: positive where the candidate is brighter."""
    return float(np.mean(_relative_errors(candidate, reference)))


@metric
def p95_absolute_relative_error(candidate: Floats, reference: Floats) -> float:
    """P95[|x−r| / max(r, 0.01·mean(r))]."""
    return float(np.percentile(np.abs(_relative_errors(candidate, reference)), 95.0))


@metric
def relmse(candidate: Floats, reference: Floats) -> float:
    """mean[(x−r)² / (r² + 0.01·mean(r)²)]."""
    scale = reference**2 + DARK * reference.mean() ** 2
    return float(np.mean(_ratio((candidate - reference) ** 2, scale)))
