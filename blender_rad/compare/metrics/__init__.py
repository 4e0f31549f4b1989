# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that sum up how two pictures differ; a file of this package registers its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...registry import Registry

Array = NDArray[np.float64]
Compute = Callable[[Array, Array], float]


class Metric(NamedTuple):
    """How far a candidate (n, 3) is from a reference, the witness; nan where it has no meaning."""

    compute: Compute
    ideal: float = 0.0
    better: Literal["lower", "nearer"] = "lower"
    unit: str = "1"


METRICS: Registry[Metric] = Registry(__name__, "metric")


def metric(
    ideal: float = 0.0, better: Literal["lower", "nearer"] = "lower", unit: str = "1"
) -> Callable[[Compute], Compute]:
    """Return a decorator that registers a function of candidate and reference by its name."""

    def enter(compute: Compute) -> Compute:
        METRICS.register(compute.__name__)(Metric(compute, ideal, better, unit))
        return compute

    return enter


def compute_all(candidate: Array, reference: Array) -> dict[str, float]:
    """Return every registered metric by name; nan for pictures without pixels."""
    blank = candidate.size == 0
    return {
        name: float("nan") if blank else entry.compute(candidate, reference)
        for name, entry in METRICS.items()
    }
