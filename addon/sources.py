# SPDX-License-Identifier: GPL-3.0-or-later
"""Real sources of light: how much, what colour, how large, who says so, and how sure that is."""

import math
from functools import cache
from typing import Any, NamedTuple

from .stating import unit_scale

USUAL = "typical value, manufacturers' data sheets"
BARE = USUAL + "; the lamp alone, before the optics"
SUN = "127.5 klx exp(-0.21/sin h), after the IES daylight calculation of 1984; colour approximate"
BLUE, WHITE = "D65", "LED-B3"


class Source(NamedTuple):
    """A row: `size` is a radius, or the sides of a rectangle [m], of a sun its full angle [rad]."""

    kind: str
    value: float
    unit: str
    spectrum: str
    size: tuple[float, ...]
    uncertainty_percent: float
    origin: str


BULB, TUBE, DISC = (0.03,), (1.2, 0.026), (math.radians(0.533),)
KELVIN = ((15, 3500), (25, 4400), (38, 4900), (53, 5200), (90, 5400))  # of suns up to a height


def _sun(degrees: float) -> Source:
    """Return the sun at a height over the horizon, without the sky."""
    lux = round(127500 * math.exp(-0.21 / math.sin(math.radians(degrees))), -2)
    kelvin = next(kelvin for height, kelvin in KELVIN if degrees <= height)
    return Source('SUN', lux, 'lx', f"blackbody:{kelvin}", DISC, 20, SUN)


def _height_at(hour: float, latitude: float) -> float:
    """Return the sun's height [°] at an hour of true local time on a day of equinox."""
    turn = math.radians(15.0 * (hour - 12.0))
    return math.degrees(math.asin(math.cos(math.radians(latitude)) * math.cos(turn)))


SOURCES = {
    "Candle": Source('POINT', 12.6, 'lm', "blackbody:1900", (0.008,), 30, "about 1 cd all round"),
    "Hefner lamp": Source(
        'POINT', 0.903, 'cd', "blackbody:1880", (0.01,), 2, "the German standard until 1942"
    ),
    **{
        f"Incandescent bulb {watts} W (230 V)": Source(
            'POINT', lumens, 'lm', "temperature:2700", BULB, 10, USUAL
        )
        for watts, lumens in ((40, 415), (60, 710), (100, 1340))
    },
    **{
        f"LED bulb, replaces {watts} W": Source('POINT', lumens, 'lm', "LED-B1", BULB, 15, USUAL)
        for watts, lumens in ((25, 249), (40, 470), (60, 806), (75, 1055), (100, 1521))
    },
    "Compact fluorescent, replaces 60 W": Source('POINT', 741, 'lm', "FL12", BULB, 15, USUAL),
    "Halogen bulb, replaces 60 W": Source('POINT', 702, 'lm', "temperature:2800", BULB, 15, USUAL),
    "Fluorescent tube T8 18 W / 840": Source('AREA', 1350, 'lm', "FL11", (0.59, 0.026), 10, USUAL),
    "Fluorescent tube T8 36 W / 840": Source('AREA', 3350, 'lm', "FL11", TUBE, 10, USUAL),
    "Fluorescent tube T8 58 W / 840": Source('AREA', 5200, 'lm', "FL11", (1.5, 0.026), 10, USUAL),
    "Fluorescent tube T5 28 W / 840": Source('AREA', 2600, 'lm', "FL11", (1.15, 0.016), 10, USUAL),
    "LED office panel 60 × 60 cm": Source(
        'AREA', 3700, 'lm', WHITE, (0.6, 0.6), 20, USUAL
    ),
    "Studio tungsten lamp 1000 W": Source(
        'POINT', 26000, 'lm', "blackbody:3200", (0.01,), 15, BARE
    ),
    "Studio HMI lamp 575 W": Source('POINT', 49000, 'lm', "D55", (0.005,), 15, BARE),
    "Studio HMI lamp 1200 W": Source('POINT', 110000, 'lm', "D55", (0.006,), 15, BARE),
    "Studio HMI lamp 2500 W": Source('POINT', 240000, 'lm', "D55", (0.008,), 15, BARE),
    "Street, high-pressure sodium 70 W": Source('POINT', 6000, 'lm', "HP1", (0.03,), 10, USUAL),
    "Street, high-pressure sodium 150 W": Source('POINT', 15000, 'lm', "HP1", (0.03,), 10, USUAL),
    "Street, low-pressure sodium 180 W": Source(
        'POINT', 32500, 'lm', "laser:589.3", (0.1,), 10, USUAL
    ),
    "Street, mercury vapour 125 W": Source(
        'POINT', 6300, 'lm', "temperature:3800", (0.035,), 15, USUAL + "; its spectrum is lines"
    ),
    "Car lamp H7": Source('POINT', 1500, 'lm', "temperature:3200", (0.002,), 15, USUAL),
    "Car lamp H11": Source('POINT', 1350, 'lm', "temperature:3200", (0.002,), 15, USUAL),
    "Screen, sRGB reference": Source('AREA', 80, 'cd/m2', BLUE, (0.6, 0.34), 1, "IEC 61966-2-1"),
    "Screen, HDTV reference white": Source(
        'AREA', 100, 'cd/m2', BLUE, (0.94, 0.53), 1, "ITU-R BT.2035"
    ),
    "Screen, HDR reference white": Source(
        'AREA', 203, 'cd/m2', BLUE, (0.94, 0.53), 1, "ITU-R BT.2408"
    ),
    "Cinema screen": Source('AREA', 48, 'cd/m2', BLUE, (12.0, 5.0), 20, "usual projected white"),
    **{f"Sun, {height}° high, clear sky": _sun(height) for height in (10, 20, 30, 45, 60)},
    **{
        f"Sun at {hour} or {24 - hour} h, equinox, 50° north, clear sky": _sun(_height_at(hour, 50))
        for hour in (8, 9, 10, 11)
    },
    "Sun at noon, equinox, 50° north, clear sky": _sun(_height_at(12, 50)),
    "Full moon, high": Source(
        'SUN', 0.2, 'lx', "blackbody:4100", (math.radians(0.52),), 50, "0.1 to 0.3 lx by height"
    ),
}  # fmt: skip


@cache
def items() -> list[tuple[str, str, str]]:
    """Return the sources as items of a menu."""
    return [
        (
            name,
            name,
            f"{s.value:g} {s.unit} ± {s.uncertainty_percent:g} %; {s.spectrum}. {s.origin}",
        )
        for name, s in SOURCES.items()
    ]


def apply(light: Any, source: Source) -> None:
    """Make `light` that source; what else it has is put to rest."""
    light.type = source.kind
    light = light.type_recast()
    for name, rest in (("normalize", True), ("exposure", 0.0), ("spread", math.pi)):
        if hasattr(light, name):
            setattr(light, name, rest)
    metre = unit_scale()
    if source.kind == 'SUN':
        light.angle = source.size[0]
    elif source.kind == 'POINT':
        light.shadow_soft_size, light.use_soft_falloff = source.size[0] / metre, False
    else:
        light.shape = 'RECTANGLE'
        light.size, light.size_y = (side / metre for side in source.size)
    group = light.radiometry
    group.unit = source.unit
    group.spectrum = source.spectrum
    group.value = source.value
