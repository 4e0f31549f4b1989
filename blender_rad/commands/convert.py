# SPDX-License-Identifier: GPL-3.0-or-later
"""``convert``: from unit to unit, through an emitter's shape and its spectrum."""

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..errors import RadError
from ..quantities import PRESETS, UNITS, ev100, unit_named
from . import _values as values
from ._base import Command, Outcome, option

EXPOSURE = re.compile(r"f/([\d.]+),([\d./]+),ISO(\d+)", re.IGNORECASE)
AMOUNT = f"a number, {', '.join(PRESETS)}, or an exposure as f/8,1/125,ISO100"
SHAPE = ("distance", "area", "radius", "cone", "blend", "spread", "angle", "duration")
ANGLES = {"cone", "spread", "angle"}


def _amount(value: Any) -> tuple[float, str | None]:
    """Return a number and, where it has one of its own, its unit."""
    if exposure := EXPOSURE.fullmatch(str(value)):
        return ev100(*(float(Fraction(part)) for part in exposure.groups())), "EV100"
    return PRESETS[value] if value in PRESETS else (values.number()(value), None)


amount = values.Value("VALUE", AMOUNT, _amount)


@dataclass(frozen=True, kw_only=True)
class ConvertOptions(Command, verb="convert"):
    """Convert light from unit to unit, through the emitter's shape and its spectrum."""

    value: tuple[float, str | None] = option(amount, AMOUNT, positional=True)
    unit: str = option(values.text, f"one of {' '.join(UNITS)}", metavar="UNIT", positional=True)
    to: str = option(values.text, "the unit wanted", metavar="UNIT", required=True)
    emitter: str | None = option(values.text, "point, sphere, spot, area, mesh, sun or sky")
    distance: float | None = option(values.number(0), "from the emitter's centre", metavar="M")
    area: float | None = option(values.number(0), "emitter's; sun, sky: what is lit", metavar="M2")
    radius: float | None = option(values.number(0), "of a ball", metavar="M")
    cone: float | None = option(values.number(), "full angle of a spot", metavar="DEG")
    blend: float | None = option(values.number(), "of a spot (default: 0, hard)", metavar="0-1")
    spread: float | None = option(
        values.number(), "full angle of an area (default: 180)", metavar="DEG"
    )
    angle: float | None = option(values.number(), "full angle of the sun's disc", metavar="DEG")
    duration: float | None = option(values.number(0), "from flux to energy", metavar="S")
    spectrum: str | None = option(
        values.text,
        "D65, FL2, LED-B3 …, blackbody:K, temperature:K, laser:NM, rgb:R,G,B or FILE.csv",
    )
    limits: tuple[float, float] | None = option(
        values.vector(2), "nm between which its watts count (default: 380,780)", metavar="A,B"
    )
    efficacy: float | None = option(
        values.efficacy, "instead of a spectrum: a convention, or lm per W"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("spectrum", "efficacy")
        self.require("limits", "spectrum")

    def run(self) -> Outcome:
        from ..spectra import spectrum
        from ..units import convert

        value, own = self.value
        if own not in (None, self.unit):
            raise RadError(f"this value is not in {self.unit}", "UNIT", f"expected {own}")
        shape = {name: getattr(self, name) for name in SHAPE if getattr(self, name) is not None}
        shape |= {name: math.radians(shape[name]) for name in ANGLES & shape.keys()}
        light = spectrum(self.spectrum, self.limits) if self.spectrum else None
        result = convert(
            value,
            self.unit,
            self.to,
            emitter=self.emitter,
            shape=shape,
            light=light or self.efficacy,
        )
        came, quantity = (unit_named(unit).quantity for unit in (self.unit, self.to))
        document = {
            "value": result.value,
            "unit": self.to,
            "quantity": quantity.name,
            "from": {"value": value, "unit": self.unit, "quantity": came.name},
            "efficacy_lm_W": result.efficacy_lm_W,
            "formula": result.formula,
            "spectrum": light and light.described(),
        }
        first = f"{result.value:.7g} {self.to} {quantity.words}"
        return Outcome(document, f"{first}\n  {result.formula}")
