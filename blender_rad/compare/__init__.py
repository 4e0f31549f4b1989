# SPDX-License-Identifier: GPL-3.0-or-later
"""The judge: does a witness's picture agree with ours, and if not, which light is off, and why."""

from .result import Comparison, LightInfo
from .verdict import judge, judge_pictures

__all__ = ["Comparison", "LightInfo", "judge", "judge_pictures"]
