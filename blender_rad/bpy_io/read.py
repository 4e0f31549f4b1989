# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender scene, as it renders, read into plain arrays."""

import hashlib
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..emitters import reaches
from ..errors import Finding
from ..lights import Model, SkyMap
from ..scene import Scene
from ..working_space import WORKING_SPACES, luminance_weights
from .cameras import read_camera
from .instances import Reader
from .materials import Shading, without_velvet
from .measuring import measure
from .open import SOURCE_KEY, file_findings, working_space
from .questions import Asking
from .session import in_render
from .world import read_maps, read_world, shown_world


def read_scene(
    bl_scene: Any,
    *,
    maps: tuple[SkyMap, ...] | None = None,
    ask: bool = False,
    **options: Any,
) -> Scene:
    """Return the scene as it renders at its current frame, in its first view layer in use.

    `bl_scene` is a bpy.types.Scene; nothing in it is changed. `options` are `read_depsgraph`'s,
    `maps` those of an earlier reading. With `ask` Blender gives what nodes that are not known here
    compute in view: for pictures of this camera, in focus.
    """
    layer = next((layer for layer in bl_scene.view_layers if layer.use), bl_scene.view_layers[0])
    maps = read_maps(bl_scene, layer) if maps is None else maps
    camera = bl_scene.camera
    questions: list[Asking] | None = [] if ask and camera and not camera.data.dof.use_dof else None
    read = partial(read_depsgraph, maps=maps, questions=questions, **options)
    scene = in_render(bl_scene, layer.name, read)
    if questions is None:
        return scene
    return replace(scene, measured=measure(bl_scene, questions, scene.resolution))


def read_depsgraph(
    depsgraph: Any,
    *,
    shading: Shading = "full",
    model: Model = "cycles",
    resolution: tuple[int, int] | None = None,  # (width, height) in place of the scene's own
    maps: tuple[SkyMap, ...] = (),  # of its world, measured before: renders cannot start others
    questions: list[Asking] | None = None,  # gathers what Blender is to be asked after it
    live: bool = False,  # of a viewport, which needs nothing of the files on the disk
) -> Scene:
    """Return the scene of a render depsgraph, such as a render engine is given."""
    bl_scene, render = depsgraph.scene, depsgraph.scene.render
    reader = Reader(depsgraph, shading, model, unit_scale(bl_scene), questions)
    reader.read()
    size = resolution or frame_size(render)
    camera = bl_scene.camera and read_camera(bl_scene.camera, render, size)
    world = read_world(shown_world(bl_scene, depsgraph.view_layer), maps)
    glowing = [i for i in reader.instances if any(reader.materials[m].emits for m in i.materials)]
    found = [light.reaches for light in reader.lights if light.is_found]
    found += map(reaches, [*glowing, *[world] * bool(any(world.radiance) or world.maps)])
    if any(("diffuse" in rays) != ("glossy" in rays) for rays in found):
        reader.materials[:] = map(without_velvet, reader.materials)
    file = bpy.data.filepath or bl_scene.original.get(SOURCE_KEY, "")
    space = working_space()
    findings = [] if live else file_findings()
    if render.use_motion_blur:
        still = "motion blur is on; the scene is read at rest"
        findings.append(Finding("motion-blur", "info", "", still))
    return Scene(
        file=file,
        sha256="" if live or not file else _sha256(file),
        frame=bl_scene.frame_current,
        meshes=tuple(reader.meshes),
        instances=tuple(reader.instances),
        materials=tuple(reader.materials),
        lights=tuple(reader.lights),
        world=world,
        camera=camera,
        resolution=size,
        border=_border(render, size),
        film_transparent=render.film_transparent,
        unit_scale_m=reader.unit_scale_m,
        model=model,
        shading=shading,
        working_space=space,
        chromaticities=WORKING_SPACES[space],
        luminance_weights=luminance_weights(WORKING_SPACES[space]),
        blender_version=bpy.app.version,
        transparent_max_bounces=bl_scene.cycles.transparent_max_bounces,
        unknown_lights=tuple(reader.unknown_lights),
        light_records=tuple(reader.records),
        linking=reader.linking,
        unsupported=(
            *reader.unsupported,
            *dict.fromkeys(u for m in reader.materials for u in m.unsupported),
            *world.unsupported,
            *(camera.unsupported if camera else ()),
        ),
        findings=(*findings, *reader.findings),
    )


def unit_scale(bl_scene: Any) -> float:
    """Return metres a Blender unit; without a unit system Blender ignores the scale: 1."""
    units = bl_scene.unit_settings
    return 1.0 if units.system == "NONE" else float(units.scale_length)


def frame_size(render: Any) -> tuple[int, int]:
    """Return the full frame's (width, height) in pixels, cut to whole pixels as Blender does."""
    width, height = (
        max(1, side * render.resolution_percentage // 100)
        for side in (render.resolution_x, render.resolution_y)
    )
    return width, height


def _border(render: Any, size: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """Return the render border in pixels, cut in single precision as Blender does."""
    if not render.use_border:
        return None
    corners = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    x0, y0, x1, y1 = np.array(corners, np.float32) * np.array((*size, *size), np.float32)
    return (int(x0), int(y0), int(x1), int(y1))


def _sha256(file: str) -> str:
    with Path(bpy.path.abspath(file)).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
