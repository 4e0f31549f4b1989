# SPDX-License-Identifier: GPL-3.0-or-later
"""The quantities of light: name, symbol, unit, definition and twin, in one table.

Six forms, each in four kinds. Radiant counts energy; spectral counts it per nanometre; luminous
weights it with the eye's V(λ), X_v = K_m ∫ V(λ) X_e,λ dλ; photon counts quanta of hc/λ. Docs,
panels, JSON keys and messages take their words from here.

K_m is 683 lm/W at 540 THz, which is 555.016 nm in air where V is just below 1: 683.002 at its
maximum. Older texts print 680, the value before the candela of 1979, rounded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, NamedTuple

Form = Literal["energy", "flux", "intensity", "irradiance", "exitance", "radiance"]
Kind = Literal["radiant", "luminous", "photon", "spectral"]

K_M = 683.002  # lm/W, the maximum luminous efficacy
EFFICACIES_LM_W = {"photopic": K_M, "cycles-ies": 177.83, "radiance": 179.0}  # conventions in use
PLANCK = 6.62607015e-34  # J s
LIGHT_SPEED = 299_792_458.0  # m/s
AVOGADRO = 6.02214076e23  # 1/mol
PHOTOSYNTHETIC_NM = (400.0, 700.0)  # the photons that PPF and PPFD count


class Preset(NamedTuple):
    """A number with a name; `unit` as `convert` writes it."""

    value: float
    unit: str
    source: str


PRESETS = {
    "solar-constant": Preset(
        1361.0, "W/m2", "sunlight above the air at 1 au, all wavelengths (IAU 2015 B3)"
    ),
    "solar-constant-1971": Preset(
        1353.0, "W/m2", "the same as NASA put it in 1971, and lectures since (Thekaekara)"
    ),
}


@dataclass(frozen=True)
class Quantity:
    """A quantity of light.

    Attributes
    ----------
    name : full words with underscores, as in public names.
    symbol : as in equations; indices e, v, p, λ tell the kinds apart.
    unit : SI, as people write it.
    definition : one sentence or equation.
    twin : the luminous quantity of a radiant one and the reverse; None for the other kinds.
    """

    name: str
    symbol: str
    unit: str
    definition: str
    form: Form
    kind: Kind
    twin: str | None = None

    @property
    def key(self) -> str:
        """The key in JSON, which ends in the unit: ``radiance_W_m2_sr``."""
        plain = self.unit.translate(str.maketrans({"²": "2", "(": "", ")": ""}))
        return f"{self.name}_{re.sub('[/ ·]+', '_', plain)}"


# form: symbol, radiant, luminous and photon name, their units, definition
_TABLE: dict[Form, tuple[str, tuple[str, str, str], tuple[str, str, str], str]] = {
    "energy": (
        "Q",
        ("radiant_energy", "luminous_energy", "photon_number"),
        ("J", "lm·s", "1"),
        "what is carried: Q = ∫ Φ dt",
    ),
    "flux": (
        "Φ",
        ("radiant_flux", "luminous_flux", "photon_flux"),
        ("W", "lm", "1/s"),
        "what flows per time, power: Φ = dQ/dt",
    ),
    "intensity": (
        "I",
        ("radiant_intensity", "luminous_intensity", "photon_intensity"),
        ("W/sr", "cd", "1/(s sr)"),
        "flux per solid angle in a direction: I = dΦ/dω",
    ),
    "irradiance": (
        "E",
        ("irradiance", "illuminance", "photon_irradiance"),
        ("W/m²", "lx", "1/(m² s)"),
        "flux that arrives per area: E = dΦ/dA = ∫ L cos θ dω",
    ),
    "exitance": (
        "M",
        ("radiant_exitance", "luminous_exitance", "photon_exitance"),
        ("W/m²", "lm/m²", "1/(m² s)"),
        "flux that leaves per area, radiosity: M = dΦ/dA",
    ),
    "radiance": (
        "L",
        ("radiance", "luminance", "photon_radiance"),
        ("W/(m² sr)", "cd/m²", "1/(m² s sr)"),
        "flux per projected area and solid angle, what a pixel holds: L = d²Φ/(dA cos θ dω)",
    ),
}


def _per_nanometre(unit: str) -> str:
    over, _, under = unit.partition("/")
    return f"{over}/({under.strip('()')} nm)" if under else f"{over}/nm"


def _quantities() -> dict[str, Quantity]:
    entries: list[Quantity] = []
    for form, (symbol, names, units, text) in _TABLE.items():
        radiant, luminous, photon = names
        spectral = f"spectral_{radiant}"
        dx = f"per wavelength: {symbol}_λ = d{symbol}_e/dλ"
        entries += [
            Quantity(radiant, f"{symbol}_e", units[0], text, form, "radiant", luminous),
            Quantity(luminous, f"{symbol}_v", units[1], text, form, "luminous", radiant),
            Quantity(photon, f"{symbol}_p", units[2], text, form, "photon"),
            Quantity(spectral, f"{symbol}_λ", _per_nanometre(units[0]), dx, form, "spectral"),
        ]
    return {entry.name: entry for entry in entries}


QUANTITIES = _quantities()


def quantity(form: Form, kind: Kind) -> Quantity:
    """Return the quantity of that form and kind."""
    return next(q for q in QUANTITIES.values() if (q.form, q.kind) == (form, kind))
