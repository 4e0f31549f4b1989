# SPDX-License-Identifier: GPL-3.0-or-later
"""Procedural patterns."""

from typing import Any

import numpy as np

from ..arrays import Floats
from . import TEXTURES, Call, clip, dot, smoothstep


@TEXTURES.register("ShaderNodeTexChecker")
def _checker(call: Call) -> Floats:
    cell = np.floor((call["Vector"] * call["Scale"] + 1e-6) * 0.999999)
    first = np.sum(cell, axis=1, keepdims=True) % 2.0 == 0.0
    if call.output == "Fac":
        return (~first).astype(float)
    return np.where(first, call["Color2"], call["Color1"])


@TEXTURES.register("ShaderNodeTexGradient")
def _gradient(call: Call) -> Floats:
    vector = call["Vector"]
    x, y = vector[:, :1], vector[:, 1:2]
    r = np.maximum(0.999999 - np.sqrt(dot(vector, vector)), 0.0)
    values: dict[str, Any] = {
        "LINEAR": x,
        "QUADRATIC": np.maximum(x, 0.0) ** 2,
        "EASING": smoothstep(x),
        "DIAGONAL": 0.5 * (x + y),
        "RADIAL": np.arctan2(y, x) / (2.0 * np.pi) + 0.5,
        "QUADRATIC_SPHERE": r * r,
        "SPHERICAL": r,
    }
    value = clip(values[call.settings["gradient_type"]])
    return value if call.output == "Fac" else np.tile(value, (1, 3))
