# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies that Cycles alone can compute: measured by another Blender, since a render starts none."""

from __future__ import annotations

import logging
import pickle
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ..blender_rad.errors import RadError
from . import another, beside

if TYPE_CHECKING:
    import subprocess

    from ..blender_rad.lights import SkyMap

MOST = 4  # skies that are kept
POLL_S = 0.05
_CODE = "from blender_rad.bpy_io.sky import measure_file\nmeasure_file(*{arguments!r})"
_known: dict[bytes, tuple[SkyMap, ...]] = {}  # by what the nodes are; empty while under way
_processes: list[subprocess.Popen[bytes]] = []

log = logging.getLogger(__name__)


def of_render(depsgraph: Any, cancelled: Callable[[], bool]) -> tuple[SkyMap, ...]:
    """Return the maps of the world that a depsgraph renders, none where none have to be measured.

    `RadError` where the sky cannot be, `CancelledError` as soon as `cancelled` tells so.
    """
    world, key = _wanted(depsgraph)
    if world and not _known.get(key):
        _keep(key, _begin(world, depsgraph.scene)(cancelled))
    return _known.get(key, ())


def of_view(depsgraph: Any) -> tuple[SkyMap, ...]:
    """Return the maps that are known by now; the others are measured beside Blender, one a time."""
    world, key = _wanted(depsgraph)
    if world and key not in _known and not measuring():
        name = world.name
        _keep(key, ())

        def taken(found: Future[tuple[SkyMap, ...]]) -> None:
            try:
                _keep(key, found.result())
            except RadError as error:
                log.warning("%s", error)
            if now := bpy.data.worlds.get(name):
                now.update_tag()  # whoever shows it is to read it again
            beside.redraw('VIEW_3D')

        beside.begin(taken, _begin(world, depsgraph.scene))
    return _known.get(key, ())


def measuring() -> bool:
    """Return whether a sky is being measured."""
    return bool(_processes)


def _wanted(depsgraph: Any) -> tuple[Any, bytes]:
    """Return the world that has to be measured and what its nodes are; None where none has."""
    from ..blender_rad.bpy_io.sky import contents
    from ..blender_rad.bpy_io.world import unknown_world

    bl_scene = depsgraph.scene
    world = unknown_world(bl_scene, depsgraph.view_layer)
    return world, pickle.dumps(world and contents(world, bl_scene.frame_current_final))


def _keep(key: bytes, maps: tuple[SkyMap, ...]) -> None:
    _known.pop(key, None)
    _known[key] = maps
    while len(_known) > MOST:
        del _known[next(iter(_known))]


def _begin(bl_world: Any, bl_scene: Any) -> Callable[..., tuple[SkyMap, ...]]:
    """Start to measure a world; return what waits for its maps, on any thread."""
    from ..blender_rad.bpy_io.read import working_space

    world = bl_world.original
    scratch = tempfile.TemporaryDirectory()
    folder = Path(scratch.name)
    file = str(folder / "world.blend")
    if world.library:
        file = bpy.path.abspath(world.library.filepath)
    else:
        bpy.data.libraries.write(file, {world}, path_remap='ABSOLUTE')
    frame, out = (bl_scene.frame_current, bl_scene.frame_subframe), str(folder / "maps.pickle")
    arguments = (file, world.name, frame, working_space(), out)
    process = another.start(_CODE.format(arguments=arguments), folder / "log.txt")
    _processes.append(process)

    def wait(cancelled: Callable[[], bool] = lambda: False) -> tuple[SkyMap, ...]:
        from ..blender_rad.lights import SkyMap
        from ..blender_rad.rendering import CancelledError

        with scratch:
            try:
                while process.poll() is None:
                    if cancelled():
                        raise CancelledError
                    time.sleep(POLL_S)
            finally:
                process.kill()
                process.wait()
                _processes.remove(process)
            if not Path(out).exists():
                said = (folder / "log.txt").read_text(encoding="utf-8", errors="replace")
                last = (said.splitlines() or ["it said nothing"])[-1]
                raise RadError("its sky could not be measured", f"world {world.name}", last)
            return tuple(SkyMap(*parts) for parts in pickle.loads(Path(out).read_bytes()))

    return wait


def forget() -> None:
    """Let go of all skies: their images may have changed."""
    _known.clear()


def disabled() -> None:
    for process in _processes:
        process.kill()
    forget()
