# SPDX-License-Identifier: GPL-3.0-or-later
"""What every light offers to the estimator, and how a Blender record becomes one.

All geometry is in Blender units ("bu"). In the `cycles` model one bu counts as a metre in the
fall-off; in the `physical` model the unit scale is folded into the radiance, so that the estimator
never needs to know of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..registry import Registry

if TYPE_CHECKING:
    from ._distribution import Distribution

Array = NDArray[np.float64]
Model = Literal["cycles", "physical"]
RAYS = ("diffuse", "glossy", "transmission")  # kinds of lobes, as Blender's ray visibility has them

LIGHTS: Registry[type[Light]] = Registry(__name__.rpartition(".")[0], "light type")


class LightSample(NamedTuple):
    """Directions towards a light with what arrives from them, unoccluded.

    Attributes
    ----------
    wi : (n, 3) unit vectors from the point towards the light.
    distance : (n,) [bu] to the emitting point; ``inf`` for the sun and the world.
    weight : (n,) radiance over density, times `Light.rgb` a radiance in W/m²: the sample's
        irradiance is ``rgb * weight * max(cos θ, 0)``. For delta lights it is the irradiance on a
        facing surface. 0 where the light sends nothing.
    pdf : (n,) density per solid angle [1/sr] of `wi`; ``inf`` for delta lights.
    tint : (n, 3) factor on `Light.rgb` by sample, of textured lights; None for 1.
    """

    wi: Array
    distance: Array
    weight: Array
    pdf: Array
    tint: Array | None = None


@dataclass(frozen=True)
class LightRecord:
    """A Blender light as read: its own properties unconverted, and where it stands.

    Attributes
    ----------
    name : name of the object (the row in tables).
    bl_type : Blender's ``light.type``: POINT, SPOT, AREA, SUN.
    properties : every scalar, enum and vector property of the light datablock by Blender's name
        (``energy``, ``color``, ``shadow_soft_size``, ``spot_size``, ``normalize``, ...).
    world_from_light : (4, 4) matrix in bu, with its scale.
    unit_scale_m : metres a bu.
    blender_version : such as (4, 5, 15).
    data : name of the light datablock.
    shown : whether renders have it.
    unknown : what of its emission cannot be read, empty when all of it is known.
    """

    name: str
    bl_type: str
    properties: Mapping[str, Any]
    world_from_light: Array
    unit_scale_m: float
    blender_version: tuple[int, int, int]
    visible_camera: bool = False
    data: str = ""
    shown: bool = True
    unknown: str = ""


@dataclass(frozen=True, kw_only=True)
class Light(ABC):
    """An emitter. Everything per channel is `rgb` times one achromatic number.

    Attributes
    ----------
    name : the object's name; lights of one name are one layer and one row.
    rgb : (3,) scene-linear emission: radiant power per channel for point, spot (as if it had no
        cone) and area lights, with areas counted in bu² (so that times unit_scale_m² it is in W);
        irradiance [W/m²] on a facing surface for suns; radiance [W/(m² sr)] for world and mesh.
        `from_record` folds `normalize` and, in the physical model, the unit scale into it.
    cast_shadow : whether anything can hide it.
    visible_camera : whether camera rays see it.
    reaches : kinds of lobes, among `RAYS`, that it lights.
    notes : kebab-case codes of what a user should know of this light, such as ``area-sheared``;
        each is explained in the module of its kind.
    distribution : factor on the radiance by direction (IES), for point, spot and area lights.
    """

    kind: ClassVar[str]
    name: str
    rgb: Array
    cast_shadow: bool = True
    visible_camera: bool = False
    reaches: tuple[str, ...] = RAYS
    notes: tuple[str, ...] = ()
    distribution: Distribution | None = None

    def _pattern(self, directions: Array) -> Array:
        """Return the distribution's factor (n,) on rays that arrive from `directions`."""
        if self.distribution is None:
            return np.ones(len(directions))
        return self.distribution.factor(-directions)

    @property
    def is_delta(self) -> bool:
        """Whether light arrives from a single direction, so that one sample is exact."""
        return False

    @property
    def is_found(self) -> bool:
        """Whether `look` finds all of its light."""
        return not self.is_delta

    @abstractmethod
    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        """Return one sample a point; `points`, `normals` (n, 3), `u` (n, 2) in [0, 1)."""

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        """Return the exact unoccluded irradiance over `rgb`, (n,), or None without a closed form.

        Light from below the horizon of `normals` does not count. nan marks single points where no
        closed form holds (an ellipse cut by the horizon, the edge of a soft spot): sample those.
        """
        return None

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Return distance (n,) [bu] (inf where missed) and radiance over `rgb` along rays.

        The radiance is (n,), or (n, 3) of textured lights.
        For suns and the world the distance is inf and the radiance alone tells.
        """
        n = len(origins)
        return np.full(n, np.inf), np.zeros(n)

    def look(self, points: Array, normals: Array, wi: Array) -> tuple[Array, Array, Array]:
        """Return `intersect` along unit `wi` (n, 3), and how densely `sample` takes these.

        The density (n,) [1/sr] holds where the radiance is not 0.
        """
        distance, radiance = self.intersect(points, wi)
        return distance, radiance, self._density(points, normals, wi, distance)

    def _density(self, points: Array, normals: Array, wi: Array, distance: Array) -> Array:
        """Return the density (n,) of `wi`, which meet it at `distance` (n,)."""
        return np.zeros(len(points))

    @abstractmethod
    def radiant_flux(self) -> Array:
        """Return the emitted power (3,), nan where it has no meaning (sun, world).

        Areas count in bu²: times unit_scale_m² it is in W, in both models.
        """

    def peak_radiant_intensity(self) -> Array:
        """Return the greatest intensity (3,) far away, in the unit of `radiant_flux` over sr.

        nan where it has no meaning, inf for a parallel beam.
        """
        return np.full(3, np.nan)

    def leaving_flux(self) -> Array:
        """Return what of `radiant_flux` does not hit the light itself, (3,)."""
        return self.radiant_flux()

    def peak_radiance(self) -> Array:
        """Return the greatest radiance (3,) [W/(m² sr)]; nan of a point, inf of a parallel beam."""
        return np.full(3, np.nan)

    def facing_irradiance(self) -> Array:
        """Return E (3,) [W/m²] on a facing surface, nan where that depends on its distance."""
        return np.full(3, np.nan)

    @classmethod
    def from_record(cls, record: LightRecord, model: Model) -> Light | None:
        """Build the light that `record` means in `model`; None when it emits nothing."""
        raise NotImplementedError(f"{cls.__name__} is not made from a light object")

    @classmethod
    @abstractmethod
    def examples(cls) -> list[Light]:
        """Return lights for the contract tests.

        Those that stand somewhere do so within half a bu of (0.2, -0.1, 1.5).
        """


def light_from_record(record: LightRecord, model: Model) -> Light | None:
    """Return the light of the registered kind that `record` describes."""
    light = LIGHTS[record.bl_type].from_record(record, model)
    texture = record.properties.get("node_texture")
    if light is None or texture is None:
        return light
    from ._textured import TexturedLight

    common = {field.name: getattr(light, field.name) for field in fields(Light)}
    place = record.world_from_light
    return TexturedLight(**common, plain=light, texture=texture, world_from_light=place)
