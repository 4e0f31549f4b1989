# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place that speaks with Blender."""

import atexit
import ctypes
import os
import sys
from contextlib import nullcontext
from typing import Any

from .quiet import interrupt_later, quiet_stdout, silence_exit

with interrupt_later(), nullcontext() if "bpy" in sys.modules else quiet_stdout():
    import bpy  # as a Python package it greets


def _leave() -> None:
    """Leave by `_exit`, with the same status: before that, Blender 4.5 may wait for ever.

    Among its static objects is a condition variable on which a thread of its own still waits where
    something kept the module alive to the end, and glibc waits for that thread.
    """
    silence_exit()
    libc: Any = ctypes.CDLL(None) if os.name == "posix" else None
    if hasattr(libc, "on_exit"):  # glibc alone: handlers (status, argument), the last one first
        libc.on_exit(libc._exit, None)


if bpy.app.module:
    atexit.register(_leave)
