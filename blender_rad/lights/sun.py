# SPDX-License-Identifier: GPL-3.0-or-later
"""Sun light: a disc in the sky of half angle a, or a single direction.

=================== ======================= ====================================================
Blender property    unit                    meaning
=================== ======================= ====================================================
`energy`            W/m²                    irradiance E on a surface that faces it
`normalize` off     W/(m² sr)               `energy` is the radiance; with angle 0 still E in W/m²
`angle`             rad                     2a, the full angle, up to π
=================== ======================= ====================================================

Derivation. A uniform disc of half angle a has the projected solid angle π sin²a, so that
L = E/(π sin²a); its irradiance with the horizon is `cap_irradiance`. It stands where the light's
local +Z points; of the object's transform only that axis matters, and the sun emits nothing when
it has no length. The radiance is the same in both models: no length enters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, LightSample, Model
from ._emission import casts_shadow, stated_emission


@LIGHTS.register("SUN")
@dataclass(frozen=True, kw_only=True)
class SunLight(Light):
    """A disc of uniform radiance at infinity.

    Attributes
    ----------
    towards : (3,) unit vector towards its centre.
    half_angle : a in [0, π/2] [rad].
    """

    kind: ClassVar[str] = "SUN"
    towards: Array
    half_angle: float = 0.0

    @property
    def is_delta(self) -> bool:
        return self.half_angle == 0.0

    @property
    def _projected(self) -> float:
        """Projected solid angle π sin²a [sr], of a facing surface."""
        return float(np.pi * np.sin(self.half_angle) ** 2)

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        n = len(points)
        axis, far = np.broadcast_to(self.towards, (n, 3)), np.full(n, np.inf)
        if self.is_delta:
            return LightSample(axis.copy(), far, np.ones(n), np.full(n, np.inf))
        cone = 2.0 * np.sin(0.5 * self.half_angle) ** 2
        solid_angle = 2.0 * np.pi * cone
        wi = geometry.sample_cone(axis, np.full(n, cone), u)
        return LightSample(
            wi, far, np.full(n, solid_angle / self._projected), np.full(n, 1.0 / solid_angle)
        )

    def _density(self, points: Array, normals: Array, wi: Array, distance: Array) -> Array:
        if self.is_delta:
            return super()._density(points, normals, wi, distance)
        return np.full(len(points), 0.25 / (np.pi * np.sin(0.5 * self.half_angle) ** 2))

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        cos = geometry.dot(normals, self.towards)
        if self.is_delta:
            return np.maximum(cos, 0.0)
        sin_squared = np.full(len(cos), np.sin(self.half_angle) ** 2)
        return geometry.cap_irradiance(cos, sin_squared) / self._projected

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        far, dark = super().intersect(origins, directions)
        if self.is_delta:
            return far, dark
        chord = directions - self.towards
        seen = geometry.dot(chord, chord) <= 4.0 * np.sin(0.5 * self.half_angle) ** 2
        return far, np.where(seen, 1.0 / self._projected, 0.0)

    def radiant_flux(self) -> Array:
        return np.full(3, np.nan)

    def peak_radiance(self) -> Array:
        return np.full(3, np.nan) if self.is_delta else self.rgb / self._projected

    def facing_irradiance(self) -> Array:
        return self.rgb

    @classmethod
    def from_record(cls, record: LightRecord, model: Model) -> SunLight | None:
        rgb = stated_emission(record)
        z = np.array(record.world_from_light[:3, 2], dtype=np.float64)
        length = float(np.sqrt(z @ z))
        if not rgb.any() or length == 0.0:
            return None
        half_angle = min(0.5 * float(record.properties.get("angle", 0.0)), 0.5 * np.pi)
        if half_angle and not record.properties.get("normalize", True):
            rgb = rgb * (np.pi * np.sin(half_angle) ** 2)
        # Suns without Multiple Importance are met by no ray, not even the camera's:
        sampled = bool(record.properties.get("cycles.use_multiple_importance_sampling", True))
        return cls(
            name=record.name,
            rgb=rgb,
            cast_shadow=casts_shadow(record),
            visible_camera=record.visible_camera and sampled,
            towards=z / length,
            half_angle=float(half_angle),
        )

    @classmethod
    def examples(cls) -> list[Light]:
        rgb, towards = np.array([3.0, 2.0, 1.0]), np.array([0.48, -0.36, 0.8])
        angles = {"delta": 0.0, "sun": 0.0046, "wide": 0.5, "half-sky": 0.5 * np.pi}
        return [cls(name=n, rgb=rgb, towards=towards, half_angle=a) for n, a in angles.items()]
