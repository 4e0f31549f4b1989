# SPDX-License-Identifier: GPL-3.0-or-later
"""The open scene in clay, for Cycles: what `Surface.clay` says of materials, built."""

from typing import Any

import bpy

from ..scene import CLAY_ALBEDO, Material
from . import nodes
from .materials import surface_of

_NAME = "Clay"


def make_clay() -> None:
    """Turn all materials to clay in place, and give bare surfaces one.

    Node trees are replaced rather than slots, so that linked materials and those that geometry
    nodes set turn as well. View layers may override materials: the override turns like the rest.
    """
    paints = [m for m in bpy.data.materials if not m.is_grease_pencil]
    for bl_material, clay in [(m, surface_of(m).clay) for m in paints]:
        _rebuild(bl_material, clay)
    bare = bpy.data.materials.new(_NAME)
    _rebuild(bare, Material(_NAME, albedo=(CLAY_ALBEDO, CLAY_ALBEDO, CLAY_ALBEDO)))
    tree = _cover_tree(bare)
    for bl_object in bpy.data.objects:
        _cover(bl_object, bare)
        _cover_made(bl_object, tree)


def _rebuild(bl_material: Any, clay: Material) -> None:
    """Make `bl_material` shade as `clay`; emission that is not known stays as it is, opaque."""
    if not nodes.uses_nodes(bl_material):
        bl_material.use_nodes = True
    tree = bl_material.node_tree
    output = tree.get_output_node('CYCLES') or tree.nodes.new('ShaderNodeOutputMaterial')
    bl_material.use_transparent_shadow = False
    for name in ("Volume", "Displacement"):
        for link in list(output.inputs[name].links):
            tree.links.remove(link)
    if not clay.emission_known:
        return
    surface, add = output.inputs["Surface"], tree.nodes.new('ShaderNodeAddShader')
    _keep_emission(surface)
    for link in surface.links:
        tree.links.new(link.from_socket, add.inputs[1])
    tree.links.new(add.outputs[0], surface)
    if any(clay.albedo):
        lambert = tree.nodes.new('ShaderNodeBsdfDiffuse')
        lambert.inputs["Color"].default_value = (*clay.albedo, 1.0)
        lambert.inputs["Roughness"].default_value = 0.0
        tree.links.new(lambert.outputs[0], add.inputs[0])


def _keep_emission(surface: Any) -> None:
    """Leave nothing of the closures behind a socket but what they emit."""
    for leaf in list(nodes.leaves(surface)):
        node, tree = leaf.node, leaf.node.id_data
        if node.bl_idname == "ShaderNodeEmission":
            continue
        targets = [link.to_socket for link in node.outputs[0].links]
        for link in list(node.outputs[0].links):
            tree.links.remove(link)
        if node.bl_idname != "ShaderNodeBsdfPrincipled":
            continue
        glow, dim = tree.nodes.new('ShaderNodeEmission'), tree.nodes.new('ShaderNodeMath')
        dim.operation = 'MULTIPLY'
        tree.links.new(dim.outputs[0], glow.inputs["Strength"])
        for name, to in (
            ("Emission Color", glow.inputs["Color"]),
            ("Emission Strength", dim.inputs[0]),
            ("Alpha", dim.inputs[1]),
        ):
            to.default_value = node.inputs[name].default_value
            for link in node.inputs[name].links:
                tree.links.new(link.from_socket, to)
        for target in targets:
            tree.links.new(glow.outputs[0], target)


def _cover(bl_object: Any, bare: Any) -> None:
    """Put `bare` where the object's surface has no material."""
    materials = getattr(bl_object.data, "materials", None)
    if materials is None:
        return
    if not len(materials):
        materials.append(bare)
    for index, slot in enumerate(bl_object.material_slots):
        if slot.material is None and slot.link == 'OBJECT':
            slot.material = bare
        elif slot.material is None:
            materials[index] = bare


def _cover_tree(bare: Any) -> Any:
    """Return geometry nodes that put `bare` on all faces without a material, in instances too."""
    tree: Any = bpy.data.node_groups.new(_NAME, 'GeometryNodeTree')
    for way in ('INPUT', 'OUTPUT'):
        tree.interface.new_socket("Geometry", in_out=way, socket_type='NodeSocketGeometry')
    start, end = tree.nodes.new('NodeGroupInput'), tree.nodes.new('NodeGroupOutput')
    without = tree.nodes.new('GeometryNodeMaterialSelection')
    assign = tree.nodes.new('GeometryNodeSetMaterial')
    assign.inputs["Material"].default_value = bare
    tree.links.new(start.outputs[0], assign.inputs["Geometry"])
    tree.links.new(without.outputs[0], assign.inputs["Selection"])
    tree.links.new(assign.outputs[0], end.inputs[0])
    return tree


def _cover_made(bl_object: Any, tree: Any) -> None:
    """Cover what the object's geometry nodes make, right after the last of them."""
    made = [k for k, m in enumerate(bl_object.modifiers) if m.type == 'NODES' and m.show_render]
    if made:
        bl_object.modifiers.new(_NAME, 'NODES').node_group = tree
        bl_object.modifiers.move(len(bl_object.modifiers) - 1, made[-1] + 1)
