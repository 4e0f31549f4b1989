# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine, and the panels of Blender and Cycles that it opens for itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from . import final

ENGINE = 'RADIOMETRIC'
OWN_SETTINGS = {"render", "view_layer"}  # contexts of Cycles' panels that mean nothing to us


class RadiometricEngine(bpy.types.RenderEngine):
    """Direct light in physical units, with its standard error."""

    bl_idname = ENGINE
    bl_label = "Radiometric"
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", 'COLOR')
        kinds = {"RGB": 'COLOR', "V": 'VALUE', "XYZ": 'VECTOR'}
        for name, channels in final.passes(scene):
            self.register_pass(
                scene, renderlayer, name, len(channels), channels, kinds[channels]
            )

    def render(self, depsgraph: Any) -> None:
        final.render(self, depsgraph)


def _panels() -> Iterator[Any]:
    """Yield the panels that describe a scene, not how Cycles is to render it."""
    for panel in bpy.types.Panel.__subclasses__():
        if 'CYCLES' in getattr(panel, "COMPAT_ENGINES", ()):
            cycles_own = panel.__module__.startswith("cycles")
            if not (cycles_own and getattr(panel, "bl_context", "render") in OWN_SETTINGS):
                yield panel


def register() -> None:
    bpy.utils.register_class(RadiometricEngine)
    for panel in _panels():
        panel.COMPAT_ENGINES = {*panel.COMPAT_ENGINES, ENGINE}


def unregister() -> None:
    for panel in bpy.types.Panel.__subclasses__():
        if ENGINE in getattr(panel, "COMPAT_ENGINES", ()):
            panel.COMPAT_ENGINES = panel.COMPAT_ENGINES - {ENGINE}
    bpy.utils.unregister_class(RadiometricEngine)
