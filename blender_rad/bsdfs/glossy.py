# SPDX-License-Identifier: GPL-3.0-or-later
"""Glossy BSDF: rough faces that reflect all, or the lobe of Ashikhmin and Shirley."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._base import BSDFS, Array, Frame, Inputs, Lobe, dot
from ._energy import compensation
from ._microfacet import SPIKE, WIDTH, Microfacet, turned, unit


@BSDFS.register("ShaderNodeBsdfAnisotropic")
def glossy(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Glossy BSDF; without a tangent it is round."""
    normal, tangent, kind = inputs.glossy(), inputs.tangent, inputs.settings["distribution"]
    colour = np.maximum(inputs.colour("Color"), 0.0)
    alpha = np.clip(inputs.number("Roughness"), 0.0, 1.0) ** 2
    aspect = np.ones(len(alpha))
    if tangent is not None:
        tangent = turned(tangent, normal, 2.0 * np.pi * inputs.number("Rotation"))
        bend = np.clip(inputs.number("Anisotropy"), -0.99, 0.99)
        aspect = np.where(bend < 0.0, 1.0 / (1.0 + bend), 1.0 - bend)
        aspect = np.where(np.abs(bend) <= 1e-4, 1.0, aspect)
    alpha_x, alpha_y = np.minimum(alpha * aspect, 1.0), np.minimum(alpha / aspect, 1.0)
    weight = inputs.weight * colour
    if kind == 'MULTI_GGX':
        cosine, round_ = dot(inputs.wo, normal), np.sqrt(alpha_x * alpha_y)
        factor, dark = compensation(cosine, round_, colour)
        weight = weight * factor * dark
    frame = Frame.around(normal, tangent)
    shape = weight, frame, frame.local(inputs.wo), alpha_x, alpha_y
    if kind == 'ASHIKHMIN_SHIRLEY':
        return [AshikhminShirley(*shape)]
    return [Microfacet(*shape, beckmann=kind == 'BECKMANN')]


@dataclass(frozen=True)
class AshikhminShirley(Lobe):
    """Ashikhmin and Shirley's stretched Phong lobe (2000), without its Fresnel factor.

    With h half-way between o and i, e_x = 2/α_x² − 2 and e = (e_x h_x² + e_y h_y²)/(1 − h_z²):

        density  p = √((e_x + 1)(e_y + 1))/(8π) h_zᵉ / (o·h)
        f cosθ_i = p cosθ_i/max(cosθ_o, cosθ_i)

    of which h is sampled by azimuth, tan φ = √((e_x + 1)/(e_y + 1)) tan 2πu, and then by
    h_z = (1 − v)^(1/(e + 1)). Cycles takes α of 1e-4 and less as sharp.

    Attributes
    ----------
    As of `Microfacet`.
    """

    weight: Array
    frame: Frame
    wo: Array
    alpha_x: Array
    alpha_y: Array

    def _exponents(self) -> tuple[Array, Array]:
        x, y = (2.0 / np.maximum(a, 1e-4) ** 2 - 2.0 for a in (self.alpha_x, self.alpha_y))
        return x, y

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        wi, wo, (x, y) = self.frame.local(wi), self.wo, self._exponents()
        h = unit(wi + wo)
        flat = h[:, 0] ** 2 + h[:, 1] ** 2
        power = (x * h[:, 0] ** 2 + y * h[:, 1] ** 2) / np.maximum(flat, 1e-30)
        lobe = np.exp(0.5 * power * np.log1p(-np.minimum(flat, 1.0 - 1e-15)))
        scale = np.sqrt((x + 1.0) * (y + 1.0)) / (8.0 * np.pi)
        density = scale * lobe / np.maximum(dot(h, wo), 1e-6)
        sharp = np.maximum(self.alpha_x, self.alpha_y) <= 1e-4
        mirrored = np.all(np.abs(wi - wo * [-1.0, -1.0, 1.0]) < WIDTH, axis=1)
        density = np.where(sharp, SPIKE * mirrored, density)
        density *= (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        steep = np.maximum(wi[:, 2], wo[:, 2])
        share = np.where(sharp, 1.0, wi[:, 2] / np.where(steep > 0.0, steep, 1.0))
        return (density * share)[:, None], density

    def sample(self, u: Array) -> Array:
        x, y = self._exponents()
        turn = 2.0 * np.pi * u[:, 0]
        turn = np.arctan2(np.sqrt(x + 1.0) * np.sin(turn), np.sqrt(y + 1.0) * np.cos(turn))
        along, across = np.cos(turn), np.sin(turn)
        up = np.exp(np.log1p(-u[:, 1]) / (x * along**2 + y * across**2 + 1.0))
        up = np.where(np.maximum(self.alpha_x, self.alpha_y) <= 1e-4, 1.0, up)
        flat = np.sqrt(1.0 - up * up)
        h = np.empty((len(u), 3), order="F")
        h[:, 0], h[:, 1], h[:, 2] = flat * along, flat * across, up
        wi = 2.0 * dot(self.wo, h)[:, None] * h - self.wo
        return self.frame.world(wi * ((wi[:, 2:] > 0.0) & (self.wo[:, 2:] > 0.0)))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[AshikhminShirley]:
        n = len(wo)
        white, local = np.ones((n, 3)), frame.local(wo)
        pairs = [(0.1, 0.1), (0.4, 0.4), (0.7, 0.2)]
        return [cls(white, frame, local, np.full(n, x), np.full(n, y)) for x, y in pairs]
