# SPDX-License-Identifier: GPL-3.0-or-later
"""The open scene as arrays: read once, then kept up to date by what has changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

from . import skies

if TYPE_CHECKING:
    from ..blender_rad.scene import Scene

MOST = 4  # scenes that are kept
Key = tuple[int, str, str, str, float]
_kept: dict[Key, tuple[Scene, set[str] | None]] = {}  # with the objects that have changed since


def scene_of(depsgraph: Any, shading: Any = 'full') -> Scene:
    """Return the scene of a viewport's depsgraph; the same object as before if nothing changed."""
    from ..blender_rad.bpy_io.changes import follow
    from ..blender_rad.bpy_io.read import read_depsgraph, unit_scale

    bl_scene = depsgraph.scene
    model = bl_scene.radiometric.model
    layer = depsgraph.view_layer.name
    key = (bl_scene.session_uid, layer, shading, model, unit_scale(bl_scene))
    before, names = _kept.pop(key, (None, None))
    scene = None if names is None else before
    if scene and names:
        scene = follow(scene, depsgraph, names)
    if scene is None:
        maps = skies.of_view(depsgraph) or (before.world.maps if before else ())
        scene = read_depsgraph(depsgraph, shading=shading, model=model, maps=maps, live=True)
    _kept[key] = (scene, set())
    while len(_kept) > MOST:
        del _kept[next(iter(_kept))]
    return scene


@bpy.app.handlers.persistent
def _changed(bl_scene: Any, depsgraph: Any) -> None:
    """Note what has changed of the scenes that are kept."""
    if any(isinstance(u.id, bpy.types.Image) for u in depsgraph.updates):
        skies.forget()
        _forget()
    if any(isinstance(u.id, bpy.types.World) for u in depsgraph.updates):
        _forget()
    mine = [key for key in _kept if key[0] == bl_scene.session_uid]
    if not mine:
        return
    from ..blender_rad.bpy_io.changes import changed

    names = changed(depsgraph)
    for key in mine:
        scene, before = _kept[key]
        _kept[key] = scene, None if names is None or before is None else before | names


@bpy.app.handlers.persistent
def _forget(*_: Any) -> None:
    _kept.clear()


def disabled() -> None:
    _kept.clear()


HANDLERS = (
    ("depsgraph_update_post", _changed),
    *((moment, _forget) for moment in ("load_post", "frame_change_post", "undo_post", "redo_post")),
)
