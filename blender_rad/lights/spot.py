# SPDX-License-Identifier: GPL-3.0-or-later
"""Spot light: a point light whose rays are dimmed outside a cone about its local -Z.

=================== ======================= ====================================================
Blender property    unit                    meaning
=================== ======================= ====================================================
`spot_size`         rad                     full angle s of the cone, c = cos(s/2)
`spot_blend`        0 to 1                  b, the share of the cone, in cosine, that is a ramp
`energy`, …                                 as for a point light: not divided by the cone
=================== ======================= ====================================================

Derivation. A ray that leaves in direction ω (world) has the local direction l = A ω/|A ω|, with A
the inverse of the light's linear transform: an object scale squeezes the cone (elliptical where x
and y differ), shear slants it, and neither changes the intensity. The ray's factor is
f = 3t² - 2t³ with t = (-l_z - c)/((1 - c) b), clamped to [0, 1]. As every ray has its own, a radius
blurs the ramp. With radius 0, I = P f/4π, and without scale the flux is
Φ = (P/4π) 2π (1-c)(1-b/2) = P(1-c)(1-b/2)/2, since a smoothstep has the mean ½; in general the
solid angle is dω = |det M|/|M l|³ dl with M = A⁻¹, integrated here by quadrature. A sphere shows
πr² to every direction, so Φ = ∫ πr² L f dω is the same.

A negative z scale turns the spot about. At points inside a spot's sphere Cycles ignores the cone,
and there it finds rays from beyond the centre by light sampling alone, so that its result depends
on how many lights there are (half for a single light). Here they count in full: E = πL. A singular
transform has no inverse and thus no local direction: Cycles gives no light with radius 0 and noise
otherwise; here such a spot emits nothing.

The physical model keeps the convention I = P/4π inside the cone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, cast

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, Model
from ._geometry import Mask
from .point import PointLight, common_fields

ORTHOGONAL = 1e-6  # largest cosine between axes of a transform that counts as unsheared


@LIGHTS.register("SPOT")
@dataclass(frozen=True, kw_only=True)
class SpotLight(PointLight):
    """A point or ball with a cone.

    Attributes
    ----------
    light_from_world : (3, 3) linear part, with scale.
    cos_half_angle : c.
    blend : b in [0, 1].
    """

    kind: ClassVar[str] = "SPOT"
    light_from_world: Array
    cos_half_angle: float
    blend: float = 0.0

    @cached_property
    def _world_from_light(self) -> Array:
        return np.linalg.inv(self.light_from_world)

    @cached_property
    def _axis(self) -> Array:
        """Unit direction (3,) along which the axis of the cone leaves."""
        z = self._world_from_light[:, 2]
        return -z / np.sqrt(z @ z)

    @cached_property
    def _scales(self) -> Array | None:
        """Lengths (3,) of the transform's axes, None when they are not at right angles."""
        scale = np.sqrt(np.sum(self._world_from_light**2, axis=0))
        cosines = (self._world_from_light.T @ self._world_from_light) / np.outer(scale, scale)
        return scale if np.allclose(cosines, np.eye(3), rtol=0.0, atol=ORTHOGONAL) else None

    def _ramp(self, cos: Array) -> Array:
        """Return the factor for the cosine between a local direction and the axis."""
        width = max((1.0 - self.cos_half_angle) * self.blend, geometry.TINY)
        t = np.clip((cos - self.cos_half_angle) / width, 0.0, 1.0)
        return t * t * (3.0 - 2.0 * t)

    def _falloff(self, directions: Array, inside: Mask) -> Array:
        local = (self.light_from_world @ directions.T).T
        length = np.sqrt(np.maximum(geometry.dot(local, local), geometry.TINY))
        ramp = np.where(inside, 1.0, self._ramp(local[:, 2] / length))
        return ramp * super()._falloff(directions, inside)

    def _cone(self, axis: Array, squared: Array) -> tuple[Array, Array]:
        """Return the smaller of the cone that holds the ball and the cone of the spot's rays."""
        axis, cone = super()._cone(axis, squared)
        if self._scales is None:
            return axis, cone
        c2 = self.cos_half_angle**2
        tan2 = (1.0 - c2) * np.max(self._scales[:2]) ** 2 / (self._scales[2] ** 2)
        own = geometry.one_minus_cos(np.array(tan2 / (c2 + tan2)))
        narrow = own < cone
        return np.where(narrow[:, None], -self._axis, axis), np.where(narrow, own, cone)

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        whole = super().irradiance(points, normals)
        if self.is_delta or whole is None:
            return whole
        if self._lit[0] is None:
            return None
        axis, squared = geometry.towards(self.position, points)
        off_axis = np.arccos(np.clip(-(axis @ self._axis), -1.0, 1.0))
        half = np.arcsin(np.sqrt(self._cap(squared)))
        ramp = self.cos_half_angle + (1.0 - self.cos_half_angle) * self.blend
        lit = (off_axis + half <= np.arccos(min(ramp, 1.0))) | self._inside(squared)
        dark = off_axis - half >= np.arccos(self.cos_half_angle)
        return np.where(lit, whole, np.where(dark, 0.0, np.nan))

    @property
    def _lit(self) -> tuple[Array | None, float]:
        even = self._scales is not None and np.ptp(self._scales) <= ORTHOGONAL * self._scales[0]
        return (self._axis, 1.0 - self.cos_half_angle) if even else super()._lit

    def radiant_flux(self) -> Array:
        if self.distribution is not None:
            return super().radiant_flux()
        nodes, weights = cast(
            "tuple[Array, Array]",
            np.polynomial.legendre.leggauss(64),  # pyright: ignore[reportUnknownMemberType]
        )
        c = self.cos_half_angle
        edges = np.array([c, c + (1.0 - c) * self.blend, 1.0])
        span = np.diff(edges)
        z = (edges[:-1, None] + span[:, None] * 0.5 * (nodes + 1.0)).ravel()
        share = (0.5 * span[:, None] * weights).ravel() * self._ramp(z)
        phi = 2.0 * np.pi * np.arange(256) / 256
        sin = np.sqrt(1.0 - z * z)[:, None]
        local = np.stack([sin * np.cos(phi), sin * np.sin(phi), -z[:, None] + 0.0 * phi], axis=-1)
        world = local @ self._world_from_light.T
        stretch = np.abs(np.linalg.det(self._world_from_light)) / np.sum(world**2, axis=-1) ** 1.5
        return self.rgb * float(share @ np.mean(stretch, axis=1)) * 0.5

    @classmethod
    def from_record(cls, record: LightRecord, model: Model) -> SpotLight | None:
        common = common_fields(record, model)
        linear = np.array(record.world_from_light[:3, :3], dtype=np.float64)
        if common is None or np.linalg.matrix_rank(linear) < linear.shape[0]:
            return None
        return cls(
            **common,
            light_from_world=np.linalg.inv(linear),
            cos_half_angle=float(np.cos(0.5 * float(record.properties["spot_size"]))),
            blend=float(record.properties.get("spot_blend", 0.0)),
        )

    @classmethod
    def examples(cls) -> list[Light]:
        white, place = np.array([3.0, 2.0, 1.0]), np.array([0.2, -0.1, 1.5])
        turned: Array = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
        scaled: Array = np.diag([1.0, 2.0, 0.5])
        sheared: Array = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.2], [0.1, 0.0, 1.0]])
        spots: list[tuple[str, Array, float, float, bool]] = [
            ("spot", turned, 0.0, 0.15, False),
            ("hard", turned, 0.0, 0.0, False),
            ("scaled", scaled @ turned, 0.0, 1.0, False),
            ("ball", turned, 0.4, 0.15, False),
            ("soft", turned, 0.4, 0.15, True),
            ("scaled-ball", scaled @ turned, 0.4, 0.5, False),
            ("sheared-ball", sheared @ turned, 0.1, 0.5, False),
        ]
        return [
            cls(
                name=name,
                rgb=white,
                position=place,
                radius=radius,
                soft_falloff=soft,
                light_from_world=matrix,
                cos_half_angle=float(np.cos(np.radians(35.0))),
                blend=blend,
            )
            for name, matrix, radius, blend, soft in spots
        ]
