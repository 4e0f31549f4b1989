# SPDX-License-Identifier: GPL-3.0-or-later
"""What a metric declares, and the table of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...registry import Registry

Array = NDArray[np.float64]

METRICS: Registry[type[Metric]] = Registry("blender_rad.compare.metrics", "metric")


class Metric(ABC):
    """A number for how far a candidate is from a reference; nan where it has no meaning."""

    unit: ClassVar[str] = "1"
    ideal: ClassVar[float] = 0.0
    better: ClassVar[Literal["lower", "nearer"]] = "lower"

    @classmethod
    @abstractmethod
    def compute(cls, candidate: Array, reference: Array) -> float:
        """Return the metric of radiances (n, 3); the reference is the witness."""


def relative_errors(candidate: Array, reference: Array) -> Array:
    """Return (x − r) / max(r, 0.01·mean(r)), the shape of both; the mean is over all values."""
    floor = np.maximum(reference, 0.01 * reference.mean())
    return np.divide(
        candidate - reference, floor, out=np.full_like(floor, np.nan), where=floor > 0
    )


def compute_all(candidate: Array, reference: Array) -> dict[str, float]:
    """Return every registered metric by name; nan for pictures without pixels."""
    if candidate.size == 0:
        return {name: float("nan") for name in METRICS}
    return {name: metric.compute(candidate, reference) for name, metric in METRICS.items()}
