# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening scene files without running what is in them, and what is wrong with them."""

import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ..errors import Finding, RadError, unknown_name
from ..quantities import GLTF_LM_W
from ..working_space import WORKING_SPACES
from .quiet import interrupt_later, quiet_stdout, told

GLTF = {".glb", ".gltf"}
SOURCE_KEY = "source_file"  # on imported scenes, which have no .blend


def open_scene(
    path: str | os.PathLike[str],
    *,
    frame: int | None = None,
    camera: str | None = None,
    scene: str | None = None,
    view_layer: str | None = None,
    need_camera: bool = False,
    load_ui: bool = False,
) -> Any:
    """Open a .blend, or import a .glb or .gltf into an empty file, and return its bpy.types.Scene.

    Scripts in the file do not run. The view layer chosen becomes the only one that renders.
    `load_ui` keeps the file's own windows, for a copy to be saved. `RadError` for a file that
    cannot be read, an unknown name, a missing camera.
    """
    file = Path(path)
    _load(file, load_ui)
    context: Any = bpy.context
    where = str(file)
    bl_scene = _choose("scene", scene, bpy.data.scenes, where) or context.scene
    if _choose("view layer", view_layer, bl_scene.view_layers, where):
        for layer in bl_scene.view_layers:
            layer.use = layer.name == view_layer
    if chosen := _choose("camera", camera, _cameras(bl_scene), where):
        bl_scene.camera = chosen
        for marker in bl_scene.timeline_markers:  # which would switch to another
            marker.camera = None
    if frame is not None:
        with quiet_stdout():
            bl_scene.frame_set(frame)
    if need_camera and bl_scene.camera is None:
        cameras = sorted(bl_object.name for bl_object in _cameras(bl_scene))
        known = f"name one of: {', '.join(cameras)}" if cameras else "add a camera to it"
        raise RadError("no active camera", f"scene {bl_scene.name!r} of {file}", known)
    return bl_scene


def _load(file: Path, load_ui: bool) -> None:
    """Load `file` into this Blender; Blender's own message becomes the error."""
    imported, path = file.suffix.lower() in GLTF, str(file.resolve())
    try:
        with interrupt_later(), quiet_stdout(errors=True):
            if imported:
                bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
                gltf: Any = bpy.ops.import_scene.gltf
                gltf(filepath=path, export_import_convert_lighting_mode='SPEC')
            else:
                bpy.ops.wm.open_mainfile(filepath=path, load_ui=load_ui, use_scripts=False)
    except RuntimeError as error:
        kind = "a glTF 2.0 file" if imported else "a .blend file that Blender can read"
        expected = f"expected {kind} ({told(error)})"
        raise RadError("cannot read the file", str(file), expected) from error
    if imported:
        context: Any = bpy.context
        context.scene[SOURCE_KEY] = str(file)
        context.scene.render.engine = 'CYCLES'
        cameras = _cameras(context.scene)
        context.scene.camera = cameras[0] if len(cameras) == 1 else None
        _default_intensities(file)


def _default_intensities(file: Path) -> None:
    """Give lights that state no intensity glTF's default, 1 cd or 1 lx.

    The importer leaves them Blender's own; those that do state one are, over 683 lm/W, of W/sr or
    W/m²: a light whose power is none of these states none.
    """
    content = file.read_bytes()
    if content[:4] == b"glTF":  # binary: the first chunk is the JSON, its length at byte 12
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    lights = json.loads(content).get("extensions", {}).get("KHR_lights_punctual", {})
    stated = [light.get("intensity") for light in lights.get("lights", [])]
    bl_lights: Any = bpy.data.lights if None in stated else ()
    for bl_light in bl_lights:
        one: float = 1.0 / GLTF_LM_W if bl_light.type == 'SUN' else 4.0 * math.pi / GLTF_LM_W
        given = (value * one for value in stated if value is not None)
        if not any(math.isclose(bl_light.energy, power, rel_tol=1e-6) for power in given):
            bl_light.energy = one


def _choose(kind: str, name: str | None, known: Any, where: str) -> Any | None:
    named = {item.name: item for item in known}
    if name is not None and name not in named:
        raise unknown_name(kind, name, where, list(named))
    return named.get(name)


def _cameras(bl_scene: Any) -> list[Any]:
    return [bl_object for bl_object in bl_scene.objects if bl_object.type == "CAMERA"]


def working_space() -> str:
    """Return the name of the open file's working space; Rec.709 before Blender 5."""
    colours = getattr(bpy.data, "colorspace", None)
    name = colours.working_space if colours else "Linear Rec.709"
    if name not in WORKING_SPACES:
        known = ", ".join(WORKING_SPACES)
        raise RadError(f"unknown working space {name!r}", bpy.data.filepath, f"expected {known}")
    return name


def file_findings() -> list[Finding]:
    """Return what the open file misses or keeps from running."""
    found = (*_blocked_drivers(), *_missing_files())
    return [Finding(code, "warning", name, message) for code, name, message in found]


def _blocked_drivers() -> Iterator[tuple[str, str, str]]:
    why = "cannot run without scripts or fails; its value may be 0"
    for block in bpy.data.user_map():
        for tree in filter(None, (block, getattr(block, "node_tree", None))):
            for curve in getattr(getattr(tree, "animation_data", None), "drivers", ()):
                if curve.driver.type == "SCRIPTED" and not curve.driver.is_valid:
                    yield "blocked-driver", block.name, f"the driver of {curve.data_path} {why}"


def _missing_files() -> Iterator[tuple[str, str, str]]:
    pink = "does not exist; surfaces with it look as in Cycles (pink)"
    for library in bpy.data.libraries:
        if not Path(bpy.path.abspath(library.filepath)).is_file():
            yield "missing-library", library.name, f"{library.filepath} does not exist"
    for image in bpy.data.images:
        on_disk = image.source == "FILE" and image.filepath and not image.packed_file
        path = bpy.path.abspath(image.filepath, library=image.library)
        if on_disk and image.users and not Path(path).is_file():
            yield "missing-image", image.name, f"{image.filepath} {pink}"
