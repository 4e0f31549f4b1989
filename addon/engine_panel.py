# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's own settings."""

from typing import Any

import bpy

from .engine import ENGINE
from .shared import InProperties


class _Panel(InProperties):
    bl_context = 'render'
    properties: tuple[str, ...] = ()

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE

    def draw(self: Any, context: Any) -> None:
        self.layout.use_property_split = True
        for name in self.properties:
            self.layout.prop(context.scene.radiometric, name)


class RADIOMETRIC_RENDER_PT_sampling(_Panel, bpy.types.Panel):
    bl_label = "Sampling"
    properties = ("error", "samples", "pass_lights")


class RADIOMETRIC_RENDER_PT_view(_Panel, bpy.types.Panel):
    bl_label = "Viewport False Colour"
    bl_options = {'DEFAULT_CLOSED'}
    properties = ("view", "scale", "low", "high")
