# SPDX-License-Identifier: GPL-3.0-or-later
"""World: a sky over and under everything, uniform or by direction.

=================== ======================= ====================================================
parameter           unit                    meaning
=================== ======================= ====================================================
`rgb`               W/(m² sr)               radiance L = strength × colour of the background
`sky`                                       radiance by direction, over its `scale`
=================== ======================= ====================================================

Derivation. E = L ∫ cos θ dω over the hemisphere = πL, whatever the normal; sampled with the
density cos θ/π every sample has the same weight. The radiance is the same in both models.

Portals, area lights marked as such, guide the samples of a room to its windows: with m portals, ¾
of the samples are split evenly among them, uniform in the solid angle Ωᵢ [sr] of each, so that the
density is ¼ cos θ/π + ¾/m Σ [hit i]/Ωᵢ. Portals emit nothing and hide nothing: light that comes in
elsewhere still counts. Of the other samples, the part `SkyMap.share` follows a sky whose radiance
varies. The density counts all ways to a direction, whichever one the sample took:

    p(ω) = Σⱼ shareⱼ pⱼ(ω) [1/sr],  j over hemisphere, sky and portals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightRecord, LightSample
from ._environment import SkyMap

THROUGH_PORTALS = 0.75  # of the samples
SMALLEST_SOLID_ANGLE = 1e-8  # [sr] of a portal that is worth sampling


@dataclass(frozen=True)
class Portal:
    """A rectangle through which samples look for the sky.

    Attributes
    ----------
    center : (3,) [bu].
    frame : (3, 3) rows: unit vectors along its two sides, and its normal.
    half : (2,) half sides [bu].
    """

    center: Array
    frame: Array
    half: Array

    @classmethod
    def from_record(cls, record: LightRecord) -> Portal | None:
        """Return a light object's portal, None where it is no portal or has no area."""
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
        """Return directions (n, 3) uniform in its solid angle, and that (n,) [sr], inf if tiny."""
        x, y, depth = ((self.center - points) @ self.frame.T).T
        bounds = (x - self.half[0], x + self.half[0], y - self.half[1], y + self.half[1])
        s, t, angle = geometry.sample_rectangle(bounds, np.abs(depth), u)
        angle[angle < SMALLEST_SOLID_ANGLE] = np.inf
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
    """A background; `portals` guide its samples.

    Attributes
    ----------
    sky : its radiance by direction over `SkyMap.scale` is a factor on `rgb`; None for 1.
    """

    kind: ClassVar[str] = "WORLD"
    portals: tuple[Portal, ...] = ()
    sky: SkyMap | None = None

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        wi, angles = self._directions(points, normals, u)
        tint, pdf = self._seen(points, normals, wi, angles)
        lit = pdf > 0.0 if tint is None else tint.any(axis=1)
        weight = np.divide(1.0, pdf, out=np.zeros_like(pdf), where=lit)
        return LightSample(wi, np.full(len(points), np.inf), weight, pdf, tint)

    def look(self, points: Array, normals: Array, wi: Array) -> tuple[Array, Array, Array]:
        middle = np.full((len(points), 2), 0.5)
        angles = [portal.sample(points, middle)[1] for portal in self.portals]
        radiance, pdf = self._seen(points, normals, wi, angles)
        n = len(points)
        return np.full(n, np.inf), np.ones(n) if radiance is None else radiance, pdf

    @property
    def _shares(self) -> tuple[float, float, float]:
        """Shares of the samples: over the hemisphere, along the sky, through each portal."""
        rest = 1.0 - THROUGH_PORTALS * bool(self.portals)
        sky = rest * (0.0 if self.sky is None else self.sky.share)
        return rest - sky, sky, THROUGH_PORTALS / max(len(self.portals), 1)

    def _seen(
        self, points: Array, normals: Array, wi: Array, angles: list[Array]
    ) -> tuple[Array | None, Array]:
        """Return the radiance (n, 3) over `rgb`, None for 1, and the density (n,) of samples."""
        radiance = None
        share, along_sky, each = self._shares
        pdf = np.zeros(len(points))
        if share:
            shares = share + each * sum(np.isinf(angle) for angle in angles)
            pdf += shares * np.maximum(geometry.dot(wi, normals), 0.0) / np.pi
        for portal, angle in zip(self.portals, angles, strict=True):
            pdf += each * portal.hit(points, wi) / angle
        if self.sky is not None:
            radiance, density = self.sky.look(wi)
            radiance /= self.sky.scale
            pdf += along_sky * density
        return radiance, pdf

    def _directions(self, points: Array, normals: Array, u: Array) -> tuple[Array, list[Array]]:
        """Return directions (n, 3) by all ways, and solid angles (n,) [sr] for each portal.

        Where a portal's solid angle is too small, its samples go over the hemisphere.
        """
        share, along_sky, each = self._shares
        if self.sky is not None and along_sky == 1.0:
            return self.sky.sample(u), []
        rest = share + along_sky
        way, second = u.T
        turn = (way - rest) / each
        chosen = np.floor(turn)
        first = np.where(way < share, way / share, turn - chosen)
        wi, _ = geometry.sample_hemisphere(normals, np.stack([first, second], axis=1))
        if self.sky is not None:
            mine = (way >= share) & (way < rest)
            again = np.stack([(way - share) / along_sky, second], axis=1)
            wi[mine] = self.sky.sample(again[mine])
        again = np.stack([turn - chosen, second], axis=1)
        angles: list[Array] = []
        for number, portal in enumerate(self.portals):
            through, angle = portal.sample(points, again)
            mine = (chosen == number) & np.isfinite(angle)
            wi[mine] = through[mine]
            angles.append(angle)
        return wi, angles

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        """Return π of a uniform sky, None where portals say that hardly any of it arrives."""
        return None if self.portals or self.sky else np.full(len(points), np.pi)

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        far = np.full(len(origins), np.inf)
        if self.sky is None:
            return far, np.ones(len(origins))
        return far, self.sky.look(directions)[0] / self.sky.scale

    def radiant_flux(self) -> Array:
        return np.full(3, np.nan)

    def peak_radiance(self) -> Array:
        return self.rgb if self.sky is None else self.rgb * self.sky.peak / self.sky.scale

    def facing_irradiance(self) -> Array:
        """Return E (3,) [W/m²] on any surface; on one that looks up if the radiance varies."""
        if self.sky is None:
            return self.rgb * np.pi
        return self.rgb * self.sky.irradiance(np.array([0.0, 0.0, 1.0])) / self.sky.scale

    @classmethod
    def examples(cls) -> list[Light]:
        rgb = np.array([0.3, 0.4, 0.5])
        centers = np.array([[-1.4, -0.1, 0.8], [-0.2, -0.1, 0.8]])
        windows = tuple(Portal(center, np.eye(3), np.array([0.4, 0.7])) for center in centers)
        texels = np.linspace(0.2, 3.0, 24 * 32 * 3, dtype=np.float32).reshape(24, 32, 3)
        texels[4:6, 2:4] = 40.0
        turn = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
        disc = np.pad(texels[:8, :8], ((1, 1), (1, 1), (0, 0)))
        return [
            cls(name="World", rgb=rgb),
            cls(name="room", rgb=rgb, portals=windows),
            cls(name="sky", rgb=rgb, sky=SkyMap(texels, turn)),
            cls(name="sky-room", rgb=rgb, sky=SkyMap(texels, turn), portals=windows),
            cls(name="disc", rgb=rgb, sky=SkyMap(disc, np.roll(turn, 1, axis=0), (0.4, 0.3))),
        ]
