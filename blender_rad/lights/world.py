# SPDX-License-Identifier: GPL-3.0-or-later
"""World: a uniform sky over and under everything.

=================== ======================= ====================================================
parameter           unit                    meaning
=================== ======================= ====================================================
`rgb`               W/(m² sr)               radiance L = strength × colour of the background
=================== ======================= ====================================================

Derivation. E = L ∫ cos θ dω over the hemisphere = πL, whatever the normal; sampled with the
density cos θ/π every sample has the same weight. The radiance is the same in both models.

Portals, area lights marked as such, guide the samples of a room to its windows: ¾ of them go
evenly through the portals' solid angles Ωᵢ, so that the density is ¼ cos θ/π + ¾/k Σ [hit i]/Ωᵢ.
They emit nothing and take nothing away: light that comes in elsewhere still counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, LightSample

THROUGH_PORTALS = 0.75  # of the samples
SMALLEST_SOLID_ANGLE = 1e-8  # [sr] of a portal that is worth sampling


@dataclass(frozen=True)
class Portal:
    """A rectangle that the sky is looked for through.

    Attributes
    ----------
    center : (3,) [bu].
    frame : (3, 3) unit vectors along its sides, and across.
    half : (2,) half sides [bu].
    """

    center: Array
    frame: Array
    half: Array

    @classmethod
    def from_record(cls, record: LightRecord) -> Portal | None:
        """Return the portal that a light object is, None where it is something else or flat."""
        properties = record.properties
        matrix = np.asarray(record.world_from_light, dtype=np.float64)
        if record.bl_type != "AREA" or not properties.get("cycles.is_portal", False):
            return None
        size = float(properties["size"])
        long = properties["shape"] in ("RECTANGLE", "ELLIPSE")
        sides = np.array([size, float(properties["size_y"]) if long else size])
        axes = matrix[:3, :2] * sides
        frame, spans = np.linalg.qr(axes)
        half = 0.5 * np.abs(np.diag(spans))
        if not half.all():
            return None
        return cls(matrix[:3, 3], np.vstack([frame.T, np.cross(*frame.T)]), half)

    def sample(self, points: Array, u: Array) -> tuple[Array, Array]:
        """Return directions (n, 3) even over its solid angle, and this (n,) [sr]."""
        x, y, depth = ((self.center - points) @ self.frame.T).T
        bounds = (x - self.half[0], x + self.half[0], y - self.half[1], y + self.half[1])
        s, t, angle = geometry.sample_rectangle(bounds, np.abs(depth), u)
        wi = np.stack([s, t, depth], axis=1)
        length = np.sqrt(geometry.dot(wi, wi))
        return wi / np.maximum(length, geometry.TINY)[:, None] @ self.frame, angle

    def hit(self, points: Array, wi: Array) -> geometry.Mask:
        """Return whether rays pass through it, (n,)."""
        x, y, depth = ((self.center - points) @ self.frame.T).T
        along, up, across = (wi @ self.frame.T).T
        ahead = across * depth > 0.0
        distance = depth / np.where(ahead, across, 1.0)
        inside = np.abs(distance * along - x) <= self.half[0]
        return ahead & inside & (np.abs(distance * up - y) <= self.half[1])


@LIGHTS.register("WORLD")
@dataclass(frozen=True, kw_only=True)
class WorldLight(Light):
    """A uniform background; `portals` guide its samples."""

    kind: ClassVar[str] = "WORLD"
    portals: tuple[Portal, ...] = ()

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        if self.portals:
            return self._guided(points, normals, u)
        wi, cos = geometry.sample_hemisphere(normals, u)
        pdf = cos / np.pi
        return LightSample(wi, np.full(len(points), np.inf), 1.0 / pdf, pdf)

    def _guided(self, points: Array, normals: Array, u: Array) -> LightSample:
        """Choose among hemisphere and portals, and weigh by the density of all together."""
        each = THROUGH_PORTALS / len(self.portals)
        rest = 1.0 - THROUGH_PORTALS
        wi, _ = geometry.sample_hemisphere(normals, np.stack([u[:, 0] / rest % 1, u[:, 1]], axis=1))
        turn = (u[:, 0] - rest) / each
        chosen = np.floor(turn)  # negative for the hemisphere
        again = np.stack([turn - chosen, u[:, 1]], axis=1)
        angles: list[Array] = []
        for number, portal in enumerate(self.portals):
            through, angle = portal.sample(points, again)
            angle[angle < SMALLEST_SOLID_ANGLE] = np.inf
            mine = (chosen == number) & np.isfinite(angle)
            wi[mine] = through[mine]
            angles.append(angle)
        cos = geometry.dot(wi, normals)
        share = 1.0 - each * sum(np.isfinite(angle) for angle in angles)
        pdf = share * np.maximum(cos, 0.0) / np.pi
        for portal, angle in zip(self.portals, angles, strict=True):
            pdf += each * portal.hit(points, wi) / angle
        weight = np.divide(1.0, pdf, out=np.zeros_like(pdf), where=pdf > 0.0)
        return LightSample(wi, np.full(len(points), np.inf), weight, pdf)

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        """Return π, and None where portals say that hardly any of it arrives."""
        return None if self.portals else np.full(len(points), np.pi)

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
        rgb = np.array([0.3, 0.4, 0.5])
        centers = np.array([[-1.4, -0.1, 0.8], [-0.2, -0.1, 0.8]])
        windows = [Portal(center, np.eye(3), np.array([0.4, 0.7])) for center in centers]
        return [cls(name="World", rgb=rgb), cls(name="room", rgb=rgb, portals=tuple(windows))]
