# SPDX-License-Identifier: GPL-3.0-or-later
"""Making what emits brighter or darker, in the open file."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..atomic import atomic_path
from ..emitters import WORLD_NAME, emitters
from ..errors import RadError
from ..scene import Scene
from . import nodes
from .materials import surface_of
from .quiet import interrupt_later, quiet_stdout
from .read import read_scene

KEPT = 1e-5  # relative: what a light may be off by after it was set, by rounding


def scale_power(bl_scene: Any, name: str, factor: float) -> float:
    """Make a light `factor` times as bright; return its new energy or strength.

    Data that other objects share is copied for this one first. `RadError` where that cannot be set
    here: linked data, or strengths inside node groups.
    """
    local: Any = (o for o in bpy.data.objects if o.name == name and not o.library)
    bl_object, world = next(local, None), bl_scene.world
    if bl_object and bl_object.type != "LIGHT":
        return _scale_mesh(bl_object, factor)
    if bl_object and not bl_object.data.library:
        if bl_object.data.users > 1:
            bl_object.data = bl_object.data.copy()
        bl_object.data.energy *= factor
        return float(bl_object.data.energy)
    if bl_object or name != WORLD_NAME or world is None or world.library:
        known = "expected data of this file: make it local, or solve in the file that it is from"
        raise RadError("linked data cannot be changed", f"light {name!r}", known)
    if world.users > 1:
        world = bl_scene.world = world.copy()
    return scale_emission(world, factor)


def check_powers(bl_scene: Any, before: Scene, factors: dict[str, float]) -> None:
    """Raise where the open scene's lights are not those of `before` times their factors."""
    wanted = {n: rgb * factors.get(n, 1.0) for n, rgb in _emission(before).items()}
    found = _emission(read_scene(bl_scene, model=before.model))
    for name, rgb in wanted.items():
        if not np.allclose(found.get(name, np.zeros(3)), rgb, rtol=KEPT, atol=1e-30):
            plain = "a plain one: not animated, driven, or made by geometry nodes"
            raise _fixed(f"light {name!r}", plain)


def save_copy(path: Path) -> None:
    """Write the open file to `path`; what it links relative to its folder stays linked."""
    with atomic_path(path) as temporary, interrupt_later(), quiet_stdout():
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), copy=True, check_existing=False)


def _emission(scene: Scene) -> dict[str, Any]:
    """Return the sum of `Light.rgb` (3,) by name."""
    found, names = emitters(scene)
    return {
        name: np.sum([e.light.rgb for e in found if e.layer == layer], axis=0)
        for layer, name in enumerate(names)
    }


def _fixed(where: str, expected: str) -> RadError:
    return RadError("its power cannot be set", where, f"expected {expected}")


def _scale_mesh(bl_object: Any, factor: float) -> float:
    strengths: list[float] = []
    for slot in bl_object.material_slots:
        material = slot.material
        if not surface_of(material).may_emit:
            continue
        shared = slot.link == "DATA" and bl_object.data.users > 1
        if shared or material.users > 1 or material.library:
            material = material.copy()
            slot.link = "OBJECT"
            slot.material = material
        strengths.append(scale_emission(material, factor))
    if not strengths:
        raise _fixed(f"light {bl_object.name!r}", "an emitting material in its slots")
    return strengths[0]


def scale_emission(block: Any, factor: float, start: float = 0.0) -> float:
    """Scale all constant strengths of a world or material; return the first that is not 0.

    What has none counts as `start`.
    """
    if block.id_type == 'WORLD' and not nodes.uses_nodes(block):
        block.color = [(channel or start) * factor for channel in block.color]
        return float(max(block.color))
    tree = block.node_tree
    output = tree.get_output_node("CYCLES")
    found = {leaf.node.as_pointer(): leaf for leaf in nodes.leaves(output.inputs["Surface"])}
    strengths: list[float] = []
    for leaf in found.values():
        inputs = leaf.node.inputs
        socket = inputs.get("Emission Strength") or inputs.get("Strength")
        value = socket and (nodes.number(socket, leaf.groups) or start)
        if not value:
            continue
        if leaf.groups:
            raise _fixed(repr(block.name), "its emission outside node groups: ungroup it")
        for link in list(socket.links):
            tree.links.remove(link)
        socket.default_value = value * factor
        strengths.append(float(socket.default_value))
    return next(iter(strengths), 0.0)
