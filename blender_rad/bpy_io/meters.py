# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects as meters: where they stand and where they look."""

from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np

from ..arrays import Floats
from ..errors import RadError, unknown_name
from .arrays import gathered, matrix

MARK = "meter"  # how an empty's name begins, or a custom property of any object


def marked_meters(bl_scene: Any) -> list[str]:
    """Return the names of the objects that are marked as meters."""
    return sorted(
        o.name
        for o in bl_scene.objects
        if MARK in o or (o.type == 'EMPTY' and o.name.lower().startswith(MARK))
    )


def meter_places(bl_scene: Any, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Return origins (n, 3) [bu] and unit local +Z axes (n, 3) of objects, in the world."""
    found = [_find(bl_scene, name, "meter", 'EMPTY') for name in names]
    worlds = _worlds(bl_scene, found)
    return worlds[:, :3, 3], np.array([_axis(w, o) for w, o in zip(worlds, found, strict=True)])


def rectangle(bl_scene: Any, name: str) -> tuple[Floats, Floats]:
    """Return a mesh's XY rectangle: a corner and two edges (3, 3) [bu]; and its unit +Z axis (3,).

    It lies at the mesh's highest local Z; modifiers do not count.
    """
    found = _find(bl_scene, name, "grid", 'MESH')
    if found.type != "MESH" or not len(found.data.vertices):
        raise RadError("not a rectangle", f"--grid {name}", "expected a mesh with vertices")
    points = gathered(found.data.vertices, "co", np.float32, 3).astype(np.float64)
    (x0, y0, _), (x1, y1, z) = points.min(axis=0), points.max(axis=0)
    world = _worlds(bl_scene, [found])[0]
    edges = np.array([(x0, y0, z, 1), (x1 - x0, 0, 0, 0), (0, y1 - y0, 0, 0)])
    return edges @ world[:3].T, _axis(world, found)


def _find(bl_scene: Any, name: str, kind: str, bl_type: str) -> Any:
    """Return an object by name; where it is unknown, name the likely ones."""
    known = {o.name: o for o in bl_scene.objects}
    if name not in known:
        likely = [o.name for o in known.values() if o.type == bl_type or MARK in o]
        raise unknown_name(kind, name, f"scene {bl_scene.name!r}", likely or list(known))
    return known[name]


def _axis(world: Floats, bl_object: Any) -> Floats:
    length = np.linalg.norm(world[:3, 2])
    if not (np.isfinite(world).all() and length > 0.0):
        raise RadError("looks nowhere", f"object {bl_object.name!r}", "expected a scale above 0")
    return np.asarray(world[:3, 2] / length)


def _worlds(bl_scene: Any, objects: list[Any]) -> Floats:
    """Return the world matrices (n, 4, 4) [bu] of objects.

    Blender evaluates no hidden objects, and what stands in excluded collections: their matrices
    are stale. So each is followed by a probe that copies its place, and these are asked.
    """
    probes: list[Any] = []
    with ExitStack() as undo:
        for target in objects:
            probe: Any = bpy.data.objects.new("probe", None)
            undo.callback(bpy.data.objects.remove, probe)
            probes.append(probe)
            bl_scene.collection.objects.link(probe)
            probe.constraints.new("COPY_TRANSFORMS").target = target
        layer = bl_scene.view_layers[0]
        layer.update()
        found = [matrix(probe.evaluated_get(layer.depsgraph).matrix_world) for probe in probes]
    return np.array(found).reshape(-1, 4, 4)
