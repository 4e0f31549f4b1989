# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place that speaks with Blender."""

from __future__ import annotations

import atexit

from .interrupt import interrupt_later
from .quiet import quiet_stdout, silence_exit

with interrupt_later(), quiet_stdout():  # as a Python package it greets
    import bpy


def _leave() -> None:
    """Leave nothing in Blender: 4.5 hangs at exit on a driver that it kept from running."""
    silence_exit()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


if bpy.app.module:
    atexit.register(_leave)
