# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender at work: its chatter kept off our standard output, and Ctrl-C off it."""

import logging
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Generator
from contextlib import contextmanager

log = logging.getLogger(__name__)

_STDOUT = 1
_STDERR = 2


@contextmanager
def quiet_stdout(*, errors: bool = False) -> Generator[None]:
    """Send what Blender writes to file descriptor 1 to the debug log while it works.

    Blender writes ``Read blend``, ``Fra:1 ...`` and the like past Python's `sys.stdout`, so that
    the descriptor itself has to be turned away. With `errors` descriptor 2 is as well: Blender's
    importers say there what their exception says again.
    """
    descriptors = (_STDOUT, _STDERR) if errors else (_STDOUT,)
    _flush()
    kept = [os.dup(descriptor) for descriptor in descriptors]
    with tempfile.TemporaryFile() as said:
        for descriptor in descriptors:
            os.dup2(said.fileno(), descriptor)
        try:
            yield
        finally:
            _flush()
            for descriptor, copy in zip(descriptors, kept, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
            said.seek(0)
            for line in said.read().decode(errors="replace").splitlines():
                log.debug("blender: %s", line)


def told(error: RuntimeError) -> str:
    """Return what an operator says in its exception, as one line."""
    return " ".join(str(error).split()).removeprefix("Error: ")


def silence_exit() -> None:
    """Drop what is written to descriptor 1 from now on: Blender's last words at exit."""
    _flush()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, _STDOUT)
    os.close(nowhere)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()


@contextmanager
def interrupt_later() -> Generator[None]:
    """Keep Ctrl-C until the work is done; `KeyboardInterrupt` then, where it was pressed.

    Blender's own Python would swallow it, or be left half done. Not on other threads than the main
    one, nor where Ctrl-C is not Python's: in a real Blender.
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
