# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: triangles, shading normals and UV maps as Cycles takes them."""

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Indices, Singles
from ..scene import Mesh
from ..textures import COLOUR, GENERATED, UV
from .arrays import gathered

_INTERNAL = {"position", "material_index", "sharp_face"}
_ATTRIBUTES = {
    "FLOAT": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
}
_BOX_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_BOX_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def read_mesh(bl_mesh: Any, *, modified: bool = False) -> tuple[Mesh, int]:
    """Return the triangles of an evaluated mesh, and how many that are not finite were left out.

    Model: which normals count is Cycles' choice. A mesh with custom normals or a sharp edge has
    normals by corner, any other by vertex; sharp faces are flat. Generated coordinates of modified
    meshes are those of their vertices before they moved.
    """
    bl_mesh.calc_loop_triangles()
    corners = gathered(bl_mesh.loop_triangles, "loops", np.int32, 3)
    faces = gathered(bl_mesh.loop_triangle_polygons, "value", np.int32)
    vertices = gathered(bl_mesh.vertices, "co", np.float32, 3)
    triangles = gathered(bl_mesh.loops, "vertex_index", np.int32)[corners]
    finite = np.isfinite(vertices).all(axis=1)
    keep = finite[triangles].all(axis=1)
    vertices[~finite] = 0.0
    triangles, corners, faces = triangles[keep], corners[keep], faces[keep]
    sharp = _attribute(bl_mesh, "sharp_face", "FACE", np.bool_)
    if sharp is None:
        sharp = np.full(len(bl_mesh.polygons), bl_mesh.normals_domain == "FACE")
    smooth = ~sharp[faces]
    slots = _attribute(bl_mesh, "material_index", "FACE", np.int32)
    attributes = _attributes(bl_mesh, triangles, corners, faces)
    centre, size = np.array(bl_mesh.texspace_location), np.array(bl_mesh.texspace_size)
    if modified:
        before = gathered(bl_mesh.vertices, "undeformed_co", np.float32, 3)
        place = 0.5 + 0.5 * (before - centre) / np.where(size == 0.0, 1.0, size)
        attributes[GENERATED] = place.astype(np.float32)[triangles]
    mesh = Mesh(
        name=bl_mesh.name,
        vertices=vertices,
        triangles=triangles,
        normals=_normals(bl_mesh, vertices, triangles, corners, smooth),
        smooth=smooth,
        slots=np.zeros(len(faces), np.int32) if slots is None else np.maximum(slots[faces], 0),
        attributes=attributes,
        texture_space=(centre, size),
    )
    return mesh, int(np.count_nonzero(~keep))


def box_mesh(name: str, low: Floats, high: Floats) -> Mesh:
    """Return the box between two corners, (3,) each, as a flat mesh of 12 triangles."""
    vertices = (low + _BOX_CORNERS * (high - low)).astype(np.float32)
    quads = np.array(_BOX_QUADS, dtype=np.int32)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    count = len(triangles)
    return Mesh(name, vertices, triangles, None, np.zeros(count, bool), np.zeros(count, np.int32))


def _attribute(bl_mesh: Any, name: str, domain: str, dtype: type) -> NDArray[Any] | None:
    """Return an attribute's values, None where the mesh does not have it."""
    found = bl_mesh.attributes.get(name)
    if found is None or found.domain != domain:
        return None
    return gathered(found.data, "value", dtype)


def _attributes(
    bl_mesh: Any,
    triangles: Indices,
    corners: Indices,
    faces: Indices,
) -> dict[str, Singles]:
    """Return what nodes can look up by name, (m, 3, k) at the corners of triangles."""
    places = {"POINT": triangles, "CORNER": corners, "FACE": np.repeat(faces[:, None], 3, axis=1)}
    found: dict[str, Singles] = {}
    for attribute in bl_mesh.attributes:
        if attribute.domain in places and attribute.data_type in _ATTRIBUTES:
            if attribute.name not in _INTERNAL and not attribute.name.startswith("."):
                key, width = _ATTRIBUTES[attribute.data_type]
                values = gathered(attribute.data, key, np.float32, width)
                found[attribute.name] = values[places[attribute.domain]]
    for layer in bl_mesh.uv_layers:
        if layer.active_render:
            found[UV] = found[layer.name]
    colours = bl_mesh.color_attributes
    if colours.render_color_index >= 0:
        found[COLOUR] = found[colours[colours.render_color_index].name]
    return found


def _by_corner(bl_mesh: Any) -> bool:
    """Return whether Cycles takes normals by corner: custom ones, or edges that divide them.

    Up to Blender 4.5 sharp faces alone do not divide the normals of their smooth neighbours, unlike
    in Blender's own drawing; in 5.2 they do.
    """
    if bl_mesh.has_custom_normals:
        return True
    if bpy.app.version >= (5, 0):
        return bl_mesh.normals_domain == "CORNER"
    sharp = _attribute(bl_mesh, "sharp_edge", "EDGE", np.bool_)
    return sharp is not None and bool(sharp.any()) and bl_mesh.normals_domain == "CORNER"


def _normals(
    bl_mesh: Any,
    vertices: Singles,
    triangles: Indices,
    corners: Indices,
    smooth: Bools,
) -> Singles | None:
    """Return unit normals by triangle corner, (m, 3, 3), None when every triangle is flat."""
    if not smooth.any():
        return None
    if _by_corner(bl_mesh):
        normals = gathered(bl_mesh.corner_normals, "vector", np.float32, 3)[corners]
    else:
        normals = gathered(bl_mesh.vertex_normals, "vector", np.float32, 3)[triangles]
    flat = ~smooth
    if flat.any():
        a, b, c = np.moveaxis(vertices[triangles[flat]].astype(np.float64), 1, 0)
        across = np.cross(b - a, c - a)
        length = np.linalg.norm(across, axis=1, keepdims=True)
        normals[flat] = (across / np.where(length > 0, length, 1.0))[:, None, :]
    return normals
