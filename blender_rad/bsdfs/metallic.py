# SPDX-License-Identifier: GPL-3.0-or-later
"""Metallic BSDF: rough faces of metal, by a colour and the tint of its edge or by n and k."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ._base import BSDFS, Frame, Inputs, Lobe, dot
from ._energy import compensation
from ._fresnel import Conductor, EdgeTint, Fresnel
from ._microfacet import Microfacet, stretched, turned


@BSDFS.register("ShaderNodeBsdfMetallic")
def metallic(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Metallic BSDF."""
    alpha_x, alpha_y = stretched(inputs.number("Roughness"), inputs.number("Anisotropy"))
    normal, face, weight = inputs.glossy(), _face(inputs), inputs.weight
    tangent = inputs.tangent
    if tangent is not None:
        tangent = turned(tangent, inputs.normal, 2.0 * np.pi * inputs.number("Rotation"))
    if inputs.settings["distribution"] == 'MULTI_GGX':
        cosine, alpha = dot(inputs.wo, normal), np.sqrt(alpha_x * alpha_y)
        factor, dark = compensation(cosine, alpha, face.mean)
        weight = weight * factor * dark
    frame = Frame.around(normal, tangent)
    beckmann = inputs.settings["distribution"] == 'BECKMANN'
    return [Microfacet(weight, frame, frame.local(inputs.wo), alpha_x, alpha_y, face, beckmann)]


def _face(inputs: Inputs) -> Fresnel:
    if inputs.settings["fresnel_type"] == 'PHYSICAL_CONDUCTOR':
        n, k = (np.maximum(inputs.colour(name), 0.0) for name in ("IOR", "Extinction"))
        return Conductor((n + 1j * k).astype(np.complex128), exact=inputs.version >= (5, 0, 0))
    base, edge = (np.clip(inputs.colour(name), 0.0, 1.0) for name in ("Base Color", "Edge Tint"))
    return EdgeTint.tinted(base, edge)
