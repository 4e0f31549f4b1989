# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that tell where a point is and how it is seen."""

import numpy as np

from ..arrays import Floats
from ..bsdfs._fresnel import Dielectric
from ..rays import transform_points
from . import COLOUR, GENERATED, SOURCES, UV, ZERO, Call, Context, divided, dot, unit
from .normals import radial


def _attribute(context: Context, name: str) -> Floats:
    """Return an attribute as (n, 3), 0 where there is none."""
    found = context.attribute(name)
    if found is None:
        return ZERO
    width = found.shape[1]
    if width == 1:
        return np.tile(found, (1, 3))
    return np.pad(found, ((0, 0), (0, 1))) if width == 2 else found[:, :3]


@SOURCES.register("ShaderNodeTexCoord")
def _texture_coordinate(call: Call) -> Floats:
    context = call.context
    match call.output:
        case "UV":
            return _attribute(context, UV)
        case "Generated" if context.attribute(GENERATED) is not None:
            return _attribute(context, GENERATED)
        case "Normal":
            return unit(context.normal_in_object)
        case "Reflection":
            normal = context.normal
            return 2.0 * dot(normal, context.incoming) * normal - context.incoming
        case _:  # lights have no bounds: Generated is Object
            inverse = call.settings.get("object_from_world", context.object_from_world)
            return transform_points(inverse, context.position)


@SOURCES.register("MEASURED")
def _measured(call: Call) -> Floats:
    """Return what Blender says, `width` 1 or 3 wide, of the socket in a `slot`."""
    return call.context.measured(call.settings["slot"])[:, : call.settings["width"]]


@SOURCES.register("ShaderNodeUVMap")
def _uv_map(call: Call) -> Floats:
    return _attribute(call.context, call.settings["uv_map"])


@SOURCES.register("ShaderNodeVertexColor")
def _colour_attribute(call: Call) -> Floats:
    name = call.settings["layer_name"] or COLOUR
    found = call.context.attribute(name)
    if call.output == "Alpha":
        return np.zeros((1, 1)) if found is None else found[:, 3:]
    return _attribute(call.context, name)


@SOURCES.register("ShaderNodeAttribute")
def _named_attribute(call: Call) -> Floats:
    found = call.context.attribute(call.settings["attribute_name"])
    width = 0 if found is None else found.shape[1]
    if call.output == "Alpha":
        return np.ones((1, 1)) if found is None or width < 4 else found[:, 3:]
    if call.output == "Fac" and found is not None and width == 2:
        return found[:, :1]
    vector = _attribute(call.context, call.settings["attribute_name"])
    return vector.mean(axis=1, keepdims=True) if call.output == "Fac" else vector


@SOURCES.register("ShaderNodeNewGeometry")
def _geometry(call: Call) -> Floats:
    if call.output == "Tangent":
        return radial(call.context, "Z")
    name = "geometric" if call.output == "True Normal" else call.output.lower()
    return np.asarray(getattr(call.context, name), dtype=np.float64)


@SOURCES.register("ShaderNodeObjectInfo")
def _object_info(call: Call) -> Floats:
    return np.linalg.inv(call.context.object_from_world)[None, :3, 3]


@SOURCES.register("ShaderNodeLightFalloff")
def _light_falloff(call: Call) -> Floats:
    length, strength, smooth = call.context.distance, call["Strength"], call["Smooth"]
    power = {"Quadratic": 0, "Linear": 1, "Constant": 2}[call.output]
    damped = np.where(smooth > 0.0, length**2 / (smooth + length**2), 1.0)
    return np.where(np.isinf(length), strength, strength * length**power * damped)


def _reflectance(call: Call, eta: Floats) -> Floats:
    """Return Fresnel's at a relative index of refraction, its inverse seen from the back."""
    eta = np.where(call.context.backfacing > 0.0, 1.0 / eta, eta)
    facing = np.abs(dot(call.context.incoming, call["Normal"]))
    return Dielectric(eta).reflectance(facing)[:, 0]


@SOURCES.register("ShaderNodeFresnel")
def _fresnel(call: Call) -> Floats:
    return _reflectance(call, np.maximum(call["IOR"], 1e-5))


@SOURCES.register("ShaderNodeLayerWeight")
def _layer_weight(call: Call) -> Floats:
    blend = call["Blend"]
    if call.output == "Fresnel":
        return _reflectance(call, 1.0 / np.maximum(1.0 - blend, 1e-5))
    blend = np.clip(blend, 0.0, 1.0 - 1e-5)
    power = np.where(blend < 0.5, 2.0 * blend, divided(np.array(0.5), 1.0 - blend))
    return 1.0 - np.abs(dot(call.context.incoming, call["Normal"])) ** power
