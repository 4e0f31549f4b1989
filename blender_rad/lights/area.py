# SPDX-License-Identifier: GPL-3.0-or-later
"""Area light: a rectangle or ellipse that shines from one face, along its local -Z.

=================== ======================= ====================================================
Blender property    unit                    meaning
=================== ======================= ====================================================
`energy`            W                       P, with `color`, `exposure`, temperature: per channel
`normalize`         on                      P is radiant power, L = P/(πA)
`normalize`         off                     P is radiant exitance [W/m²], L = P/π
`shape`                                     SQUARE, RECTANGLE, DISK (`size` its diameter), ELLIPSE
`size`, `size_y`    bu                      extents along x and y, times the object's scale
`spread`            rad                     s, full angle of the beam; π is Lambertian
`cycles.is_portal`                          a guide for sampling the world, emits nothing
=================== ======================= ====================================================

Derivation. A Lambertian emitter has Φ = πLA. A spread of half angle h = s/2 multiplies the radiance
by (tan h - tan θ)/D for angles θ < h from the axis, as a grid of slats would, and by 0 beyond. The
flux then is LA/D times 2π∫(tan h - tan θ) sin θ cos θ dθ = π(tan h - h), so that D = tan h - h
keeps it at P. Up to h = 0.05 Cycles takes D = h³/3, the first term of the series of tan h - h, and
the flux is a little more than P (0.1 % at 0.05): the `cycles` model follows, the `physical` model
keeps tan h - h. With s = 0 the beam is parallel: E = (P/A) cos θ within the outline. Irradiance
without spread is Lambert's polygon, or the confocal ellipsoid of `ellipse_irradiance`.

Rectangles are sampled uniformly in solid angle (Ureña, Fajardo and King 2013, "An
area-preserving parametrization for spherical rectangles", doi:10.1111/cgf.12151), ellipses
uniformly in area; where a spread hides part of either, the rectangle around the visible part is
sampled in solid angle.

Sheared lights (a parent scaled unevenly, ``area-sheared`` in `notes`) have axes that are not at
right angles. Cycles then works with A = |x||y|, with -Z as the emitter's normal, and with the
formulas of a rectangle for axes that do not form one, so that its light depends on how it is
sampled. The `cycles` model follows its light sampling (exactly where there is no spread), which on
Lambert surfaces differs by up to 0.2 % from what it mixes with multiple importance sampling; there
is no closed form for it, and `intersect` is the other half of that mixture.
The `physical` model takes the true parallelogram or ellipse with its true normal and area.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, LightSample, Model
from ._emission import casts_shadow, stated_emission
from ._geometry import Mask
from ._ies import ies_fields

FULL_SPREAD = np.pi - 1e-6  # π in single precision counts as π
SERIES_BELOW = 0.05  # [rad] where Cycles takes tan h - h as h³/3
SMALLEST_SOLID_ANGLE = 1e-8  # [sr]; below, it rounds too much, and sampling by area is as good
ORTHOGONAL = 1e-5  # largest cosine between axes that counts as a right angle
SHEARED = "area-sheared"


@LIGHTS.register("AREA")
@dataclass(frozen=True, kw_only=True)
class AreaLight(Light):
    """A flat one-sided emitter.

    Attributes
    ----------
    center : (3,) [bu].
    axis_u, axis_v : (3,) full extents [bu].
    direction : (3,) unit vector into which it shines.
    ellipse : outline; else a rectangle (a parallelogram if the axes are sheared).
    spread : s in [0, π] [rad].
    series : take D = h³/3 below h = 0.05.
    as_cycles : treat sheared axes with Cycles' arithmetic.
    """

    kind: ClassVar[str] = "AREA"
    center: Array
    axis_u: Array
    axis_v: Array
    direction: Array
    ellipse: bool = False
    spread: float = float(np.pi)
    series: bool = True
    as_cycles: bool = False

    @property
    def is_delta(self) -> bool:
        return self.spread == 0.0

    @cached_property
    def _lengths(self) -> tuple[float, float]:
        return float(np.linalg.norm(self.axis_u)), float(np.linalg.norm(self.axis_v))

    @cached_property
    def _rectangular(self) -> bool:
        u, v = self._lengths
        return abs(float(self.axis_u @ self.axis_v)) <= ORTHOGONAL * u * v

    @cached_property
    def area(self) -> float:
        """Emitting area [bu²], as Cycles counts it where that is asked for."""
        u, v = self._lengths
        outline = u * v if self.as_cycles else np.linalg.norm(np.cross(self.axis_u, self.axis_v))
        return float(outline) * (0.25 * np.pi if self.ellipse else 1.0)

    @cached_property
    def _divisor(self) -> float:
        """D = tan h - h, or its series."""
        h = 0.5 * self.spread
        return h**3 / 3.0 if self.series and h <= SERIES_BELOW else float(np.tan(h)) - h

    def _radiance(self, cos: Array) -> Array:
        """Return the radiance (n,) over `rgb` at the cosine from the direction it shines into."""
        full = 1.0 / (np.pi * self.area)
        if self.spread >= FULL_SPREAD:
            return np.where(cos > 0.0, full, 0.0)
        cos = np.maximum(cos, geometry.TINY)
        tan = np.sqrt(np.maximum(1.0 - cos * cos, 0.0)) / cos
        return full / self._divisor * np.maximum(np.tan(0.5 * self.spread) - tan, 0.0)

    @cached_property
    def _dual(self) -> Array:
        """Covectors (2, 3) that give the position along the axes, in -½ to ½."""
        axes = np.stack([self.axis_u, self.axis_v])
        if self.as_cycles:
            return axes / np.sum(axes**2, axis=1, keepdims=True)
        return np.linalg.pinv(axes.T)

    def place(self, offset: Array) -> Array:
        """Return where offsets (n, 3) from the centre are along the axes, (n, 2) in -½ to ½."""
        return offset @ self._dual.T

    def _within(self, offset: Array) -> Mask:
        """Return whether offsets (n, 3) from the centre are inside the outline, (n,)."""
        s, t = self.place(offset).T
        if self.ellipse:
            return s * s + t * t <= 0.25
        return np.maximum(np.abs(s), np.abs(t)) <= 0.5

    def _hit(self, origins: Array, directions: Array) -> tuple[Array, Array, Mask]:
        """Return distance (n,), cosine at the light (n,) and whether rays hit its face (n,)."""
        cos = -geometry.dot(directions, self.direction)
        height = geometry.dot(origins - self.center, self.direction)
        front = (cos > 0.0) & (height > 0.0)
        distance = height / np.where(front, cos, 1.0)
        offset = origins + distance[:, None] * directions - self.center
        return distance, cos, front & self._within(offset)

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        if self.is_delta:
            return super().intersect(origins, directions)
        distance, cos, hit = self._hit(origins, directions)
        radiance = self._radiance(cos) * self._pattern(directions)
        return np.where(hit, distance, np.inf), np.where(hit, radiance, 0.0)

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        offset = self.center - points
        height = -geometry.dot(offset, self.direction)
        if self.is_delta:
            return self._beam(offset, height)
        position, solid_angle = self._sample_seen(offset, height, u)
        seen = np.isfinite(solid_angle)
        rest = np.flatnonzero(~seen)
        if len(rest):
            position[rest] = offset[rest] + self._sample_area(u[rest])
        squared = np.maximum(geometry.dot(position, position), geometry.TINY)
        distance = np.sqrt(squared)
        wi = position / distance[:, None]
        cos = -geometry.dot(wi, self.direction)
        solid_angle[rest] = (self.area * np.maximum(cos, 0.0) / squared)[rest]
        lit = height > 0.0
        if self.ellipse:
            lit &= ~seen | self._within(position - offset)
        weight = np.where(lit, self._radiance(cos) * solid_angle, 0.0) * self._pattern(wi)
        return LightSample(wi, distance, weight, 1.0 / np.maximum(solid_angle, geometry.TINY))

    def _density(self, points: Array, normals: Array, wi: Array, distance: Array) -> Array:
        if self.is_delta:
            return super()._density(points, normals, wi, distance)
        offset = self.center - points
        height = -geometry.dot(offset, self.direction)
        _, solid_angle = self._sample_seen(offset, height, np.zeros((len(points), 2)))
        facing = self.area * np.maximum(-geometry.dot(wi, self.direction), geometry.TINY)
        return np.where(np.isnan(solid_angle), distance**2 / facing, 1.0 / solid_angle)

    def _beam(self, offset: Array, height: Array) -> LightSample:
        """Return the sample of a parallel beam."""
        n = len(offset)
        wi = np.broadcast_to(-self.direction, (n, 3)).copy()
        inside = (height > 0.0) & self._within(height[:, None] * wi - offset)
        weight = np.where(inside, 1.0 / self.area, 0.0) * self._pattern(wi)
        return LightSample(wi, height, weight, np.full(n, np.inf))

    def _sample_area(self, u: Array) -> Array:
        """Return offsets (n, 3) from the centre, uniform in the outline."""
        if self.ellipse:
            radius, turn = 0.5 * np.sqrt(u[:, 0]), 2.0 * np.pi * u[:, 1]
            s, t = radius * np.cos(turn), radius * np.sin(turn)
        else:
            s, t = u[:, 0] - 0.5, u[:, 1] - 0.5
        return (s * self.axis_u[:, None] + t * self.axis_v[:, None]).T

    def _sample_seen(self, offset: Array, height: Array, u: Array) -> tuple[Array, Array]:
        """Return positions (n, 3) seen from the points, uniform in solid angle, and this (n,).

        They cover the rectangle of the axes, less what the spread hides: the square about the foot
        of the point with half side height · tan h. The angle is nan where the area is to be
        sampled instead: parallelograms, ellipses that are smaller than the rectangle, and angles
        too small to be computed.
        """
        length_u, length_v = self._lengths
        x, y = self.axis_u / length_u, self.axis_v / length_v
        z = np.cross(x, y)
        if not (self._rectangular or self.as_cycles):
            return np.empty_like(offset), np.full(len(offset), np.nan)
        reach = np.inf
        if self.spread < FULL_SPREAD:
            reach = np.maximum(height, 0.0) * np.tan(0.5 * self.spread)
        along_u, along_v = offset @ x, offset @ y
        bounds = (
            np.maximum(along_u - 0.5 * length_u, -reach),
            np.minimum(along_u + 0.5 * length_u, reach),
            np.maximum(along_v - 0.5 * length_v, -reach),
            np.minimum(along_v + 0.5 * length_v, reach),
        )
        depth = offset @ z
        s, t, angle = geometry.sample_rectangle(bounds, np.abs(depth), u)
        by_area = angle < SMALLEST_SOLID_ANGLE
        if self.ellipse:
            by_area |= (bounds[1] - bounds[0]) * (bounds[3] - bounds[2]) >= self.area
        angle[by_area] = np.nan
        return (s * x[:, None] + t * y[:, None] + depth * z[:, None]).T, angle

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        if self.is_delta:
            beam = self.sample(points, normals, np.zeros((len(points), 2)))
            return beam.weight * np.maximum(geometry.dot(beam.wi, normals), 0.0)
        if self.spread < FULL_SPREAD or self.as_cycles or self.distribution is not None:
            return None
        if self.ellipse:
            return self._ellipse_irradiance(points, normals)
        u = 0.5 * self.axis_u
        v = 0.5 * self.axis_v * -np.sign(np.cross(self.axis_u, self.axis_v) @ self.direction)
        corners = self.center + np.stack([-u - v, u - v, u + v, v - u])
        signed = geometry.polygon_irradiance(corners, points, normals)
        return np.maximum(signed, 0.0) / (np.pi * self.area)

    @cached_property
    def _principal(self) -> tuple[tuple[float, float], Array]:
        """Half axes of the ellipse, and the rotation (3, 3) into its frame."""
        directions, lengths, _ = np.linalg.svd(np.stack([self.axis_u, self.axis_v], axis=1))
        return (0.5 * float(lengths[0]), 0.5 * float(lengths[1])), directions.T

    def _ellipse_irradiance(self, points: Array, normals: Array) -> Array:
        half, frame = self._principal
        offset = (self.center - points) @ frame.T
        result = geometry.ellipse_irradiance(half, offset, normals @ frame.T)
        behind = geometry.dot(points - self.center, self.direction) <= 0.0
        result[behind] = 0.0
        return result / (np.pi * self.area)

    def radiant_flux(self) -> Array:
        if self.distribution is not None and not self.is_delta:
            return self.rgb * self.distribution.flux_and_peak(self._intensity, *self._lit)[0]
        if self.is_delta:
            return self.rgb * self._pattern(-self.direction[None])
        if self.spread >= FULL_SPREAD:
            return self.rgb
        h = 0.5 * self.spread
        return self.rgb * ((np.tan(h) - h) / self._divisor)

    def peak_radiant_intensity(self) -> Array:
        if self.is_delta:
            return np.where(self.rgb == 0.0, 0.0, np.copysign(np.inf, self.rgb))
        if self.distribution is None:
            return self.rgb * self._intensity(self.direction[None])
        return self.rgb * self.distribution.flux_and_peak(self._intensity, *self._lit)[1]

    def peak_radiance(self) -> Array:
        if self.is_delta or self.distribution is None:
            return self.peak_radiant_intensity() / self.area
        return self.rgb * self.distribution.flux_and_peak(self._leaving_radiance, *self._lit)[1]

    @property
    def _lit(self) -> tuple[Array, float]:
        """The axis, and 1 - cos(half angle) of the cone that is lit."""
        return self.direction, 2.0 * float(np.sin(0.25 * self.spread)) ** 2

    def _leaving_radiance(self, leaving: Array) -> Array:
        """Return the radiance (n,) over `rgb` [1/(bu² sr)] into directions (n, 3)."""
        return self._radiance(leaving @ self.direction) * self._pattern(-leaving)

    def _intensity(self, leaving: Array) -> Array:
        """Return the intensity (n,) over `rgb` [1/sr] far away."""
        cos = np.maximum(leaving @ self.direction, 0.0)
        return self._leaving_radiance(leaving) * cos * self.area

    @classmethod
    def from_record(cls, record: LightRecord, model: Model) -> AreaLight | None:
        """Build the light; None where it emits nothing, as with an axis of no length.

        `normalize` off: radiance P/π is that of a power P·A. Physical model: radiance and areas
        count real metres, so the power over bu² is P/k² with k metres a bu; a radiance that is
        stated as such needs no k.
        """
        properties = record.properties
        rgb, matrix = stated_emission(record), np.array(record.world_from_light, dtype=np.float64)
        size = float(properties["size"])
        shape = str(properties["shape"])
        size_y = float(properties["size_y"]) if shape in ("RECTANGLE", "ELLIPSE") else size
        u, v, z = matrix[:3, 0] * size, matrix[:3, 1] * size_y, matrix[:3, 2]
        volume = np.linalg.norm(u) * np.linalg.norm(v) * np.linalg.norm(z)
        if not rgb.any() or volume == 0.0 or properties.get("cycles.is_portal", False):
            return None
        axes = np.stack([u, v, z]) / np.linalg.norm(np.stack([u, v, z]), axis=1, keepdims=True)
        sheared = np.abs(axes @ axes.T - np.eye(3)).max() > ORTHOGONAL
        normal = np.cross(axes[0], axes[1])
        direction = -axes[2]
        if sheared and model == "physical":
            flat = float(np.linalg.norm(normal))
            if flat == 0.0:
                return None
            direction = normal * (np.sign(normal @ direction) / flat)
        normalize = bool(properties.get("normalize", True))
        ies = ies_fields(record, model, direction)
        light = cls(
            name=record.name,
            rgb=rgb / record.unit_scale_m**2 if model == "physical" and normalize else rgb,
            cast_shadow=casts_shadow(record),
            visible_camera=record.visible_camera,
            notes=(SHEARED,) * bool(sheared) + ies["notes"],
            center=matrix[:3, 3],
            axis_u=u,
            axis_v=v,
            direction=direction,
            ellipse=shape in ("DISK", "ELLIPSE"),
            spread=float(properties.get("spread", np.pi)),
            series=model == "cycles",
            as_cycles=sheared and model == "cycles",
            distribution=ies["distribution"],
        )
        return light if normalize else replace(light, rgb=rgb * light.area)

    @classmethod
    def examples(cls) -> list[Light]:
        rgb, center = np.array([3.0, 2.0, 1.0]), np.array([0.2, -0.1, 1.5])
        u, v = np.array([0.64, 0.0, -0.48]), np.array([0.0, 0.5, 0.0])
        direction = np.array([-0.6, 0.0, -0.8])
        kinds: list[tuple[str, Array, bool, float]] = [
            ("rectangle", v, False, np.pi),
            ("parallelogram", v + 0.4 * u, False, np.pi),
            ("disc", v * 1.6, True, np.pi),
            ("ellipse", v, True, np.pi),
            ("slanted-ellipse", v + 0.4 * u, True, np.pi),
            ("softbox", v, False, 1.0),
            ("round-softbox", v, True, 0.6),
            ("narrow", v, False, 0.08),
            ("beam", v, True, 0.0),
        ]
        return [
            cls(
                name=name,
                rgb=rgb,
                center=center,
                axis_u=u,
                axis_v=other,
                direction=direction,
                ellipse=ellipse,
                spread=spread,
            )
            for name, other, ellipse, spread in kinds
        ]
