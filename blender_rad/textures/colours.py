# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that mix, grade and take apart colours."""

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from ..lights._emission import blackbody_rgb
from . import TEXTURES, Call, clip, divided, register

BLENDS: dict[str, Callable[[Floats, Floats, Floats], Floats]] = {
    "MIX": lambda t, a, b: a + t * (b - a),
    "ADD": lambda t, a, b: a + t * b,
    "SUBTRACT": lambda t, a, b: a - t * b,
    "MULTIPLY": lambda t, a, b: a * (1.0 - t + t * b),
    "DIVIDE": lambda t, a, b: np.where(b == 0.0, a, (1.0 - t) * a + t * divided(a, b)),
    "DIFFERENCE": lambda t, a, b: a + t * (np.abs(a - b) - a),
    "EXCLUSION": lambda t, a, b: np.maximum(a + t * (b - 2.0 * a * b), 0.0),
    "DARKEN": lambda t, a, b: a + t * (np.minimum(a, b) - a),
    "LIGHTEN": lambda t, a, b: a + t * (np.maximum(a, b) - a),
    "SCREEN": lambda t, a, b: 1.0 - (1.0 - t * b) * (1.0 - a),
    "OVERLAY": lambda t, a, b: np.where(
        a < 0.5, a * (1.0 - t + 2.0 * t * b), 1.0 - (1.0 - t + 2.0 * t * (1.0 - b)) * (1.0 - a)
    ),
    "LINEAR_LIGHT": lambda t, a, b: a + t * (2.0 * b - 1.0),
    "SOFT_LIGHT": lambda t, a, b: (
        (1.0 - t) * a + t * ((1.0 - a) * b * a + a * (1.0 - (1.0 - b) * (1.0 - a)))
    ),
}


@TEXTURES.register("ShaderNodeMix")
def _mix(call: Call) -> Floats:
    settings = call.settings
    kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}[settings["data_type"]]
    uneven = kind == "Vector" and settings["factor_mode"] == "NON_UNIFORM"
    t = call["Factor_Vector" if uneven else "Factor_Float"]
    t = clip(t) if settings["clamp_factor"] else t
    blend = BLENDS[settings["blend_type"] if kind == "Color" else "MIX"]
    found = blend(t, call[f"A_{kind}"], call[f"B_{kind}"])
    return clip(found) if kind == "Color" and settings["clamp_result"] else found


@TEXTURES.register("ShaderNodeMixRGB")
def _mix_rgb(call: Call) -> Floats:
    found = BLENDS[call.settings["blend_type"]](clip(call["Fac"]), call["Color1"], call["Color2"])
    return clip(found) if call.settings["use_clamp"] else found


def _looked_up(table: Floats, at: Floats, *, step: bool = False, beyond: bool = False) -> Floats:
    """Return a table (m,) over [0, 1] at places (n,), its last slopes `beyond` its ends."""
    last = len(table) - 1
    place = clip(at) * last
    if step:
        return table[place.astype(np.int64)]
    found = np.interp(place, np.arange(last + 1), table)
    if beyond:
        found += np.minimum(at, 0.0) * last * (table[1] - table[0])
        found += np.maximum(at - 1.0, 0.0) * last * (table[-1] - table[-2])
    return found


@TEXTURES.register("ShaderNodeValToRGB")
def _colour_ramp(call: Call) -> Floats:
    table, step = call.settings["table"], call.settings["step"]
    columns = (3,) if call.output == "Alpha" else (0, 1, 2)
    at = call["Fac"][:, 0]
    return np.stack([_looked_up(table[:, k], at, step=step) for k in columns], axis=1)


def _curved(call: Call, share: Floats, value: Floats) -> Floats:
    (low, high), table = call.settings["range"], call.settings["table"]
    at, beyond = (value - low) / (high - low), call.settings["beyond"]
    columns = [_looked_up(table[:, k], at[:, k], beyond=beyond) for k in range(table.shape[1])]
    return value + share * (np.stack(columns, axis=1) - value)


def _gamma(call: Call) -> Floats:
    colour, gamma = call["Color"], call["Gamma"]
    return np.where(gamma == 0.0, 1.0, np.where(colour > 0.0, np.abs(colour) ** gamma, colour))


def _bright_contrast(call: Call) -> Floats:
    contrast = call["Contrast"]
    return np.maximum((1.0 + contrast) * call["Color"] + call["Bright"] - 0.5 * contrast, 0.0)


def to_hsv(rgb: Floats) -> Floats:
    """Return hue, saturation and value of colours (n, 3)."""
    r, g, b = rgb.T
    high, span = rgb.max(axis=1), np.ptp(rgb, axis=1)
    sector = np.select(
        [r == high, g == high],
        [divided(g - b, span), 2.0 + divided(b - r, span)],
        4.0 + divided(r - g, span),
    )
    hue = np.where(span == 0.0, 0.0, np.mod(sector / 6.0, 1.0))
    return np.stack([hue, divided(span, high), high], axis=1)


def from_hsv(hsv: Floats) -> Floats:
    """Return the colours (n, 3) of hue, saturation and value."""
    h, s, v = (hsv[:, k : k + 1] for k in range(3))
    near = clip(np.abs(np.mod(h * 6.0 + np.array([0.0, 4.0, 2.0]), 6.0) - 3.0) - 1.0)
    return v * (1.0 + s * (near - 1.0))


def _hue_saturation(call: Call) -> Floats:
    rgb = call["Color"]
    h, s, v = (column[:, None] for column in to_hsv(rgb).T)
    parts = (h + call["Hue"] + 0.5, clip(s * call["Saturation"]), v * call["Value"])
    shifted = from_hsv(np.concatenate(np.broadcast_arrays(*parts), axis=1))
    return np.maximum(rgb + call["Fac"] * (shifted - rgb), 0.0)


def _component(call: Call) -> Floats:
    k = ("Red", "Green", "Blue").index(call.output)
    colour = call["Color"]
    return (to_hsv(colour) if call.settings["mode"] == "HSV" else colour)[:, k : k + 1]


def _combined(call: Call) -> Floats:
    colour = call.columns("Red", "Green", "Blue")
    return from_hsv(colour) if call.settings["mode"] == "HSV" else colour


def _grey(call: Call) -> Floats:
    return call["Color"] @ np.reshape(call.settings["weights"], (3, 1))


def _blackbody(call: Call) -> Floats:
    space = call.settings["chromaticities"]
    return np.array([blackbody_rgb(float(t), space) for t in call["Temperature"][:, 0]])


register(
    {
        "ShaderNodeRGBCurve": lambda call: _curved(call, call["Fac"], call["Color"]),
        "ShaderNodeVectorCurve": lambda call: _curved(call, call["Fac"], call["Vector"]),
        "ShaderNodeFloatCurve": lambda call: _curved(call, call["Factor"], call["Value"]),
        "ShaderNodeInvert": lambda call: call["Color"] + call["Fac"] * (1 - 2 * call["Color"]),
        "ShaderNodeGamma": _gamma,
        "ShaderNodeBrightContrast": _bright_contrast,
        "ShaderNodeHueSaturation": _hue_saturation,
        "ShaderNodeSeparateColor": _component,
        "ShaderNodeCombineColor": _combined,
        "ShaderNodeRGBToBW": _grey,
        "ShaderNodeBlackbody": _blackbody,
    }
)
