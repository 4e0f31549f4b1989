# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse BSDF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ._base import BSDFS, Frame, Inputs, Lobe
from ._diffuse import Diffuse


@BSDFS.register("ShaderNodeBsdfDiffuse")
def diffuse(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Diffuse BSDF."""
    colour = np.maximum(inputs.colour("Color"), 0.0)
    rough, tint = np.clip(inputs.number("Roughness"), 0.0, 1.0), np.minimum(colour, 1.0)
    frame = Frame.around(inputs.normal)
    return [Diffuse(inputs.weight * colour, frame, inputs.wo, rough, tint)]
