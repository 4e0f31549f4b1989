# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place that speaks with Blender."""

from __future__ import annotations

import atexit
import sys

from .quiet import quiet_stdout, silence_exit

if "bpy" not in sys.modules:  # as a Python package, which greets and says what it did not free
    with quiet_stdout():
        import bpy  # noqa: F401  # pyright: ignore[reportUnusedImport]
    atexit.register(silence_exit)
