# SPDX-License-Identifier: GPL-3.0-or-later
"""A private render engine: the only way to see what a render sees.

Subdivision, visibility and particles have render settings of their own; only the depsgraph that
Blender hands to a render engine holds them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
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

    bpy.utils.register_class(Reader)
    try:
        with _settings(bl_scene), quiet_stdout():
            bpy.ops.render.render(scene=bl_scene.name, layer=layer)
    finally:
        bpy.utils.unregister_class(Reader)
    if errors:
        raise errors[0]
    return results[0]


@contextmanager
def _settings(bl_scene: Any) -> Generator[None]:
    """Set what the private render needs, and put it back; rendering may choose a camera."""
    render, camera = bl_scene.render, bl_scene.camera
    before = {name: getattr(render, name) for name in _SETTINGS}
    try:
        for name, value in _SETTINGS.items():
            setattr(render, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(render, name, value)
        bl_scene.camera = camera
