# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a Blender of its own: install the ZIP, enable and disable it twice, write what happened.

Usage: _install_and_leave.py ZIP STORY.json, with BLENDER_USER_RESOURCES an empty folder.
"""

import importlib
import json
import sys
import time
import tomllib
from pathlib import Path

import bpy

MODULE = "bl_ext.user_default.radiometric"
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


def main(zip_path: str, story_path: str) -> None:
    import addon_utils  # to be found only once bpy is there

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.extensions.package_install_files(
        filepath=zip_path, repo="user_default", enable_on_install=False
    )
    story = {"enabled": [], "seconds": [], "left_behind": [], "loaded_by_enabling": []}
    for _ in range(2):
        before, modules = traces(), set(sys.modules)
        start = time.perf_counter()
        addon_utils.enable(MODULE, default_set=True)
        story["seconds"].append(time.perf_counter() - start)
        story["enabled"].append(addon_utils.check(MODULE)[1])
        story["loaded_by_enabling"] += sorted(set(sys.modules) - modules)
        story["registered"] = sorted(traces() - before)
        library = f"{MODULE}.blender_rad"
        story["library_version"] = importlib.import_module(library).__version__
        story["registries"] = {
            package: sorted(getattr(importlib.import_module(f"{library}.{package}"), name))
            for package, name in REGISTRIES.items()
        }
        addon_utils.disable(MODULE, default_set=True)
        story["left_behind"].append(sorted(traces() - before))
    manifest = Path(sys.modules[MODULE].__file__).with_name("blender_manifest.toml")
    story["manifest_version"] = tomllib.loads(manifest.read_text())["version"]
    story["outside_package_loaded"] = "blender_rad" in sys.modules
    Path(story_path).write_text(json.dumps(story))


main(*sys.argv[1:])
