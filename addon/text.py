# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts that fit a panel of any width."""

from __future__ import annotations

import textwrap
from typing import Any

LETTER = 6.5  # px of a letter at a UI scale of 1, on average
AROUND, LEAST = 9, 20  # letters that icon and margins take, and of the narrowest line


def say(layout: Any, context: Any, text: str, icon: str) -> None:
    """Draw a text in as many lines as it needs."""
    scale = context.preferences.system.ui_scale
    width = max(int(context.region.width / (LETTER * scale)) - AROUND, LEAST)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon='BLANK1' if number else icon)
