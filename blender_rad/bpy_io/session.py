# SPDX-License-Identifier: GPL-3.0-or-later
"""A private render engine: the only way to see what a render sees.

Subdivision, visibility and particles have render settings of their own; only the depsgraph that
Blender hands to a render engine holds them.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, TypeVar

import bpy

from .quiet import quiet_stdout

T = TypeVar("T")

_ENGINE = "RADIOMETRIC_READER"
_SETTINGS = {"engine": _ENGINE, "use_freestyle": False, "use_persistent_data": False}


def in_render(bl_scene: Any, layer: str, work: Callable[[Any], T]) -> T:
    """Return ``work(depsgraph)``, called with the render depsgraph of a view layer.

    Every setting touched is put back; what `work` raises is raised here.
    """
    results: list[T] = []
    errors: list[BaseException] = []

    class Reader(bpy.types.RenderEngine):
        bl_idname = _ENGINE
        bl_label = "Radiometric reader"
        bl_use_postprocess = False  # no compositor, no sequencer, no camera needed

        def render(self, depsgraph: Any) -> None:
            if results or errors:
                return  # the second eye
            try:
                results.append(work(depsgraph))
            except BaseException as error:  # Blender would swallow it
                errors.append(error)

    with ExitStack() as undo:
        bpy.utils.register_class(Reader)
        undo.callback(bpy.utils.unregister_class, Reader)
        undo.callback(setattr, bl_scene, "camera", bl_scene.camera)  # rendering may choose one
        for name, value in _SETTINGS.items():
            undo.callback(setattr, bl_scene.render, name, getattr(bl_scene.render, name))
            setattr(bl_scene.render, name, value)
        with quiet_stdout():
            bpy.ops.render.render(scene=bl_scene.name, layer=layer)
    if errors:
        raise errors[0]
    return results[0]
