# SPDX-License-Identifier: GPL-3.0-or-later
"""A lamp whose node tree makes its light depend on where, whither and how far it goes.

Cycles evaluates the tree at the point of the lamp that a ray meets: Position is that point (of a
sun the direction in which its light travels), Incoming the direction in which it leaves, Normal
the same for points and spots with soft falloff and for suns, of spheres and areas their own. In
the lamp's frame, UV (which is Parametric) is

====== ===========================================================================================
point  longitude and latitude of the normal
spot   ½ + x/z · ½ cot(half cone), the picture that it projects
area   place along its x and y, from 0 to 1
sun    place in its disc
====== ===========================================================================================

Nothing of it is known in closed form: flux and peaks are means and maxima over a lattice of rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..textures import UV, Context, Expression
from . import _geometry as geometry
from ._base import Array, Light, LightSample
from .area import AreaLight
from .point import PointLight
from .spot import SpotLight
from .sun import SunLight

RAYS = 1 << 14
FAR = 1e4  # [bu] as good as infinity for intensities


@dataclass(frozen=True, kw_only=True)
class TexturedLight(Light):
    """A lamp times an expression.

    Attributes
    ----------
    plain : the lamp without its texture.
    texture : factor on its radiance.
    world_from_light : (4, 4) with scale.
    """

    plain: Light
    texture: Expression
    world_from_light: Array

    @property
    def kind(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.plain.kind

    @property
    def is_delta(self) -> bool:
        return self.plain.is_delta

    @cached_property
    def _light_from_world(self) -> Array:
        return np.linalg.pinv(self.world_from_light)

    def _factor(self, points: Array, wi: Array, distance: Array) -> Array:
        """Return the texture (n, 3) on rays along `wi` that meet the lamp at a distance."""
        light = self.plain
        far = np.isinf(distance)[:, None]
        position = np.where(far, -wi, points + wi * np.where(far, 0.0, distance[:, None]))
        normal = -wi
        if isinstance(light, AreaLight):
            normal = np.tile(light.direction, (len(wi), 1))
        elif isinstance(light, PointLight) and light.radius > 0.0 and not light.soft_falloff:
            normal = (position - light.position) / light.radius
        uv = np.pad(self._uv(position, normal, wi), ((0, 0), (0, 1)))
        context = Context(
            position=position,
            normal=normal,
            geometric=normal,
            incoming=-wi,
            distance=distance[:, None],
            parametric=uv,
            object_from_world=self._light_from_world,
            attribute={UV: uv}.get,
        )
        return self.texture.rgb(context, len(wi))

    def _uv(self, position: Array, normal: Array, wi: Array) -> Array:
        """Return the lamp's own coordinates, (n, 2)."""
        light, turn = self.plain, self._light_from_world[:3, :3]
        if isinstance(light, AreaLight):
            return np.clip(light.place(position - light.center), -0.5, 0.5) + 0.5
        if isinstance(light, SunLight):
            half = np.sin(0.5 * light.half_angle)
            scale = 0.5 / half if half > 0.0 else 0.0
            across = np.sqrt(2.0 + 2.0 * geometry.dot(wi, light.towards))
            return 0.5 + (wi @ turn[:2].T) * (scale / across)[:, None]
        if isinstance(light, SpotLight):
            x, y, z = -(wi @ turn.T).T
            cos = light.cos_half_angle
            return 0.5 - 0.5 * cos / np.sqrt(1.0 - cos**2) * np.stack([x, y], axis=1) / z[:, None]
        x, y, z = (normal @ turn.T).T
        latitude = np.arctan2(z, np.hypot(x, y))
        return np.stack([0.5 - np.arctan2(x, y) / (2.0 * np.pi), 0.5 + latitude / np.pi], axis=1)

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        sample = self.plain.sample(points, normals, u)
        return sample._replace(tint=self._factor(points, sample.wi, sample.distance))

    def _density(self, points: Array, normals: Array, wi: Array, distance: Array) -> Array:
        return self.plain._density(points, normals, wi, distance)

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        distance, radiance = self.plain.intersect(origins, directions)
        found = np.zeros((len(origins), 3))
        hit = np.flatnonzero(radiance)
        factor = self._factor(origins[hit], directions[hit], distance[hit])
        found[hit] = radiance[hit, None] * factor
        return distance, found

    @cached_property
    def _seen(self) -> tuple[Array, Array]:
        """Intensity towards evenly spread directions (n, 3) over `rgb`, and radiance (n, 3).

        Of suns, in place of the intensity, what reaches surfaces that face them.
        """
        light, u = self.plain, geometry.lattice(RAYS)
        up = np.tile([0.0, 0.0, 1.0], (RAYS, 1))
        towards = geometry.sample_cone(up, np.full(RAYS, 2.0), u)
        centre = np.zeros(3)
        if isinstance(light, PointLight):
            centre = light.position
        elif isinstance(light, AreaLight):
            centre = light.center
        elif isinstance(light, SunLight):
            towards = np.tile(-light.towards, (RAYS, 1))
        again = np.roll(geometry.lattice(RAYS), RAYS // 3, axis=0)[:, ::-1]
        sample = self.sample(centre + FAR * towards, -towards, again)
        tint = sample.tint if sample.tint is not None else np.ones((1, 3))
        cos = np.maximum(-geometry.dot(sample.wi, towards), 0.0)
        far = 1.0 if light.kind == "SUN" else FAR**2
        intensity = (sample.weight * cos)[:, None] * tint * far
        shines = (sample.weight != 0.0) & np.isfinite(sample.pdf)
        radiance = np.zeros(RAYS)
        np.multiply(sample.weight, sample.pdf, out=radiance, where=shines)
        return intensity, radiance[:, None] * np.where(shines[:, None], tint, 1.0)

    @property
    def _has_far_field(self) -> bool:
        beam = self.is_delta and isinstance(self.plain, AreaLight)
        falls = any(kind == "ShaderNodeLightFalloff" for kind, _ in self.texture.kinds)
        return not (beam or falls or isinstance(self.plain, SunLight))

    def radiant_flux(self) -> Array:
        if not self._has_far_field:
            return np.full(3, np.nan)
        return self.rgb * (4.0 * np.pi * self._seen[0].mean(axis=0))

    def peak_radiant_intensity(self) -> Array:
        if not self._has_far_field:
            return super().peak_radiant_intensity()
        return self.rgb * self._seen[0].max(axis=0)

    def peak_radiance(self) -> Array:
        return super().peak_radiance() if self.is_delta else self.rgb * self._seen[1].max(axis=0)

    def facing_irradiance(self) -> Array:
        if not isinstance(self.plain, SunLight):
            return super().facing_irradiance()
        return self.rgb * self._seen[0].mean(axis=0)

    @classmethod
    def examples(cls) -> list[Light]:
        return []
