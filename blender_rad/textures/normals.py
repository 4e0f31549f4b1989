# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that bend normals, and tangents."""

import numpy as np

from ..arrays import Floats
from . import GENERATED, NORMAL, SOURCES, TANGENT, UV, ZERO, Call, Context, clip, dot, unit


def _to_world(context: Context, normals: Floats) -> Floats:
    return unit(normals @ context.object_from_world[:3, :3])


@SOURCES.register("ShaderNodeNormalMap")
def _normal_map(call: Call) -> Floats:
    """Return the normal that a colour states, of the plain one as far as the strength says.

    In tangent space (T, s n × T, n) is no orthonormal frame: T and n are those of the corners,
    interpolated, not square to each other, and of unit length only where the setting `unit_normal`
    makes n so.
    """
    context, strength, space = call.context, call["Strength"], call.settings["space"]
    stated = 2.0 * call["Color"] - 1.0
    if call.settings.get("convention") == "DIRECTX":
        stated = stated * np.array([1.0, -1.0, 1.0])
    if space.startswith("BLENDER_"):
        stated = stated * np.array([1.0, -1.0, -1.0])
    side = 1.0 - 2.0 * context.backfacing
    if space == "TANGENT":
        tangents = context.attribute((call.settings["uv_map"] or UV) + TANGENT)
        normal = context.attribute(NORMAL)
        if tangents is None or normal is None:
            return context.normal
        normal = unit(normal) if call.settings.get("unit_normal") else normal
        along = tangents[:, :3]
        across = tangents[:, 3:] * np.cross(normal, along)
        depth = 1.0 + clip(strength) * (stated[:, 2:] - 1.0)
        bent = strength * (stated[:, :1] * along + stated[:, 1:2] * across) + depth * normal
        bent = _to_world(context, unit(bent)) * side
    else:
        bent = side * (_to_world(context, stated) if space.endswith("OBJECT") else unit(stated))
        further = context.normal + (bent - context.normal) * np.maximum(strength, 0.0)
        bent = np.where(strength == 1.0, bent, unit(further))
    return np.where(bent.any(axis=1, keepdims=True), bent, context.normal)


def radial(context: Context, axis: str) -> Floats:
    """Return the tangents (n, 3) around an axis of the bounds."""
    generated = context.attribute(GENERATED)
    from_middle = (context.position if generated is None else generated) - 0.5
    axes = np.diag([1.0, -1.0, 1.0])  # Cycles turns the other way about Y
    return _in_surface(context, np.asarray(np.cross(axes["XYZ".index(axis)], from_middle), float))


def _in_surface(context: Context, tangent: Floats) -> Floats:
    """Return unit vectors (n, 3) in the tangent plane, as near to `tangent` of the object."""
    tangent = _to_world(context, tangent)
    return unit(tangent - dot(tangent, context.normal) * context.normal)


@SOURCES.register("ShaderNodeTangent")
def _tangent(call: Call) -> Floats:
    if call.settings["direction_type"] == "RADIAL":
        return radial(call.context, call.settings["axis"])
    found = call.context.attribute((call.settings["uv_map"] or UV) + TANGENT)
    return ZERO if found is None else _in_surface(call.context, found[:, :3])
