# SPDX-License-Identifier: GPL-3.0-or-later
"""Rough faces: GGX and Beckmann, reflecting and refracting, isotropic or stretched.

With o and i the unit directions to the viewer and to the light, m the facets' normal, D its
distribution, G = 1/(1 + Λ(o) + Λ(i)) Smith's height-correlated masking and shadowing, F the facets'
Fresnel reflectance at o·m, and η the far side's index of refraction over that of the viewer's side:

    reflected     f |cosθ_i| = F D G / (4 cosθ_o),                              m = (o + i)/|o + i|
    refracted     f |cosθ_i| = (1 − F) D G η² |o·m i·m| / (cosθ_o |o + η i|²),  m ∥ o + η i

(Walter et al., Microfacet Models for Refraction, 2007; Heitz, Understanding the Masking-Shadowing
Function, 2014). θ and φ are polar angle and azimuth, of m in D and of o or i in Λ. With
t = tan²θ (cos²φ/α_x² + sin²φ/α_y²) and α² = α_x² cos²φ + α_y² sin²φ, GGX has
D = 1/(π α_x α_y cos⁴θ (1 + t)²) and Λ = (√(1 + α² tan²θ) − 1)/2; Beckmann has
D = exp(−t)/(π α_x α_y cos⁴θ) and Walter's rational fit of Λ, as in Cycles.

Both are sampled by the visible normals of GGX: Beckmann's D is at most 4/e of GGX's, so that no
inverse of erf is needed. A face with α_x α_y ≤ 2e-10 is a mirror, as in Cycles: its lobe is a
spike, which samples of the BSDF hit and samples of lights never do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ._base import Array, Frame, Lobe, dot
from ._fresnel import Dielectric, EdgeTint, Fresnel

SHARP = 2e-10  # greatest α_x α_y of a mirror
SPIKE, WIDTH = 1e12, 1e-9  # density [1/sr] of its spike, and how far a direction may be beside it


def slopes(vectors: Array, alpha_x: Array, alpha_y: Array) -> Array:
    """Return α² tan²θ (n,) of local vectors (n, 3), with the α at their azimuth."""
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

    Facets are stretched to those of a hemisphere. There the visible normals lie halfway between o
    and directions uniform in a spherical cap (Dupuy and Benyoub, Sampling Visible GGX Normals with
    Spherical Caps, 2023).
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
    """Reflection by rough faces; without a Fresnel factor the facets reflect all light.

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
        """Return m (n, 3) for o and i, and |o·m| dω_m/dω_i (n,), 0 where no facet does it."""
        m = unit(self.wo + wi)
        return m, np.where(wi[:, 2] > 0.0, 0.25, 0.0)

    def _leaving(self, m: Array) -> Array:
        """Return i (n, 3) for facets m (n, 3), 0 where it lies on the wrong side."""
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
    """Refraction by rough faces of what they do not reflect; of all light without a Fresnel factor.

    As in Cycles, radiance is not scaled by η² when it enters a medium. So f is not reciprocal: it
    is η² times the f with i and o exchanged, seen from the other side.

    Attributes
    ----------
    ior : (n,) η, the far side's index over that of the viewer's side.
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
    """Refraction as Cycles evaluates it, which counts facets that o and i cannot both see.

    For samples of lights Cycles checks only that there is no total reflection, and not that m faces
    o on one side and i on the other. At roughness 1 and grazing angles that adds half as much light
    again. Cycles' density includes these directions, although its BSDF samples never take them;
    multiple importance sampling therefore loses some of that light, most under a wide world, just
    as it does in Cycles.
    """

    conserves: ClassVar[bool] = False

    def _counts(self, out: Array, back: Array) -> NDArray[np.bool_]:
        return self.ior**2 - 1.0 + out * out > 0.0

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Refraction]:
        return []  # its samples do not follow its density
