# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that calculate with numbers and vectors. What has no value, such as 0/0, becomes 0."""

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from . import TEXTURES, Call, clip, divided, dot, register, smoothstep, unit

Operation = Callable[[Floats, Floats, Floats], Floats]


def _converted(call: Call) -> Floats:
    """Return what a link between sockets of different types gives: `weights` times what comes."""
    weights = np.asarray(call.settings["weights"], dtype=np.float64)
    return call["a"] @ weights[:, None] if len(weights) == 3 else np.tile(call["a"], (1, 3))


def _component(call: Call) -> Floats:
    k = "XYZ".index(call.output)
    return call["Vector"][:, k : k + 1]


register(
    {
        "VALUE": lambda call: np.asarray(call.settings["value"], dtype=np.float64),
        "MULTIPLY": lambda call: call["a"] * call["b"],
        "ADD": lambda call: call["a"] + call["b"],
        "CLIP": lambda call: clip(call["a"]),
        "CONVERT": _converted,
        "ShaderNodeSeparateXYZ": _component,
        "ShaderNodeCombineXYZ": lambda call: call.columns("X", "Y", "Z"),
    }
)


def _smooth_minimum(a: Floats, b: Floats, c: Floats) -> Floats:
    return np.minimum(a, b) - divided(np.maximum(c - np.abs(a - b), 0.0), c) ** 3 * c / 6.0


OF_BOTH: dict[str, Operation] = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: divided(a, b),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: a**b,
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "FLOOR": lambda a, b, c: np.floor(a),
    "CEIL": lambda a, b, c: np.ceil(a),
    "MODULO": lambda a, b, c: np.fmod(a, b),
    "SNAP": lambda a, b, c: np.floor(divided(a, b)) * b,
    "WRAP": lambda a, b, c: np.where(b == c, c, a - (b - c) * np.floor((a - c) / (b - c))),
    "SINE": lambda a, b, c: np.sin(a),
    "COSINE": lambda a, b, c: np.cos(a),
    "TANGENT": lambda a, b, c: np.tan(a),
    "SIGN": lambda a, b, c: np.sign(a),
}
OF_NUMBERS = OF_BOTH | {
    "LOGARITHM": lambda a, b, c: np.where(
        (a > 0.0) & (b > 0.0), divided(np.log(a), np.log(b)), 0.0
    ),
    "SQRT": lambda a, b, c: np.sqrt(a),
    "INVERSE_SQRT": lambda a, b, c: np.where(a > 0.0, a**-0.5, 0.0),
    "EXPONENT": lambda a, b, c: np.exp(a),
    "LESS_THAN": lambda a, b, c: (a < b).astype(float),
    "GREATER_THAN": lambda a, b, c: (a > b).astype(float),
    "COMPARE": lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 2.0**-23)).astype(float),
    "SMOOTH_MIN": _smooth_minimum,
    "SMOOTH_MAX": lambda a, b, c: -_smooth_minimum(-a, -b, c),
    "ROUND": lambda a, b, c: np.floor(a + 0.5),
    "TRUNC": lambda a, b, c: np.trunc(a),
    "FRACT": lambda a, b, c: a - np.floor(a),
    "FLOORED_MODULO": lambda a, b, c: a - np.floor(a / b) * b,
    "PINGPONG": lambda a, b, c: np.abs((a - b) % (2.0 * b) - b),
    "ARCSINE": lambda a, b, c: np.arcsin(np.clip(a, -1.0, 1.0)),
    "ARCCOSINE": lambda a, b, c: np.arccos(np.clip(a, -1.0, 1.0)),
    "ARCTANGENT": lambda a, b, c: np.arctan(a),
    "ARCTAN2": lambda a, b, c: np.arctan2(a, b),
    "SINH": lambda a, b, c: np.sinh(a),
    "COSH": lambda a, b, c: np.cosh(a),
    "TANH": lambda a, b, c: np.tanh(a),
    "RADIANS": lambda a, b, c: np.radians(a),
    "DEGREES": lambda a, b, c: np.degrees(a),
}
OF_VECTORS = OF_BOTH | {
    "CROSS_PRODUCT": lambda a, b, c: np.cross(a, b),
    "PROJECT": lambda a, b, c: divided(dot(a, b), dot(b, b)) * b,
    "REFLECT": lambda a, b, c: a - 2.0 * dot(a, unit(b)) * unit(b),
    "FACEFORWARD": lambda a, b, c: np.where(dot(c, b) < 0.0, a, -a),
    "DOT_PRODUCT": lambda a, b, c: dot(a, b),
    "DISTANCE": lambda a, b, c: np.sqrt(dot(a - b, a - b)),
    "LENGTH": lambda a, b, c: np.sqrt(dot(a, a)),
    "NORMALIZE": lambda a, b, c: unit(a),
    "FRACTION": lambda a, b, c: a - np.floor(a),
}


