# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a Blender of its own: come, go, render, check against Cycles, write what came of it.

Usage: _in_blender.py ZIP SCENE.blend FOLDER, with BLENDER_USER_RESOURCES an empty folder.
"""

import importlib
import json
import sys
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace

import bpy

MODULE = "bl_ext.user_default.radiometric"
LIBRARY = f"{MODULE}.blender_rad"
REGISTRIES = {"lights": "LIGHTS", "commands": "COMMANDS", "compare.metrics": "METRICS"}


def traces() -> set[str]:
    """Return names of all that an add-on can leave in a running Blender."""
    types = bpy.types
    classes = {f"class {name}" for name in dir(types)}
    subclasses = {
        f"subclass {cls.__module__}.{cls.__name__}"
        for base in (types.AddonPreferences, types.Panel, types.Operator, types.RenderEngine)
        for cls in base.__subclasses__()
        if getattr(cls, "is_registered", False)
    }
    properties = {
        f"property {owner}.{name}"
        for owner in ("Light", "Object", "Scene", "World", "Material", "WindowManager", "ID")
        for name in getattr(types, owner).bl_rna.properties.keys()
    }
    handlers = {
        f"handler {name} {getattr(entry, '__module__', '')}.{getattr(entry, '__name__', entry)}"
        for name in dir(bpy.app.handlers)
        if isinstance(entries := getattr(bpy.app.handlers, name), list)
        for entry in entries
    }
    modules = {f"module {name}" for name in sys.modules if name.startswith(f"{MODULE}.")}
    return classes | subclasses | properties | handlers | modules


def come_and_go() -> dict[str, object]:
    import addon_utils  # to be found only once bpy is there

    story = {"enabled": [], "seconds": [], "left_behind": [], "loaded_by_enabling": []}
    for _ in range(2):
        before, modules = traces(), set(sys.modules)
        start = time.perf_counter()
        addon_utils.enable(MODULE, default_set=True)
        story["seconds"].append(time.perf_counter() - start)
        story["enabled"].append(addon_utils.check(MODULE)[1])
        story["loaded_by_enabling"] += sorted(set(sys.modules) - modules)
        story["registered"] = sorted(traces() - before)
        story["library_version"] = importlib.import_module(LIBRARY).__version__
        story["registries"] = {
            package: sorted(getattr(importlib.import_module(f"{LIBRARY}.{package}"), name))
            for package, name in REGISTRIES.items()
        }
        addon_utils.disable(MODULE, default_set=True)
        story["left_behind"].append(sorted(traces() - before))
    manifest = Path(sys.modules[MODULE].__file__).with_name("blender_manifest.toml")
    story["manifest_version"] = tomllib.loads(manifest.read_text())["version"]
    return story


def engines() -> dict[str, list[str]]:
    panels = bpy.types.Panel.__subclasses__()
    return {p.__name__: sorted(getattr(p, "COMPAT_ENGINES", ())) for p in panels}


def render(name: str, folder: Path, **settings: object) -> None:
    """Render into FOLDER/name.exr with these settings of the render."""
    for key, value in settings.items():
        setattr(bpy.context.scene.render, key, value)
    bpy.context.scene.render.filepath = str(folder / f"{name}.exr")
    bpy.ops.render.render(write_still=True)


def cancelled_render() -> list[str]:
    """Render with an engine that is asked to stop as it begins; return what it was told."""
    final = sys.modules[f"{MODULE}.addon.final"]
    told, empty = [], SimpleNamespace(layers=[SimpleNamespace(passes=[])])

    class Engine:
        def __getattr__(self, name: str) -> object:
            told.append(name)
            return lambda *_, **__: empty if name == "begin_result" else name == "test_break"

    session = sys.modules[f"{MODULE}.blender_rad.bpy_io.session"]
    layer = bpy.context.view_layer.name
    session.in_render(bpy.context.scene, layer, lambda graph: final.render(Engine(), graph))
    return told


def cancelled_check() -> str:
    check = sys.modules[f"{MODULE}.addon.checking"].Check(bpy.context.scene)
    check.cancel()
    return check.error


def main(zip_path: str, scene: str, out: str) -> None:
    import addon_utils  # to be found only once bpy is there

    folder = Path(out)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.extensions.package_install_files(
        filepath=zip_path, repo="user_default", enable_on_install=False
    )
    story, panels, before = come_and_go(), engines(), traces()
    addon_utils.enable(MODULE, default_set=True)
    opened = {name for name, kinds in engines().items() if 'RADIOMETRIC' in kinds}
    bpy.ops.wm.open_mainfile(filepath=scene)
    bl_scene = bpy.context.scene
    bl_scene.render.engine, own = 'RADIOMETRIC', bl_scene.radiometric
    own.samples, own.pass_lights, own.shading = 4, True, 'clay'
    form = bl_scene.render.image_settings
    if hasattr(form, "media_type"):
        form.media_type = 'MULTI_LAYER_IMAGE'
    form.file_format, form.color_depth = 'OPEN_EXR_MULTILAYER', '32'
    render("whole", folder)
    border = {"border_min_x": 0.25, "border_max_x": 0.75, "border_min_y": 0.5, "border_max_y": 1.0}
    render("border", folder, use_border=True, **border)
    render("cropped", folder, use_crop_to_border=True)
    bl_scene.render.use_border = False
    group = bpy.data.lights[0].radiometry
    group.unit = "lm"
    for frame, value in ((1, 100.0), (2, 300.0)):
        group.value = value
        group.keyframe_insert("value", frame=frame)
    bl_scene.frame_start, bl_scene.frame_end = 1, 2
    bl_scene.render.filepath = str(folder / "frame#.exr")
    bpy.ops.render.render(animation=True)
    bl_scene.frame_set(1)
    false_colour = bpy.ops.radiometric.false_colour(quantity='illuminance')
    own.tolerance = 0.2
    checked = bpy.ops.radiometric.check()
    shown = bpy.ops.radiometric.difference()
    check = sys.modules[f"{MODULE}.addon.check_panel"]._last()
    story |= {
        "opened": sorted(opened),
        "results": [sorted(result) for result in (false_colour, checked, shown)],
        "images": {i.name: i.size[:] for i in bpy.data.images if i.packed_file},
        "verdict": check.document["verdict"],
        "format": form.file_format,
        "cancelled_render": cancelled_render(),
        "cancelled_check": cancelled_check(),
    }
    addon_utils.disable(MODULE, default_set=True)
    story["left_behind"].append(sorted(traces() - before))
    story["outside_package_loaded"] = "blender_rad" in sys.modules
    story["closed"] = {name: engines().get(name) for name in panels} == panels
    (folder / "story.json").write_text(json.dumps(story))


main(*sys.argv[1:])
