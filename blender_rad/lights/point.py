# SPDX-License-Identifier: GPL-3.0-or-later
"""Point light: a point, a sphere, or Blender's "soft falloff" disc that faces every receiver.

=================== ======================= ====================================================
Blender property    unit                    meaning
=================== ======================= ====================================================
`energy`            W                       P, with `color`, `exposure`, temperature: per channel
`normalize`         on                      P is radiant power
`normalize`         off                     P is radiant exitance [W/m²], L = P/π; radius 0: I = P/π
`shadow_soft_size`  bu                      radius r; object scale does not act on it
`use_soft_falloff`  on                      a disc of radius r, perpendicular to the line from the
                                            shaded point to the centre
`use_soft_falloff`  off                     a sphere of radius r
=================== ======================= ====================================================

Derivation. A sphere of radiance L emits Φ = πL · 4πr², so L = Φ/(4π²r²), and I = Φ/4π. The disc
has the radiance of that sphere; it spans a cone of sin²a = r²/(d²+r²), the sphere one of r²/d².
Either is a cone of uniform radiance, whose irradiance `cap_irradiance` gives with its horizon:
E = Φ cos θ/(4π(d²+r²)) and Φ cos θ/(4πd²) where nothing is cut. Inside the sphere E = πL; the disc
knows no inside. Measured in Blender 4.5 and 5.2. An object scale of zero does not darken a point.

In the physical model a point with a radius is a sphere whatever `use_soft_falloff` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, LightSample, Model
from ._emission import casts_shadow, stated_emission
from ._geometry import Mask
from ._ies import ies_fields


@LIGHTS.register("POINT")
@dataclass(frozen=True, kw_only=True)
class PointLight(Light):
    """A point or a ball of uniform radiance.

    Attributes
    ----------
    position : (3,) centre [bu].
    radius : r ≥ 0 [bu].
    soft_falloff : the emitter is a disc facing the shaded point instead of a sphere.
    """

    kind: ClassVar[str] = "POINT"
    position: Array
    radius: float = 0.0
    soft_falloff: bool = False

    @property
    def is_delta(self) -> bool:
        return self.radius == 0.0

    @property
    def _radiance(self) -> float:
        """Radiance over `rgb` [1/(bu² sr)]; for radius 0 the intensity [1/sr]."""
        if self.radius == 0.0:
            return 1.0 / (4.0 * np.pi)
        return 1.0 / (4.0 * np.pi**2 * self.radius**2)

    def _falloff(self, directions: Array, inside: Mask) -> Array:
        """Return the factor (n,) on rays that arrive from `directions`; a spot has a cone."""
        return self._pattern(directions)

    def _cap(self, squared: Array) -> Array:
        """Return sin² (n,) of the half angle under which it is seen from a squared distance."""
        r2 = self.radius**2
        return r2 / (squared + r2) if self.soft_falloff else np.minimum(r2 / squared, 1.0)

    def _inside(self, squared: Array) -> Mask:
        """Return whether points at a squared distance are in the sphere, (n,)."""
        return squared < (0.0 if self.soft_falloff else self.radius**2)

    def _cone(self, axis: Array, squared: Array) -> tuple[Array, Array]:
        """Return the axes (n, 3) and 1 - cos(half angle) (n,) of the cones to sample."""
        return axis, geometry.one_minus_cos(self._cap(squared))

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        axis, squared = geometry.towards(self.position, points)
        inside = self._inside(squared)
        if self.is_delta:
            weight = self._radiance / squared * self._falloff(axis, inside)
            return LightSample(axis, np.sqrt(squared), weight, np.full(len(points), np.inf))
        middle, cone = self._cone(axis, squared)
        wi = geometry.sample_cone(middle, cone, u)
        pdf = 1.0 / (2.0 * np.pi * cone)
        if inside.any():
            wi[inside], cos = geometry.sample_hemisphere(normals[inside], u[inside])
            pdf[inside] = cos / np.pi
        distance, radiance = self._met(axis, squared, wi)
        return LightSample(wi, distance, radiance / pdf, pdf)

    def _density(self, points: Array, normals: Array, wi: Array, distance: Array) -> Array:
        if self.is_delta:
            return super()._density(points, normals, wi, distance)
        axis, squared = geometry.towards(self.position, points)
        pdf = 0.5 / (np.pi * self._cone(axis, squared)[1])
        over = np.maximum(geometry.dot(wi, normals), 0.0) / np.pi
        return np.where(self._inside(squared), over, pdf)

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        axis, squared = geometry.towards(self.position, points)
        cos = geometry.dot(axis, normals)
        inside = self._inside(squared)
        if self.is_delta:
            return self._radiance * np.maximum(cos, 0.0) / squared * self._falloff(axis, inside)
        if self.distribution is not None:
            return None
        result = geometry.cap_irradiance(cos, self._cap(squared))
        result[inside] = np.pi
        return self._radiance * result

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        if self.is_delta:
            return super().intersect(origins, directions)
        return self._met(*geometry.towards(self.position, origins), directions)

    def _met(self, axis: Array, squared: Array, directions: Array) -> tuple[Array, Array]:
        """Return `intersect` from where the centre lies along `axis` at a squared distance."""
        cos = geometry.dot(axis, directions)
        across = directions - cos[:, None] * axis
        sin2 = geometry.dot(across, across)
        inside = self._inside(squared)
        if self.soft_falloff:
            hit = (cos > 0.0) & (sin2 * squared <= self.radius**2 * cos * cos)
            distance = np.sqrt(squared) / np.where(hit, cos, 1.0)
        else:
            beyond = self.radius**2 - sin2 * squared
            hit = inside | ((cos > 0.0) & (beyond >= 0.0))
            root = np.sqrt(np.maximum(beyond, 0.0))
            distance = np.sqrt(squared) * cos + np.where(inside, root, -root)
        radiance = self._radiance * self._falloff(directions, inside)
        return np.where(hit, distance, np.inf), np.where(hit, radiance, 0.0)

    def radiant_flux(self) -> Array:
        if self.distribution is None:
            return self.rgb
        return self.rgb * self.distribution.flux_and_peak(self._intensity, *self._lit)[0]

    def peak_radiant_intensity(self) -> Array:
        if self.distribution is None:
            return self.rgb / (4.0 * np.pi)
        return self.rgb * self.distribution.flux_and_peak(self._intensity, *self._lit)[1]

    def peak_radiance(self) -> Array:
        if self.is_delta:
            return super().peak_radiance()
        return self.peak_radiant_intensity() / (np.pi * self.radius**2)

    @property
    def _lit(self) -> tuple[Array | None, float]:
        """The axis, if one is known, and 1 - cos(half angle) of the cone that is lit."""
        return None, 2.0

    def _intensity(self, leaving: Array) -> Array:
        """Return the intensity (n,) over `rgb` [1/sr] far away."""
        return self._falloff(-leaving, np.zeros(len(leaving), dtype=bool)) / (4.0 * np.pi)

    @classmethod
    def from_record(cls, record: LightRecord, model: Model) -> PointLight | None:
        common = common_fields(record, model)
        return None if common is None else cls(**common)

    @classmethod
    def examples(cls) -> list[Light]:
        white, place = np.array([3.0, 2.0, 1.0]), np.array([0.2, -0.1, 1.5])
        return [
            cls(name="point", rgb=white, position=place),
            cls(name="negative", rgb=-white, position=place),
            cls(name="sphere", rgb=white, position=place, radius=0.4),
            cls(name="soft", rgb=white, position=place, radius=0.4, soft_falloff=True),
        ]


def common_fields(record: LightRecord, model: Model) -> dict[str, Any] | None:
    """Return the fields that point and spot share, or None when nothing is emitted.

    Notes
    -----
    `normalize` off: radiance P/π is that of a power P·4πr² (a point: I = P/π, a power of 4P).
    Physical model: radiance and distances count real metres, so the power over bu² is P/s² with
    s metres a bu; a radiance that is stated as such needs no s, an intensity does.
    """
    properties = record.properties
    rgb = stated_emission(record)
    if not rgb.any():
        return None
    radius = float(properties.get("shadow_soft_size", 0.0))
    normalize = bool(properties.get("normalize", True))
    if not normalize:
        rgb = rgb * (4.0 * np.pi * radius**2 if radius else 4.0)
    if model == "physical" and (normalize or not radius):
        rgb = rgb / record.unit_scale_m**2
    return {
        "name": record.name,
        "rgb": rgb,
        "cast_shadow": casts_shadow(record),
        "visible_camera": record.visible_camera,
        "position": np.array(record.world_from_light[:3, 3], dtype=np.float64),
        "radius": radius,
        "soft_falloff": bool(properties.get("use_soft_falloff", True)) and model == "cycles",
        **ies_fields(record, model),
    }
