# SPDX-License-Identifier: GPL-3.0-or-later
"""Glass and Refraction BSDFs: what rough faces of clear matter reflect and let through.

Direct light is the light of emitters that lie straight behind one face; what is behind a second
face of a solid is in its shadow, as in Cycles at zero bounces.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ._base import BSDFS, Array, Frame, Inputs, Lobe, dot
from ._energy import compensation
from ._fresnel import Remapped, normal_reflectance
from ._microfacet import Microfacet, Refraction


def relative_index(inputs: Inputs) -> Array:
    """Return η (n,) of the far side of the face by the viewer's."""
    ior = np.maximum(inputs.number("IOR"), 1e-5)
    return ior if inputs.backfacing is None else np.where(inputs.backfacing, 1.0 / ior, ior)


@BSDFS.register("ShaderNodeBsdfGlass")
def glass(inputs: Inputs) -> Sequence[Lobe]:
    """Return the reflecting and the refracting lobe of a Glass BSDF."""
    kind, normal, ior = inputs.settings["distribution"], inputs.glossy(), relative_index(inputs)
    colour = np.maximum(inputs.colour("Color"), 0.0)
    alpha = np.clip(inputs.number("Roughness"), 0.0, 1.0) ** 2
    face = Remapped(ior, np.repeat(normal_reflectance(ior)[:, None], 3, axis=1))
    weight = inputs.weight * colour
    if kind == 'MULTI_GGX':
        factor, dark = compensation(dot(inputs.wo, normal), alpha, colour, ior)
        weight = weight * factor * dark
    frame = Frame.around(normal)
    shape = weight, frame, frame.local(inputs.wo), alpha, alpha, face, kind == 'BECKMANN'
    return [Microfacet(*shape), Refraction(*shape, ior=ior)]


@BSDFS.register("ShaderNodeBsdfRefraction")
def refraction(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Refraction BSDF, which loses nothing by reflection."""
    alpha = np.clip(inputs.number("Roughness") ** 2, 0.0, 1.0)
    frame, weight = Frame.around(inputs.glossy()), np.maximum(inputs.colour("Color"), 0.0)
    shape = inputs.weight * weight, frame, frame.local(inputs.wo), alpha, alpha, None
    beckmann = inputs.settings["distribution"] == 'BECKMANN'
    return [Refraction(*shape, beckmann, ior=relative_index(inputs))]
