# SPDX-License-Identifier: GPL-3.0-or-later
"""Four lights of four kinds over two boxes on a floor: quick to render, and no light is faint."""

from __future__ import annotations

from typing import Any

import bpy

WHERE: dict[str, tuple[tuple[float, float, float], dict[str, Any]]] = {
    'AREA': ((-1.5, 0.6, 2.0), {"energy": 42, "color": (1.0, 0.8, 0.6), "size": 0.6}),
    'SPOT': ((1.4, 0.5, 2.4), {"energy": 200, "color": (0.5, 0.7, 1.0), "spot_size": 0.9}),
    'POINT': ((0.3, -1.0, 1.0), {"energy": 24, "color": (1.0, 0.5, 0.6), "shadow_soft_size": 0.1}),
    'SUN': ((0.0, 0.0, 3.0), {"energy": 1.0, "color": (0.9, 1.0, 0.9), "angle": 0.05}),
}
TURNED = {'SUN': (0.6, 0.5, 0.0)}


def build() -> Any:
    """Build the scene and return its bpy.types.Scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_plane_add(size=8)
    for x, y, side in ((-0.6, 0.2, 0.5), (0.9, -0.1, 0.4)):
        bpy.ops.mesh.primitive_cube_add(size=side, location=(x, y, side / 2))
    _paint()
    for kind, (place, properties) in WHERE.items():
        data = bpy.data.lights.new(kind.title(), kind)
        for key, value in properties.items():
            setattr(data, key, value)
        light = bpy.data.objects.new(kind.title(), data)
        light.location, light.rotation_euler = place, TURNED.get(kind, (0.0, 0.0, 0.0))
        bpy.context.collection.objects.link(light)
    bpy.ops.object.camera_add(location=(0, -3.4, 3.4), rotation=(0.78, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.context.scene.render.engine = 'CYCLES'
    return bpy.context.scene


def _paint() -> None:
    """Make all surfaces Lambert; from Blender 5, what has no material is Principled."""
    grey = bpy.data.materials.new("Grey")
    if grey.node_tree is None:
        grey.use_nodes = True
    nodes = grey.node_tree.nodes
    nodes.clear()
    output, diffuse = nodes.new('ShaderNodeOutputMaterial'), nodes.new('ShaderNodeBsdfDiffuse')
    diffuse.inputs["Color"].default_value = (0.7, 0.7, 0.7, 1.0)
    grey.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    for mesh in bpy.data.meshes:
        mesh.materials.append(grey)
