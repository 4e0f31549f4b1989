# SPDX-License-Identifier: GPL-3.0-or-later
"""Work beside Blender: on one thread that asks nothing of it, taken up by a timer."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import bpy

POLL_S = 0.1
Taken = Callable[[Future[Any]], None]
_pool: list[ThreadPoolExecutor] = []
_under_way: list[tuple[Future[Any], Taken]] = []


def begin(taken: Taken, work: Callable[..., Any], *arguments: Any) -> None:
    """Have `work` done; `taken` gets its future in Blender's own time, in background at once."""
    if not _pool:
        _pool.append(ThreadPoolExecutor(1))
    _under_way.append((_pool[0].submit(work, *arguments), taken))
    if bpy.app.background:
        finish()
    elif not bpy.app.timers.is_registered(_poll):
        bpy.app.timers.register(_poll, first_interval=POLL_S, persistent=True)


def _poll() -> float | None:
    """Take what is done; as a timer, until nothing is under way."""
    for pair in [pair for pair in _under_way if pair[0].done()]:
        _under_way.remove(pair)
        pair[1](pair[0])
    return POLL_S if _under_way else None


def finish() -> None:
    """Wait for all that is under way."""
    while _under_way:
        future, taken = _under_way.pop(0)
        future.exception()
        taken(future)


def redraw(*kinds: str) -> None:
    """Have all areas of these kinds drawn again."""
    context: Any = bpy.context
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in kinds:
                area.tag_redraw()


def disabled() -> None:
    _under_way.clear()
    while _pool:
        _pool.pop().shutdown(cancel_futures=True)


TIMERS = (_poll,)
