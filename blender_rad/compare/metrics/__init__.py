# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that sum up how two pictures differ: a file a metric."""

from ._base import METRICS, Metric, compute_all

__all__ = ["METRICS", "Metric", "compute_all"]
