# SPDX-License-Identifier: GPL-3.0-or-later
"""What only Blender can compute of node trees, asked of it where the camera looks first.

In a copy of the scene each socket that is asked for feeds an AOV named by its slot, and Cycles
renders one sample a pixel at k times the resolution through a filter of next to no width: what it
writes are the values at the middle of each k-th of a pixel, for the camera rays that pass there.
Geometry and surfaces are Blender's, all light is ours.
"""

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np

from ..arrays import Singles
from .expressions import NUMBERS
from .questions import Asking
from .witness import CyclesWitness

FINEST = 4  # points along a pixel
MOST = 1 << 23  # points in all slots together, as long as each pixel has one


def measure(bl_scene: Any, questions: list[Asking], resolution: tuple[int, int]) -> Singles | None:
    """Return `Scene.measured`, None where nothing is asked. What is changed for it is put back."""
    asked = [asking for asking in questions if asking.slots]
    count = max((len(asking.slots) for asking in asked), default=0)
    if not count:
        return None
    width, height = resolution
    finer = min(max(math.isqrt(MOST // (count * width * height)), 1), FINEST)
    with ExitStack() as undo:
        scene = bl_scene.copy()
        undo.callback(bpy.data.scenes.remove, scene)
        for tree in [*bpy.data.node_groups, *(asking.bl_material.node_tree for asking in asked)]:
            _widen_bumps(tree, finer, undo.callback)
        for asking in asked:
            _wire(asking, undo.callback)
        cycles = CyclesWitness(scene, resolution=(finer * width, finer * height))
        cycles.prepare()
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = 'GAUSSIAN', 0.01
        scene.render.use_persistent_data = scene.render.use_border = False
        layer = next(layer for layer in scene.view_layers if layer.use)
        for slot in range(count):
            layer.aovs.add().name = _name(slot)
        channels = cycles.layers()
    slots = [[channels[f"{layer.name}.{_name(slot)}.{c}"] for c in "RGB"] for slot in range(count)]
    return np.moveaxis(np.array(slots, dtype=np.float32), 1, -1)


def _name(slot: int) -> str:
    return f"Measured {slot}"


def _widen_bumps(tree: Any, factor: float, undo: Callable[..., Any]) -> None:
    """Let bumps slope as over whole pixels."""
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeBump":
            width = node.inputs["Filter Width"]
            undo(setattr, width, "default_value", width.default_value)
            width.default_value *= factor


def _wire(asking: Asking, undo: Callable[..., Any]) -> None:
    """Make a material opaque, and feed an AOV from each socket that is asked for."""
    tree = asking.bl_material.node_tree
    trees: dict[tuple[str, ...], Any] = {(): tree}
    for (path, name, identifier), slot in asking.slots.items():
        inside = _entered(trees, path, undo)
        if name:
            socket = next(s for s in inside.nodes[name].inputs if s.identifier == identifier)
            value = next(link for link in socket.links if not link.is_muted).from_socket
            number = socket.type in NUMBERS
        else:
            geometry = _added(inside, "ShaderNodeNewGeometry", undo)
            value, number = geometry.outputs["Normal"], False
        if number:  # as the socket converts it
            packed = _added(inside, "ShaderNodeCombineXYZ", undo)
            inside.links.new(value, packed.inputs["X"])
            value = packed.outputs[0]
        aov = _added(inside, "ShaderNodeOutputAOV", undo)
        aov.aov_name = _name(slot)
        inside.links.new(value, aov.inputs["Color"])
    surface = tree.get_output_node("CYCLES").inputs["Surface"]
    if surface.links:
        undo(tree.links.new, surface.links[0].from_socket, surface)
    tree.links.new(_added(tree, "ShaderNodeBsdfDiffuse", undo).outputs[0], surface)


def _added(tree: Any, kind: str, undo: Callable[..., Any]) -> Any:
    node = tree.nodes.new(kind)
    undo(tree.nodes.remove, node)
    return node


def _entered(
    trees: dict[tuple[str, ...], Any], path: tuple[str, ...], undo: Callable[..., Any]
) -> Any:
    """Return the tree of a group in `trees`, its own in place of one that others may share."""
    if path not in trees:
        group = _entered(trees, path[:-1], undo).nodes[path[-1]]
        shared, own = group.node_tree, group.node_tree.copy()
        group.node_tree = own
        undo(bpy.data.node_groups.remove, own)
        undo(setattr, group, "node_tree", shared)
        trees[path] = own
    return trees[path]