@TEXTURES.register("ShaderNodeMath")
def _math(call: Call) -> Floats:
    values = (call[name] for name in ("Value", "Value_001", "Value_002"))
    found = OF_NUMBERS[call.settings["operation"]](*values)
    return clip(found) if call.settings["use_clamp"] else found


@TEXTURES.register("ShaderNodeVectorMath")
def _vector_math(call: Call) -> Floats:
    if call.settings["operation"] == "SCALE":
        return call["Vector"] * call["Scale"]
    values = (call[name] for name in ("Vector", "Vector_001", "Vector_002"))
    return OF_VECTORS[call.settings["operation"]](*values)


@TEXTURES.register("ShaderNodeClamp")
def _clamp(call: Call) -> Floats:
    low, high = call["Min"], call["Max"]
    if call.settings["clamp_type"] == "RANGE":
        low, high = np.minimum(low, high), np.maximum(low, high)
    return np.minimum(np.maximum(call["Value"], low), high)


@TEXTURES.register("ShaderNodeMapRange")
def _map_range(call: Call) -> Floats:
    vector = call.settings["data_type"] == "FLOAT_VECTOR"

    def read(name: str) -> Floats:
        return call[f"{name.replace(' ', '_')}_FLOAT3" if vector else name]

    low, high, first, last = map(read, ("From Min", "From Max", "To Min", "To Max"))
    share = divided(call["Vector" if vector else "Value"] - low, high - low)
    match call.settings["interpolation_type"]:
        case "STEPPED":
            steps = read("Steps")
            share = np.where(steps > 0.0, divided(np.floor(share * (steps + 1.0)), steps), 0.0)
        case "SMOOTHSTEP":
            share = smoothstep(share)
        case "SMOOTHERSTEP":
            share = clip(share)
            share = share**3 * (share * (share * 6.0 - 15.0) + 10.0)
        case _:
            pass
    found = first + share * (last - first)
    if not vector:
        found = np.where(high == low, 0.0, found)
    if call.settings["clamp"]:
        found = np.clip(found, np.minimum(first, last), np.maximum(first, last))
    return found


@TEXTURES.register("ShaderNodeMapping")
def _mapping(call: Call) -> Floats:
    vector, scale, turn = call["Vector"], call["Scale"], _euler(call["Rotation"])
    match call.settings["vector_type"]:
        case "TEXTURE":
            return divided(_turned(np.swapaxes(turn, 1, 2), vector - call["Location"]), scale)
        case "NORMAL":
            return unit(_turned(turn, divided(vector, scale)))
        case kind:
            return _turned(turn, vector * scale) + (call["Location"] if kind == "POINT" else 0.0)


def _euler(angles: Floats) -> Floats:
    """Return matrices (n, 3, 3) of rotations about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz],
        [cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz],
        [-sy, cy * sx, cy * cx],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _turned(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


@TEXTURES.register("ShaderNodeNormal")
def _normal(call: Call) -> Floats:
    direction = unit(np.array([call.settings["direction"]]))
    return direction if call.output == "Normal" else dot(direction, unit(call["Normal"]))
