# SPDX-License-Identifier: GPL-3.0-or-later
"""World: a uniform sky over and under everything.

=================== ======================= ====================================================
parameter           unit                    meaning
=================== ======================= ====================================================
`rgb`               W/(m² sr)               radiance L = strength × colour of the background
=================== ======================= ====================================================

Derivation. E = L ∫ cos θ dω over the hemisphere = πL, whatever the normal; sampled with the
density cos θ/π every sample has the same weight. The radiance is the same in both models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightSample


@LIGHTS.register("WORLD")
@dataclass(frozen=True, kw_only=True)
class WorldLight(Light):
    """A uniform background."""

    kind: ClassVar[str] = "WORLD"

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        wi, cos = geometry.sample_hemisphere(normals, u)
        pdf = cos / np.pi
        return LightSample(wi, np.full(len(points), np.inf), 1.0 / pdf, pdf)

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        return np.full(len(points), np.pi)

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        n = len(origins)
        return np.full(n, np.inf), np.ones(n)

    def radiant_flux(self) -> Array:
        return np.full(3, np.nan)

    def peak_radiance(self) -> Array:
        return self.rgb

    def facing_irradiance(self) -> Array:
        return self.rgb * np.pi

    @classmethod
    def examples(cls) -> list[Light]:
        return [cls(name="World", rgb=np.array([0.3, 0.4, 0.5]))]
