# SPDX-License-Identifier: GPL-3.0-or-later
"""Rough faces: GGX and Beckmann, reflecting and refracting, isotropic or stretched.

With m the facets' normal, D its distribution, G = 1/(1 + Λ(o) + Λ(i)) the height-correlated masking
of Smith, F the facets' Fresnel factor and η the index of the far side by that of the viewer's:

    reflected     f |cosθ_i| = F D G / (4 cosθ_o),                          m = (o + i)/|o + i|
    refracted     f |cosθ_i| = F D G η² |o·m i·m| / (cosθ_o |o + η i|²),    m ∥ o + η i

(Walter et al., Microfacet Models for Refraction, 2007; Heitz, Understanding the Masking-Shadowing
Function, 2014). With t = tan²θ/α² in the direction at hand, GGX has D = 1/(π α_x α_y cos⁴θ
(1 + t)²) and Λ = (√(1 + α² tan²θ) − 1)/2; Beckmann D = exp(−t)/(π α_x α_y cos⁴θ) and Walter's
rational fit of Λ, which is Cycles' too.

Both are sampled by the visible normals of GGX: Beckmann's D is at most 4/e of GGX's, so that no
inverse of erf is needed. A face with α_x α_y ≤ 2e-10 is sharp, as in Cycles: a spike that sampling
finds and the light of points does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ._base import Array, Frame, Lobe, dot
from ._fresnel import Dielectric, EdgeTint, Fresnel

SHARP = 2e-10
SPIKE, WIDTH = 1e12, 1e-9


def slopes(vectors: Array, alpha_x: Array, alpha_y: Array) -> Array:
    """Return α² tan²θ (n,) of local vectors (n, 3), the α of their own azimuth."""
    flat = (alpha_x * vectors[..., 0]) ** 2 + (alpha_y * vectors[..., 1]) ** 2
    return flat / np.maximum(vectors[..., 2] ** 2, 1e-30)


def ggx_masking(slope: Array) -> Array:
    """Return Λ of GGX at α² tan²θ."""
    return 0.5 * (np.sqrt(1.0 + slope) - 1.0)


def beckmann_masking(slope: Array) -> Array:
    """Return the fit of Λ of Beckmann at α² tan²θ; 0 below 0.39, as Cycles has it."""
    a = 1.0 / np.sqrt(np.maximum(slope, 0.39))
    fit = (1.0 - 1.259 * a + 0.396 * a**2) / (3.535 * a + 2.181 * a**2)
    return np.where(slope < 0.39, 0.0, fit)


def visible_normals(u: Array, wo: Array, alpha_x: Array, alpha_y: Array) -> Array:
    """Return normals (..., 3) of GGX with the density D max(o·m, 0) / (cosθ_o (1 + Λ(o))).

    Facets are stretched to a sphere's, where the visible ones are halfway between o and a cap of
    even density (Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, 2023).
    """
    stretch = np.stack([alpha_x, alpha_y, np.ones_like(alpha_x)], axis=-1)
    seen = unit(wo * stretch)
    height = (1.0 - u[..., 0]) * (1.0 + seen[..., 2]) - seen[..., 2]
    turn, radius = 2.0 * np.pi * u[..., 1], np.sqrt(np.maximum(1.0 - height**2, 0.0))
    cap = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=-1)
    return unit((cap + seen) * stretch)


def unit(vectors: Array) -> Array:
    """Return vectors (..., 3) of length 1; 0 stays."""
    return vectors / np.maximum(np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True)), 1e-150)


def turned(vectors: Array, axis: Array, angle: Array) -> Array:
    """Return vectors (n, 3) turned around unit axes (n, 3) by angles (n,)."""
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    rest = (1.0 - cosine) * dot(vectors, axis)[:, None]
    return cosine * vectors + sine * np.cross(axis, vectors) + rest * axis


def stretched(roughness: Array, anisotropy: Array) -> tuple[Array, Array]:
    """Return α_x and α_y (n,) of the Roughness and Anisotropy of Metallic and Principled BSDFs."""
    aspect = np.sqrt(1.0 - 0.9 * np.clip(anisotropy, 0.0, 1.0))
    alpha = np.clip(roughness, 0.0, 1.0) ** 2
    return np.minimum(alpha / aspect, 1.0), alpha * aspect


@dataclass(frozen=True)
class Microfacet(Lobe):
    """Reflection by rough faces; without a Fresnel factor all of it is reflected.

    Attributes
    ----------
    weight : (n, 3).
    frame : x along the tangent, z along the normal on the viewer's side.
    wo : (n, 3) towards the viewer, in the frame.
    alpha_x, alpha_y : (n,) in [0, 1], the roughness squared.
    fresnel : of the facets, or None for 1.
    beckmann : Beckmann's distribution instead of GGX.
    """

    weight: Array
    frame: Frame
    wo: Array
    alpha_x: Array
    alpha_y: Array
    fresnel: Fresnel | None = None
    beckmann: bool = False

    def _sharp(self) -> NDArray[np.bool_]:
        return self.alpha_x * self.alpha_y <= SHARP

    def _facets(self, wi: Array) -> tuple[Array, Array]:
        """Return m (n, 3) of a pair, and dω_m/dω_i |o·m|, 0 where there is none such."""
        m = unit(self.wo + wi)
        return m, np.where(wi[:, 2] > 0.0, 0.25, 0.0)

    def _leaving(self, m: Array) -> Array:
        """Return ω_i of facets, 0 where it leaves the lobe's side."""
        wi = 2.0 * dot(self.wo, m)[:, None] * m - self.wo
        return wi * (wi[:, 2:] > 0.0)

    def _passed(self, cosine: Array) -> Array:
        """Return the share of the light that facets send this way, at o·m."""
        return np.ones((1, 1)) if self.fresnel is None else self.fresnel.reflectance(cosine)

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        wi, wo = self.frame.local(wi), self.wo
        m, spread = self._facets(wi)
        ax, ay = np.maximum(self.alpha_x, 1e-6), np.maximum(self.alpha_y, 1e-6)
        flat, up = (m[:, 0] / ax) ** 2 + (m[:, 1] / ay) ** 2, np.maximum(m[:, 2] ** 2, 1e-30)
        spread = np.where(wo[:, 2] > 0.0, spread / np.maximum(wo[:, 2], 1e-30), 0.0) / (ax * ay)
        ggx = spread / (np.pi * (flat + up) ** 2)
        out, back = slopes(wo, ax, ay), slopes(wi, ax, ay)
        density = ggx / (1.0 + ggx_masking(out))
        if self.beckmann:
            spread *= np.exp(-flat / up) / (np.pi * up**2)
            value = spread / (1.0 + beckmann_masking(out) + beckmann_masking(back))
        else:
            value = ggx / (1.0 + ggx_masking(out) + ggx_masking(back))
        sharp = self._sharp()
        if sharp.any():
            found = np.all(np.abs(wi - self._leaving(self._level())) < WIDTH, axis=1)
            spike = np.where(found & (wi[:, 2] != 0.0) & (wo[:, 2] > 0.0), SPIKE, 0.0)
            value, density = np.where(sharp, spike, value), np.where(sharp, spike, density)
        return self._passed(np.abs(dot(wo, m))) * value[:, None], density

    def _level(self) -> Array:
        return np.broadcast_to(np.array([0.0, 0.0, 1.0]), self.wo.shape)

    def sample(self, u: Array) -> Array:
        m = visible_normals(u, self.wo, self.alpha_x, self.alpha_y)
        m = np.where(self._sharp()[:, None], self._level(), m)
        return self.frame.world(self._leaving(m) * (self.wo[:, 2:] > 0.0))

    def albedo(self) -> Array:
        return self._passed(np.maximum(self.wo[:, 2], 0.0))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Microfacet]:
        n = len(wo)
        white, local = np.ones((n, 3)), frame.local(wo)
        metal = EdgeTint.tinted(0.6 * white, 0.8 * white)

        def lobe(x: float, y: float, beckmann: bool = False) -> Microfacet:
            return cls(white, frame, local, np.full(n, x), np.full(n, y), metal, beckmann)

        return [lobe(0.1, 0.1), lobe(0.8, 0.2), lobe(0.3, 0.3, True), lobe(0.2, 0.6, True)]


