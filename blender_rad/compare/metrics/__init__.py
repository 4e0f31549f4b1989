# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that sum up how two pictures differ; a file of this package registers its own."""

from collections.abc import Callable

from ...arrays import Floats
from ...registry import Registry

Compute = Callable[[Floats, Floats], float]


METRICS: Registry[Compute] = Registry(__name__, "metric")


def metric(compute: Compute) -> Compute:
    """Register how far a candidate (n, 3) is from a reference, the witness; nan where it is not."""
    return METRICS.register(compute.__name__)(compute)


def compute_all(candidate: Floats, reference: Floats) -> dict[str, float]:
    """Return every registered metric by name; nan for pictures without pixels."""
    blank = candidate.size == 0
    return {
        name: float("nan") if blank else compute(candidate, reference)
        for name, compute in METRICS.items()
    }
