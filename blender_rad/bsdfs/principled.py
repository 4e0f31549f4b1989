# SPDX-License-Identifier: GPL-3.0-or-later
"""Principled BSDF: layers, of which each takes from those below what it sends to the viewer.

From the top: sheen, coat, a share of metal, a share of glass, gloss, and a diffuse base. A layer
of weight w and albedo a (by channel) leaves the weight w max(0, 1 − max a) to those below, the
same in all channels. The albedos of coat and gloss are Cycles' estimates, which leave out light
that is reflected more than once between facets. A coat lets tint^(1/cosθ_t) of the light pass:
θ_t is the angle of the refracted ray, which goes 1/cosθ_t thicknesses through the coat. All of
these depend on ω_o alone, so that what is below a layer is not reciprocal.

Subsurface scattering, thin films and thin walls are not here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ._base import BSDFS, Array, Frame, Inputs, Lobe, dot
from ._diffuse import Diffuse
from ._energy import compensation, layer_reflectance
from ._fresnel import EdgeTint, Fresnel, Remapped, index_of, normal_reflectance
from ._microfacet import Microfacet, Refraction, stretched, turned, unit
from ._sheen import Sheen
from .glass import relative_index

NEGLIGIBLE = 1e-5  # weights up to here count as 0 in Cycles
Layer = tuple[list[Lobe], Array]  # its lobes, and the weight (n, 3) that it leaves below


@BSDFS.register("ShaderNodeBsdfPrincipled")
def principled(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobes of a Principled BSDF; what passes by its alpha is not among them."""
    lobes, weight = _covers(inputs)
    for part in (_metal, _glass, _gloss):
        found, weight = part(inputs, weight)
        lobes += found
    colour = _tone(inputs, "Base Color")
    rough = np.clip(inputs.number("Diffuse Roughness"), 0.0, 1.0)
    frame, tint = Frame.around(inputs.normal), np.minimum(colour, 1.0)
    lobes.append(Diffuse(weight * colour, frame, inputs.wo, rough, tint))
    return lobes


def emitted(inputs: Inputs) -> Array:
    """Return the share (n, 3) of a Principled BSDF's emission that passes its sheen and coat."""
    return _covers(inputs)[1]


def _covers(inputs: Inputs) -> Layer:
    """Return sheen and coat."""
    weight = inputs.weight * np.clip(inputs.number("Alpha", 1.0), 0.0, 1.0)[:, None]
    lobes: list[Lobe] = []
    sheen, coat = _share(inputs, "Sheen Weight", np.inf), _share(inputs, "Coat Weight", np.inf)
    if not sheen.any() and not coat.any():
        return lobes, weight
    normal = unit(inputs.colour("Coat Normal"))
    if sheen.any():
        tilted = unit(inputs.normal + (normal - inputs.normal) * np.minimum(coat, 1.0))
        own = sheen * _tone(inputs, "Sheen Tint")
        fibres = Sheen.of(own * weight, tilted, inputs.wo, inputs.number("Sheen Roughness"))
        weight = _under(weight, own * fibres.albedo())
        lobes.append(fibres)
    if coat.any():
        ior = np.maximum(inputs.number("Coat IOR"), 1.0)
        alpha = np.clip(inputs.number("Coat Roughness"), 0.0, 1.0) ** 2
        faces = _Facets(inputs.glossy(normal), inputs.wo, alpha, alpha)
        face = Remapped(ior, normal_reflectance(ior)[:, None])
        lobe, taken = faces.reflecting(coat * weight, face)
        cosine = np.sqrt(1.0 - (1.0 - faces.cosine**2) / ior**2)
        way = 1.0 / np.maximum(cosine, 0.01)[:, None]  # limited, so that tints above 1 stay finite
        absorbed = coat * (1.0 - _tone(inputs, "Coat Tint") ** way)
        weight = _under(weight, coat * taken) * np.maximum(1.0 - absorbed, 0.0)
        lobes.append(lobe)
    return lobes, weight


def _metal(inputs: Inputs, weight: Array) -> Layer:
    share = _share(inputs, "Metallic")
    if not share.any():
        return [], weight
    tint = _tone(inputs, "Specular Tint", 1.0)
    face = EdgeTint.tinted(_tone(inputs, "Base Color", 1.0), tint)
    lobe, _ = _Facets.of(inputs).reflecting(share * weight, face, _multiple(inputs))
    return [lobe], weight * (1.0 - share)


