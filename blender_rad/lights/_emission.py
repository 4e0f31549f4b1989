# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour times power that a Blender light states, before its shape comes in."""

from __future__ import annotations

import warnings

import numpy as np

from ..working_space import REC709, rec709_from_working
from ._base import Array, LightRecord

DAYLIGHT_K = 6500.0  # Blender's default temperature
RANGE_K = (800.0, 12000.0)  # Blender's colours are constant outside


def stated_emission(record: LightRecord) -> Array:
    """Return P = energy · 2^exposure · color · temperature colour · node emission, (3,).

    It is in W for point, spot and area lights and in W/m² for suns; without `normalize` it is
    radiant exitance [W/m²] (or, for suns, radiance [W/(m² sr)]).

    Model: Cycles multiplies these in this way in Blender 4.5 and 5.2. ``node_emission`` is what
    the reader of the light's node tree puts into the record, where that is a constant.
    """
    properties = record.properties
    power = float(properties["energy"]) * 2.0 ** float(properties.get("exposure", 0.0))
    colour = np.array(properties.get("color", (1.0, 1.0, 1.0)), dtype=np.float64)[:3]
    if properties.get("use_temperature", False):
        colour = colour * _temperature_colour(record)
    return power * colour * np.asarray(properties.get("node_emission", 1.0), dtype=np.float64)


def casts_shadow(record: LightRecord) -> bool:
    """Return whether surfaces hide the light: ``light.use_shadow``, the one switch in 4.5 and 5.2.

    The switch of its own that Cycles had before is gone in both.
    """
    return bool(record.properties.get("use_shadow", True))


def _temperature_colour(record: LightRecord) -> Array:
    """Return Blender's own ``temperature_color`` (3,) where the record has it, else compute it."""
    stored = record.properties.get("temperature_color")
    if stored is not None:
        return np.array(stored, dtype=np.float64)[:3]
    return blackbody_rgb(float(record.properties.get("temperature", DAYLIGHT_K)))


def blackbody_rgb(temperature: float, chromaticities: tuple[float, ...] = REC709) -> Array:
    """Return the linear colour (3,) of a blackbody, of luminance 1, in a working space.

    Planck's law under the CIE 1931 2° observer at 1 nm; channels outside the gamut are clipped to
    0 and temperatures to 800–12000 K, as Blender does; it agrees with Blender's table to 0.3 %.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it names the optional packages that it did not find
        import colour

    shape = colour.SpectralShape(360, 830, 1)
    spectrum = colour.sd_blackbody(min(max(temperature, RANGE_K[0]), RANGE_K[1]), shape)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    xyz = np.asarray(colour.sd_to_XYZ(spectrum, observer, method="Integration"))
    rgb = colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ (xyz / xyz[1])
    return np.maximum(np.linalg.solve(rec709_from_working(chromaticities), rgb), 0.0)
