# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render: our film into Blender's render result, as it gets better."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from . import skies

if TYPE_CHECKING:
    from ..blender_rad.film import Film
    from ..blender_rad.scene import Scene

PASSES = {
    "Irradiance": "RGB",
    "Illuminance": "V",
    "Luminance": "V",
    "StandardError": "RGB",
    "Depth": "V",
    "Normal": "XYZ",
}
BETWEEN_PICTURES_S = 0.5
CAUSES_SHOWN = 5


def passes(bl_scene: Any) -> Iterator[tuple[str, str]]:
    """Yield name and channels of the passes that a render of the scene is going to have."""
    yield from PASSES.items()
    if not bl_scene.radiometric.pass_lights:
        return
    from ..blender_rad.bpy_io.materials import surface_of

    for bl_object in bl_scene.objects:
        blocks = [slot.material for slot in bl_object.material_slots]
        if bl_object.type == 'LIGHT' or any(surface_of(b).full.emits for b in blocks if b):
            yield from _light_passes([bl_object.name])
    if bl_scene.world:
        yield from _light_passes(["World"])


def _light_passes(names: list[str]) -> Iterator[tuple[str, str]]:
    from ..blender_rad.exr import channel_names

    return ((f"Light.{name}", "RGB") for name in channel_names(names).values())


def render(engine: Any, depsgraph: Any) -> None:
    """Render the view layer of a render depsgraph into the engine's result."""
    from ..blender_rad import rendering
    from ..blender_rad.bpy_io.read import read_depsgraph
    from ..blender_rad.direct import DirectLight
    from ..blender_rad.errors import RadError

    own, cancel = depsgraph.scene.radiometric, threading.Event()
    settings = rendering.Settings(
        samples=own.samples or None, error=own.error, per_light=own.pass_lights
    )

    def progress(share: float) -> None:
        engine.update_progress(share)
        if engine.test_break():
            cancel.set()

    try:
        engine.update_stats("", "Measuring the sky")
        maps = skies.of_render(depsgraph, engine.test_break)
        engine.update_stats("", "Reading the scene")
        scene = read_depsgraph(depsgraph, shading=own.shading, model=own.model, maps=maps)
        light = DirectLight(scene)
        extra = _light_passes(light.names) if own.pass_lights else ()
        for name, channels in (*PASSES.items(), *extra):
            engine.add_pass(name, len(channels), channels, layer=depsgraph.view_layer.name)
        picture = _Picture(engine, depsgraph.view_layer.name, scene, own.efficacy)
        try:
            film = rendering.render(
                scene,
                settings,
                light=light,
                progress=progress,
                cancel=cancel,
                arrived=picture.arrived,
            )
            picture.show(film)
            _report(engine, film)
        finally:
            engine.end_result(picture.result)
    except rendering.CancelledError:
        return
    except (RadError, ModuleNotFoundError) as error:  # the preferences say what is missing
        engine.error_set(str(error))


class _Picture:
    """The render result, which takes what is inside the border, its lowest row first."""

    def __init__(self, engine: Any, layer: str, scene: Scene, efficacy_lm_W: float) -> None:
        self.engine, self.scene, self.efficacy_lm_W = engine, scene, efficacy_lm_W
        width, height = scene.resolution
        x0, y0, x1, y1 = scene.border or (0, 0, width, height)
        self.inside = slice(y0, y1), slice(x0, x1)
        self.result = engine.begin_result(0, 0, x1 - x0, y1 - y0, layer=layer)
        self.due = 0.0

    def arrived(self, develop: Callable[[], Film]) -> None:
        """Show the picture so far, but not all the time."""
        if time.monotonic() > self.due:
            film = develop()
            self.show(film)
            error = 100 * film.relative_standard_error
            self.engine.update_stats("", f"{film.samples.mean():.0f} samples, error {error:.2g} %")
            self.due = time.monotonic() + BETWEEN_PICTURES_S

    def show(self, film: Film) -> None:
        import numpy as np

        from ..blender_rad.exr import film_channels

        lights = [f"Light.{name}" for name in film.lights]
        planes = film_channels(film, self.scene, self.efficacy_lm_W, (*PASSES, *lights))
        images: dict[str, list[Any]] = {}
        for name, plane in planes.items():
            images.setdefault(name.rpartition(".")[0] or "Combined", []).append(plane)
        for layer_pass in self.result.layers[0].passes:
            if layer_pass.name in images:
                image = np.stack(images[layer_pass.name], axis=-1)[::-1][self.inside]
                layer_pass.rect.foreach_set(image.astype(np.float32).ravel())
        self.engine.update_result(self.result)


def _report(engine: Any, film: Film) -> None:
    """Say what is not as it should be in the picture: never silently black."""
    inside = int(film.inside.sum())
    causes = sorted(film.excluded_by.items(), key=lambda item: -item[1])
    for cause, pixels in causes[:CAUSES_SHOWN]:
        said = f"{cause.name}: {cause.feature} is not supported"
        engine.report({'WARNING'}, f"{said}; {100 * pixels / inside:.1f} % of the picture lack it")
    for finding in film.findings:
        if finding.severity != "info":
            engine.report({'WARNING'}, str(finding))