def _glass(inputs: Inputs, weight: Array) -> Layer:
    share = _share(inputs, "Transmission Weight")
    if not share.any():
        return [], weight
    alpha = np.clip(inputs.number("Roughness"), 0.0, 1.0) ** 2
    normal, colour = inputs.glossy(), np.sqrt(_tone(inputs, "Base Color", 1.0))
    ior, own = relative_index(inputs), share * weight
    f0 = normal_reflectance(ior)[:, None] * _tone(inputs, "Specular Tint")
    face = Remapped(ior, np.minimum(f0, 1.0))
    if _multiple(inputs):
        mean = np.where(colour.any(axis=1, keepdims=True), colour, face.mean)
        factor, dark = compensation(dot(normal, inputs.wo), alpha, mean, ior)
        own = own * factor * dark
    frame = Frame.around(normal)
    shape = frame, frame.local(inputs.wo), alpha, alpha, face
    through = Refraction(own * colour, *shape, ior=ior)
    return [Microfacet(own, *shape), through], weight * (1.0 - share)


def _gloss(inputs: Inputs, weight: Array) -> Layer:
    """Return the dielectric's reflection, its index changed to reflect 2 × Specular IOR Level."""
    ior = np.maximum(inputs.number("IOR"), 1e-5)
    level = np.maximum(inputs.number("Specular IOR Level", 0.5), 0.0)
    f0 = normal_reflectance(ior) * 2.0 * level
    other = index_of(f0) ** np.where(ior < 1.0, -1.0, 1.0)
    face = Remapped(
        np.where(level == 0.5, ior, other),
        np.minimum(f0[:, None] * _tone(inputs, "Specular Tint"), 1.0),
    )
    lobe, taken = _Facets.of(inputs).reflecting(weight, face, _multiple(inputs))
    return [lobe], _under(weight, taken)


class _Facets(NamedTuple):
    """Where a layer's facets lie, and how rough they are."""

    normal: Array
    wo: Array
    alpha_x: Array
    alpha_y: Array
    tangent: Array | None = None

    @classmethod
    def of(cls, inputs: Inputs) -> _Facets:
        """Return those of metal and gloss."""
        tangent = inputs.tangent
        if tangent is not None:
            angle = 2.0 * np.pi * inputs.number("Anisotropic Rotation")
            tangent = turned(tangent, inputs.normal, angle)
        alpha = stretched(inputs.number("Roughness"), inputs.number("Anisotropic"))
        return cls(inputs.glossy(), inputs.wo, *alpha, tangent)

    @property
    def cosine(self) -> Array:
        return dot(self.normal, self.wo)

    def reflecting(self, weight: Array, face: Fresnel, multiple: bool = True) -> tuple[Lobe, Array]:
        """Return a lobe, and the share (n, 3) that a dielectric one takes from what is below."""
        rough = np.sqrt(self.alpha_x * self.alpha_y)
        taken = np.zeros((1, 1))
        if isinstance(face, Remapped):
            taken = layer_reflectance(self.cosine, rough, face.ior, face.f0)
        if multiple:
            factor, dark = compensation(self.cosine, rough, face.mean)
            weight, taken = weight * factor * dark, taken * dark
        frame = Frame.around(self.normal, self.tangent)
        local = frame.local(self.wo)
        return Microfacet(weight, frame, local, self.alpha_x, self.alpha_y, face), taken


def _share(inputs: Inputs, name: str, most: float = 1.0) -> Array:
    """Return a weight (n, 1) in [0, most]."""
    value = np.clip(inputs.number(name), 0.0, most)
    return np.where(value > NEGLIGIBLE, value, 0.0)[:, None]


def _tone(inputs: Inputs, name: str, most: float = np.inf) -> Array:
    return np.clip(inputs.colour(name), 0.0, most)


def _under(weight: Array, taken: Array) -> Array:
    """Return what a layer that takes the share `taken` (n, 3) leaves of the weight."""
    most = np.max(taken * (weight > 0.0), axis=1, keepdims=True)
    return weight * np.clip(1.0 - most, 0.0, 1.0)


def _multiple(inputs: Inputs) -> bool:
    return inputs.settings.get("distribution") == "MULTI_GGX"
