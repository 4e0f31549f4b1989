# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's reflectance at smooth faces, and what Cycles makes of it.

cosθ is between the facet's normal and the viewer, on the side that the light comes from. Each kind
also tells its mean over the hemisphere, 2 ∫ F cosθ dcosθ, by the fit that Cycles uses for it: the
compensation of lost energy is worked out with that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ._base import Array

SMALL = 1e-9


class Fresnel(Protocol):
    """The reflectance of facets, at n points."""

    def reflectance(self, cosine: Array) -> Array:
        """Return F, (n, 1) or (n, 3), at cosθ (n,) in [0, 1]."""
        ...

    @property
    def mean(self) -> Array:
        """Return about 2 ∫ F cosθ dcosθ, (n, 1) or (n, 3)."""
        ...


def normal_reflectance(ior: Array) -> Array:
    """Return F at θ = 0 of relative indices of refraction: ((η − 1)/(η + 1))²."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def index_of(reflectance: Array) -> Array:
    """Return the η ≥ 1 that reflects this share at θ = 0; Cycles takes no more than 0.99."""
    root = np.sqrt(np.clip(reflectance, 0.0, 0.99))
    return (1.0 + root) / (1.0 - root)


@dataclass(frozen=True)
class Dielectric:
    """A face of clear matter, unpolarised, with g = η cosθ_t = √(η² − sin²θ), 0 beyond the edge.

    F = (((cosθ − g)/(cosθ + g))² + ((η² cosθ − g)/(η² cosθ + g))²) / 2.

    Attributes
    ----------
    ior : (n,) η of the far side by that of the viewer's.
    """

    ior: Array

    def reflectance(self, cosine: Array) -> Array:
        c, square = np.maximum(cosine, SMALL), self.ior**2
        g = np.sqrt(np.maximum(square - 1.0 + c * c, 0.0))
        across, along = (c - g) / (c + g), (square * c - g) / (square * c + g)
        return (0.5 * (across**2 + along**2))[:, None]

    @property
    def mean(self) -> Array:
        """Return the fits of Kulla and Conty, Revisiting Physically Based Shading (2017)."""
        n = self.ior
        inside = 0.997118 + n * (0.1014 - n * (0.965241 + n * 0.130607))
        return np.where(n < 1.0, inside, (n - 1.0) / (4.08567 + 1.00071 * n))[:, None]


@dataclass(frozen=True)
class Remapped:
    """A dielectric's curve, stretched to begin at f0 instead; it ends at 1.

    Attributes
    ----------
    ior : (n,) η of the curve.
    f0 : (n, 3) reflectance at θ = 0.
    """

    ior: Array
    f0: Array

    def _stretched(self, plain: Array) -> Array:
        start = normal_reflectance(self.ior)[:, None]
        return self.f0 + (1.0 - self.f0) * np.clip((plain - start) / (1.0 - start), 0.0, 1.0)

    def reflectance(self, cosine: Array) -> Array:
        return self._stretched(Dielectric(self.ior).reflectance(cosine))

    @property
    def mean(self) -> Array:
        return self._stretched(Dielectric(self.ior).mean)


@dataclass(frozen=True)
class EdgeTint:
    """Schlick's curve with a dip near 82°, F = f0 + (1 − f0)(1 − c)⁵ − dip · c (1 − c)⁶, c = cosθ.

    Kutz et al., Novel aspects of the Adobe Standard Material (2021).

    Attributes
    ----------
    f0 : (n, 3) reflectance at θ = 0.
    dip : (n, 3) strength of the dip.
    """

    f0: Array
    dip: Array

    @classmethod
    def through(cls, f0: Array, edge: Array) -> EdgeTint:
        """Return the curve with the reflectances f0 at θ = 0 and `edge` at cosθ = 1/7."""
        return cls(f0, (f0 + (1.0 - f0) * (6.0 / 7.0) ** 5 - edge) * 7.0 / (6.0 / 7.0) ** 6)

    @classmethod
    def tinted(cls, f0: Array, tint: Array) -> EdgeTint:
        """Return the curve that at cosθ = 1/7 is `tint` times Schlick's."""
        return cls.through(f0, tint * (f0 + (1.0 - f0) * (6.0 / 7.0) ** 5))

    def reflectance(self, cosine: Array) -> Array:
        c = np.clip(cosine, 0.0, 1.0)[:, None]
        fifth = (1.0 - c) ** 5
        value = self.f0 + (1.0 - self.f0) * fifth - self.dip * (c * (1.0 - c) * fifth)
        return np.clip(value, 0.0, 1.0)

    @property
    def mean(self) -> Array:
        """Return the integral if nothing is clipped: 2 B(2, 6) = 1/21 and 2 B(3, 7) = 1/126."""
        return self.f0 + (1.0 - self.f0) / 21.0 - self.dip / 126.0


@dataclass(frozen=True)
class Conductor:
    """A face of metal with the complex index η = n + ik, unpolarised.

    With q = √(η² − sin²θ): F = (|(cosθ − q)/(cosθ + q)|² + |(η² cosθ − q)/(η² cosθ + q)|²) / 2.
    Cycles before 5.0 takes the refracted light to go straight down, q = η.

    Attributes
    ----------
    index : (n, 3) complex η.
    exact : False for q = η.
    """

    index: NDArray[np.complex128]
    exact: bool = True

    def reflectance(self, cosine: Array) -> Array:
        c, square = np.maximum(cosine, SMALL)[:, None], self.index**2
        q = np.sqrt(square - (1.0 - c * c)) if self.exact else self.index
        across, along = (c - q) / (c + q), (square * c - q) / (square * c + q)
        return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)

    @property
    def mean(self) -> Array:
        """Return that of the edge tint's curve through the values at cosθ = 1 and 1/7."""
        ends = [self.reflectance(np.full(len(self.index), c)) for c in (1.0, 1.0 / 7.0)]
        return np.clip(EdgeTint.through(*ends).mean, 0.0, 1.0)
