# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene brought up to date: only the lights and places that have changed are read again."""

from collections import Counter
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ..scene import Scene
from .arrays import matrix
from .instances import Reader

_SAID_BY_OBJECTS = (bpy.types.Light, bpy.types.Camera, bpy.types.ShaderNodeTree)
_UNSEEN = {'CAMERA', 'EMPTY', 'ARMATURE', 'LATTICE', 'SPEAKER', 'LIGHT_PROBE'}


def changed(depsgraph: Any) -> set[str] | None:
    """Return the objects that an update has moved or relit, None where it has changed more.

    An object that others depend on marks those as well.
    """
    names: set[str] = set()
    for update in depsgraph.updates:
        block, moved = update.id, update.is_updated_transform
        shape, look = update.is_updated_geometry, update.is_updated_shading
        if not (moved or shape or look) or isinstance(block, _SAID_BY_OBJECTS):
            continue
        if not isinstance(block, bpy.types.Object):
            return None
        if block.type in _UNSEEN and not block.is_instancer:
            continue
        if shape or look:
            relit = block.type == 'LIGHT' and shape  # its data; its own switches are `look` alone
            if not relit:
                return None
        names.add(block.name)
    return names


def follow(scene: Scene, depsgraph: Any, names: set[str]) -> Scene | None:
    """Return `scene`, as it was read, with the objects `names` as they are now.

    None where only a new reading can tell: of instances, and of lights that come, go or are odd.
    """
    objects = {name: depsgraph.objects.get(name) for name in names}
    lit = {name: found for name, found in objects.items() if found and found.type == 'LIGHT'}
    placed = Counter(instance.name for instance in scene.instances)
    if any(placed[name] > 1 or found is None for name, found in objects.items()):
        return None
    worlds = {name: matrix(found.matrix_world) for name, found in objects.items() if found}
    reader = Reader(depsgraph, scene.shading, scene.model, scene.unit_scale_m)
    for name, found in lit.items():
        reader.read_light(found, worlds[name])
    lights = {light.name: light for light in reader.lights}
    records = {record.name: record for record in reader.records}
    known = Counter(light.name for light in scene.lights)
    if reader.findings or reader.unsupported or any(known[name] != 1 for name in lit):
        return None
    if not (set(lit) == set(lights) == set(records) and all(map(_finite, worlds.values()))):
        return None
    return replace(
        scene,
        lights=tuple(lights.get(light.name, light) for light in scene.lights),
        light_records=tuple(records.get(r.name, r) for r in scene.light_records),
        instances=tuple(
            replace(i, world_from_object=worlds[i.name]) if i.name in worlds else i
            for i in scene.instances
        ),
    )


def _finite(world: Any) -> bool:
    return bool(np.isfinite(world).all())
