# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C while Blender works: its own Python would swallow it, or be left half done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def interrupt_later() -> Generator[None]:
    """Keep Ctrl-C until the work is done; `KeyboardInterrupt` then, where it was pressed.

    Not on other threads than the main one, nor where Ctrl-C is not Python's: in a real Blender.
    """
    ours = signal.getsignal(signal.SIGINT) is not None
    if not ours or threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt
