# SPDX-License-Identifier: GPL-3.0-or-later
"""What people are shown of a comparison: one page that stands by itself."""

from .data import ReportData
from .page import render_report

__all__ = ["ReportData", "render_report"]