@dataclass(frozen=True)
class VisibleRefraction(Microfacet):
    """Refraction by rough faces of what the Fresnel factor does not reflect; all of it without.

    Radiance is not compressed, as in Cycles, so that f(i, o) = η² f(o, i) seen from either side.

    Attributes
    ----------
    ior : (n,) η of the far side by that of the viewer's.
    """

    reciprocal: ClassVar[bool] = False
    transmits: ClassVar[bool] = True
    ray: ClassVar[str] = "transmission"
    ior: Array = field(kw_only=True)

    def _sharp(self) -> NDArray[np.bool_]:
        return super()._sharp() | (np.abs(self.ior - 1.0) < 1e-4)

    def _facets(self, wi: Array) -> tuple[Array, Array]:
        half = self.wo + self.ior[:, None] * wi
        m = unit(half) * np.where(half[:, 2:] < 0.0, -1.0, 1.0)
        out, back = dot(self.wo, m), dot(wi, m)
        area = self.ior**2 * np.abs(out * back) / np.maximum(dot(half, half), 1e-30)
        return m, np.where((wi[:, 2] < 0.0) & self._counts(out, back), area, 0.0)

    def _counts(self, out: Array, back: Array) -> NDArray[np.bool_]:
        """Return whether facets refract, by o·m and i·m."""
        return (out > 0.0) & (back < 0.0)

    def _leaving(self, m: Array) -> Array:
        cosine, share = dot(self.wo, m), 1.0 / self.ior
        square = 1.0 - share**2 * (1.0 - cosine**2)
        along = share * cosine - np.sqrt(np.maximum(square, 0.0))
        wi = along[:, None] * m - share[:, None] * self.wo
        return wi * ((wi[:, 2:] < 0.0) & (square[:, None] > 0.0))

    def _passed(self, cosine: Array) -> Array:
        return 1.0 - super()._passed(cosine) if self.fresnel else np.ones((1, 1))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[VisibleRefraction]:
        n = len(wo)
        white, local = np.ones((n, 3)), frame.local(wo)

        def lobe(alpha: float, ior: float, beckmann: bool = False) -> VisibleRefraction:
            eta, rough = np.full(n, ior), np.full(n, alpha)
            return cls(white, frame, local, rough, rough, Dielectric(eta), beckmann, ior=eta)

        return [lobe(0.2, 1.5), lobe(0.5, 1 / 1.5), lobe(0.3, 1.33, True)]


@dataclass(frozen=True)
class Refraction(VisibleRefraction):
    """Refraction as Cycles evaluates it, also by facets that neither side could see.

    Of light that it samples Cycles does not ask that m faces both ways, short of total reflection:
    at roughness 1 and grazing angles that makes half as much energy again. Its density says so too,
    though its directions never go there; multiple importance sampling then loses of that light, in
    wide worlds most, what Cycles loses.
    """

    conserves: ClassVar[bool] = False

    def _counts(self, out: Array, back: Array) -> NDArray[np.bool_]:
        return self.ior**2 - 1.0 + out * out > 0.0

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Refraction]:
        return []  # its density is not that of its samples
