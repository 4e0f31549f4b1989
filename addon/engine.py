# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine, and the panels of Blender and Cycles that it opens for itself."""

import atexit
import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import bpy

from . import drawing, final, skies
from .viewport import Viewport, region_camera

ENGINE = 'RADIOMETRIC'
OWN_SETTINGS = {"render", "view_layer"}  # contexts of Cycles' panels that mean nothing to us


class RadiometricEngine(bpy.types.RenderEngine):
    """Direct light in physical units, with its standard error."""

    bl_idname = ENGINE
    bl_label = "Radiometric"
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._viewport: Viewport | None = None

    def __del__(self) -> None:
        if viewport := getattr(self, "_viewport", None):
            viewport.stop()

    def update_render_passes(  # pyright: ignore[reportIncompatibleMethodOverride] - of stubs
        self, scene: Any = None, renderlayer: Any = None
    ) -> None:
        register: Any = self.register_pass
        register(scene, renderlayer, "Combined", 4, "RGBA", 'COLOR')
        kinds = {"RGB": 'COLOR', "V": 'VALUE', "XYZ": 'VECTOR'}
        for name, channels in final.passes(scene):
            register(scene, renderlayer, name, len(channels), channels, kinds[channels])

    def render(self, depsgraph: Any) -> None:
        final.render(self, depsgraph)

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """Follow what light depends on."""
        if self._viewport is None:
            self._viewport = Viewport(_redraw(self))
        self._viewport.read(depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        viewport, region, bl_scene = self._viewport, context.region, depsgraph.scene
        if viewport is None:
            return
        drawing.VIEWPORTS[region.as_pointer()] = viewport
        each = int(self.get_preview_pixel_size(bl_scene))
        view = context.region_data
        through = view.view_perspective == 'CAMERA' and bl_scene.camera
        viewport.look(
            region_camera(view.view_matrix, view.window_matrix, through or None),
            (-(-region.width // each), -(-region.height // each)),
            bl_scene.radiometric.error,
        )
        if bl_scene.radiometric.view == 'radiance':
            drawing.draw_radiance(self, viewport, bl_scene, (region.width, region.height))
        if viewport.film:
            said = "" if viewport.refining else ", done"
            said += ", the sky is being measured" if skies.measuring() else ""
            self.update_stats("Radiometric", f"error {100 * viewport.error:.2g} %{said}")


def _redraw(engine: Any) -> Callable[[], None]:
    """Return what asks for a redraw of an engine, as long as Blender has it."""
    alive = weakref.ref(engine)

    def redraw() -> None:
        with suppress(ReferenceError):  # Blender has removed it
            if found := alive():
                found.tag_redraw()

    return redraw


def _panels() -> Iterator[Any]:
    """Yield the panels that describe a scene, not how Cycles is to render it."""
    for panel in bpy.types.Panel.__subclasses__():
        if 'CYCLES' in getattr(panel, "COMPAT_ENGINES", ()):
            cycles_own = panel.__module__.startswith("cycles")
            if not (cycles_own and getattr(panel, "bl_context", "render") in OWN_SETTINGS):
                yield panel


def enabled() -> None:
    if bpy.app.module:
        atexit.register(bpy.utils.unregister_class, RadiometricEngine)  # 4.5 would wait for ever
    for panel in _panels():
        panel.COMPAT_ENGINES = {*panel.COMPAT_ENGINES, ENGINE}


def disabled() -> None:
    atexit.unregister(bpy.utils.unregister_class)
    panels: list[Any] = bpy.types.Panel.__subclasses__()
    for panel in panels:
        if ENGINE in getattr(panel, "COMPAT_ENGINES", ()):
            panel.COMPAT_ENGINES = panel.COMPAT_ENGINES - {ENGINE}
