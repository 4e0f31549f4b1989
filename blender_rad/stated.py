# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light is in any unit: light is linear in Blender's number, so that one factor tells.

Lumens, candelas, lux and nits are efficacy × the luminance weights of R, G and B, as a picture has
them: two lamps of 800 lm look alike whatever their spectra. Watts are what the spectrum of the
light needs for these lumens; without a spectrum the mean of R, G and B, which is Blender's own
number where the light is white.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Floats
from .lights import Light, LightRecord, Model, light_from_record
from .quantities import K_M, unit_named
from .spectra import Spectrum
from .working_space import xyz_from_rgb

GRID = 64  # a side, of the samples where no closed form holds
FORMS = {  # units by Blender's type of emitter, the usual one first
    **dict.fromkeys(
        ("POINT", "SPOT", "AREA"),
        ("W", "lm", "cd", "W/sr", "lx", "W/m2", "cd/m2", "W/m2/sr", "EV100"),
    ),
    "SUN": ("W/m2", "lx", "cd/m2", "W/m2/sr", "EV100"),
    "WORLD": ("W/m2/sr", "cd/m2", "EV100", "W/m2", "lx"),
    "MATERIAL": ("W/m2/sr", "cd/m2", "EV100"),
}


@dataclass(frozen=True)
class Convention:
    """How watts become lumens, and where lux are read.

    `lm_per_W` is of the light's own spectrum, None where it states none.
    """

    weights: tuple[float, float, float]  # of R, G and B in luminance
    efficacy: float = K_M  # lumens of a Blender watt [lm/W], for all lights of a scene
    lm_per_W: float | None = None  # noqa: N815 - the unit's own spelling
    distance: float = 1.0  # along the light's axis, of units that need one [m]


def unit_for(kind: str, unit: str) -> str:
    """Return `unit` where that kind of emitter has it, else its usual one of the same sort."""
    fit, sort = FORMS[kind], unit_named(unit).kind
    return unit if unit in fit else next(u for u in fit if unit_named(u).kind == sort)


def per_energy(record: LightRecord, unit: str, convention: Convention, model: Model) -> float:
    """Return what the light would be in the SI unit of `unit`, had it 1 of Blender's energy.

    0 where it emits nothing, nan or inf where the quantity has no meaning for it.
    """
    one = replace(record, properties={**record.properties, "energy": 1.0})
    light = math.nan if record.unknown else light_from_record(one, model)
    if not isinstance(light, Light):
        return light or 0.0
    place, metre = record.world_from_light, record.unit_scale_m
    axis = -place[:3, 2] / np.linalg.norm(place[:3, 2])
    point = place[:3, 3] + axis * (convention.distance / metre)
    return amount(light, unit, convention, metre, (point, -axis))


def amount(
    light: Light,
    unit: str,
    convention: Convention,
    metre: float = 1.0,
    lit: tuple[Floats, Floats] | None = None,
) -> float:
    """Return what leaves a light, in the SI unit of `unit`.

    `metre` are those of a Blender unit; `lit` is a point [bu] and normal of what near lights light.
    """
    kind, form = unit_named(unit).kind, unit_named(unit).form
    if form == "irradiance":
        rgb = light.facing_irradiance()
        if lit and np.isnan(rgb).any():
            rgb = arriving(light, *lit)
    elif form == "radiance":
        rgb = light.peak_radiance()
    else:
        rgb = light.leaving_flux() if form == "flux" else light.peak_radiant_intensity()
        rgb = rgb * metre**2
    luminous = convention.efficacy * float(np.array(convention.weights) @ rgb)
    if kind == "luminous":
        return luminous
    return luminous / convention.lm_per_W if convention.lm_per_W else float(rgb.mean())


def arriving(light: Light, point: Floats, normal: Floats) -> Floats:
    """Return the irradiance (3,) [W/m²] at `point` (3,) [bu] facing `normal`, nothing between."""
    points, normals = point[None], normal[None]
    exact = light.irradiance(points, normals)
    if exact is not None and np.isfinite(exact).all():
        return light.rgb * exact[0]
    side = (np.arange(GRID) + 0.5) / GRID
    u = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    sample = light.sample(np.repeat(points, len(u), 0), np.repeat(normals, len(u), 0), u)
    arrived = (sample.weight * np.maximum(sample.wi @ normal, 0.0))[:, None]
    return light.rgb * np.mean(arrived if sample.tint is None else arrived * sample.tint, axis=0)


def colour(light: Spectrum, chromaticities: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the colour of a spectrum in a working space, its largest channel 1, none below 0."""
    rgb = np.maximum(np.linalg.solve(xyz_from_rgb(chromaticities), light.xyz), 0.0)
    red, green, blue = (rgb / rgb.max()).tolist()
    return red, green, blue
