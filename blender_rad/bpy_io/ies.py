# SPDX-License-Identifier: GPL-3.0-or-later
"""IES Texture nodes of lights: the text they hold, and how they are turned."""

import warnings
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler

from ..arrays import Floats
from ..photometry import Distribution, as_ies
from ..scene import BLACK
from . import nodes

FEATURE = "IES Texture"


def add_photometric_light(light: Distribution) -> Any:
    """Add a point light of `light` to the open scene, and return its object.

    Where the object is not turned, C0 shines along +X, C90 along +Y, gamma 0 down. Its 1 W means
    the file's candelas: times 1/177.83 in W/sr to Cycles, see `as_ies` for what it interpolates.
    """
    text = bpy.data.texts.new(f"{light.name}.ies")
    text.from_string(as_ies(light, blender=True))
    lamp: Any = bpy.data.lights.new(light.name, 'POINT')
    lamp.energy, lamp.shadow_soft_size = 1.0, 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        lamp.use_nodes = True
    tree = lamp.node_tree
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    node: Any = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.ies, node.location = 'INTERNAL', text, (-200.0, 300.0)
    tree.links.new(node.outputs["Fac"], emission.inputs["Strength"])
    placed = bpy.data.objects.new(light.name, lamp)
    collection: Any = bpy.context.collection
    collection.objects.link(placed)
    return placed


def ies_emission(light: Any, world_from_light: Floats) -> tuple[dict[str, Any], str | None] | None:
    """Return the record properties of a light's IES Texture, and what is not known of it.

    None where no IES Texture feeds the strength of a single Emission.
    """
    output = light.node_tree.get_output_node("CYCLES")
    found = list(nodes.leaves(output.inputs["Surface"])) if output else []
    if len(found) != 1 or found[0].node.bl_idname != "ShaderNodeEmission":
        return None
    leaf = found[0]
    factor, node, groups = _product(leaf.node.inputs["Strength"], leaf.groups)
    if node is None or node.bl_idname != "ShaderNodeTexIES":
        return None
    strength = nodes.number(node.inputs["Strength"], groups)
    rgb = nodes.colour(leaf.node.inputs["Color"], leaf.groups)
    frame = _frame(node.inputs["Vector"], groups, light, world_from_light[:3, :3].T)
    if factor is None or strength is None or rgb is None or leaf.share is None or frame is None:
        return {}, f"{FEATURE} with inputs that are not constant"
    if light.type == 'SUN' or abs(np.linalg.det(frame)) == 0.0:
        return {}, f"{FEATURE} on a {light.type.lower()} light of no size"
    tint = tuple(factor * strength * leaf.share * channel for channel in rgb)
    return {"node_emission": tint, "ies_text": _content(node), "ies_frame": frame}, None


def _product(socket: Any, groups: nodes.Groups) -> tuple[float | None, Any, nodes.Groups]:
    """Return the node behind `socket` and the constant that Multiply nodes put before it."""
    output, groups = nodes.source(socket, groups)[1:3]
    node = output and output.node
    if node is None or node.bl_idname != "ShaderNodeMath" or node.operation != 'MULTIPLY':
        return 1.0, node, groups
    for this, other in ((0, 1), (1, 0)):
        constant = nodes.number(node.inputs[other], groups)
        if constant is not None and not node.use_clamp:
            factor, node, groups = _product(node.inputs[this], groups)
            return factor and constant * factor, node, groups
    return None, None, groups


def _content(node: Any) -> bytes:
    """Return the text that Cycles reads; nothing where there is none."""
    if node.mode == 'INTERNAL':
        return node.ies.as_string().encode() if node.ies else b""
    path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
    return path.read_bytes() if path.is_file() else b""


def _frame(socket: Any, groups: nodes.Groups, light: Any, normal: Floats) -> Floats | None:
    """Return the linear map (3, 3) from leaving directions to a vector socket's value.

    `normal` is the map of normals to the light's frame, which Cycles applies to directions here.
    """
    output, inner = nodes.source(socket, groups)[1:3]
    if output is None:
        return normal if socket.node.bl_idname == "ShaderNodeTexIES" else None
    node = output.node
    # Only a light without a surface of its own shows the ray's direction as its normal.
    soft = light.type in {'POINT', 'SPOT'}
    soft = soft and (light.use_soft_falloff or light.shadow_soft_size == 0.0)
    match node.bl_idname, output.identifier:
        case "ShaderNodeTexCoord", "Normal":
            return normal if soft else None
        case "ShaderNodeNewGeometry", "Incoming":
            return np.eye(3)
        case "ShaderNodeNewGeometry", "Normal" | "True Normal":
            return np.eye(3) if soft else None
        case "ShaderNodeMapping", _:
            before = _frame(node.inputs["Vector"], inner, light, normal)
            turn = _mapping(node, inner)
            return None if before is None or turn is None else turn @ before
        case _:
            return None


def _mapping(node: Any, groups: nodes.Groups) -> Floats | None:
    """Return the matrix (3, 3) of a Mapping node that only turns and scales."""
    rotation, scale = (nodes.colour(node.inputs[name], groups) for name in ("Rotation", "Scale"))
    moves = node.vector_type in {'POINT', 'TEXTURE'}
    still = not moves or nodes.colour(node.inputs["Location"], groups) == BLACK
    if not still or rotation is None or scale is None or 0.0 in scale:
        return None
    turn, stretch = np.array(Euler(rotation).to_matrix(), dtype=np.float64), np.diag(scale)
    if node.vector_type == 'TEXTURE':
        return np.linalg.inv(turn @ stretch)
    return turn @ (np.linalg.inv(stretch) if node.vector_type == 'NORMAL' else stretch)
