# SPDX-License-Identifier: GPL-3.0-or-later
"""The quantities of light, and the units to write them.

Five forms, each in three kinds. Radiant counts energy; luminous weights it with the eye's V(λ),
X_v = K_m ∫ V(λ) X_e,λ dλ; photon counts quanta of hc/λ.

K_m is 683 lm/W at 540 THz, which is 555.016 nm in air where V is just below 1: 683.002 at its
maximum. Older texts and lectures print 680, a value from before the candela of 1979.
"""

import math
from typing import Literal, NamedTuple

from .errors import unknown_name

Form = Literal["energy", "flux", "intensity", "irradiance", "radiance"]
Kind = Literal["radiant", "luminous", "photon"]

K_M = 683.002  # lm/W, the maximum luminous efficacy
EFFICACIES_LM_W = {"photopic": K_M, "cycles-ies": 177.83, "radiance": 179.0}  # conventions in use
GLTF_LM_W = 683.0  # by which Blender takes glTF's cd and lx for W/sr and W/m²
PLANCK = 6.62607015e-34  # J s
LIGHT_SPEED = 299_792_458.0  # m/s
AVOGADRO = 6.02214076e23  # 1/mol
FOOT = 0.3048  # m
UMOL = AVOGADRO * 1e-6
MIDDLE_GREY = 0.18  # scene-linear
PHOTOSYNTHETIC_NM = (400.0, 700.0)  # the photons that PPF and PPFD count
PRESETS = {  # sunlight of all wavelengths above the air, one astronomical unit from the sun
    "solar-constant": (1361.0, "W/m2"),  # IAU 2015 Resolution B3
    "solar-constant-1971": (1353.0, "W/m2"),  # NASA SP-8005, and lectures since
}


class Quantity(NamedTuple):
    """A quantity of light: its name as in public names, its SI unit as people write it."""

    name: str
    unit: str
    form: Form
    kind: Kind

    @property
    def words(self) -> str:
        return self.name.replace("_", " ")


_TABLE: dict[Form, tuple[str, str, str]] = {
    # Q; Φ = dQ/dt; I = dΦ/dω
    "energy": ("radiant_energy J", "luminous_energy lm·s", "photon_number 1"),
    "flux": ("radiant_flux W", "luminous_flux lm", "photon_flux 1/s"),
    "intensity": ("radiant_intensity W/sr", "luminous_intensity cd", "photon_intensity 1/(s sr)"),
    # E = dΦ/dA = ∫ L cos θ dω, arriving; L = d²Φ/(dA cos θ dω), what a pixel holds
    "irradiance": ("irradiance W/m²", "illuminance lx", "photon_irradiance 1/(m² s)"),
    "radiance": ("radiance W/(m² sr)", "luminance cd/m²", "photon_radiance 1/(m² s sr)"),
}
KINDS: tuple[Kind, ...] = ("radiant", "luminous", "photon")
QUANTITIES = {
    name: Quantity(name, unit, form, kind)
    for form, texts in _TABLE.items()
    for kind, (name, unit) in zip(KINDS, (text.split(" ", 1) for text in texts), strict=True)
}


def quantity(form: Form, kind: Kind) -> Quantity:
    return next(q for q in QUANTITIES.values() if (q.form, q.kind) == (form, kind))


class Unit(NamedTuple):
    """A unit: its SI value is factor · x^sign, or factor · 2^(sign · x) where x counts stops."""

    symbol: str
    form: Form
    kind: Literal["radiant", "luminous", "photon", "photosynthetic"]
    factor: float = 1.0
    definition: str = ""
    stops: bool = False
    sign: int = 1

    @property
    def quantity(self) -> Quantity:
        return quantity(self.form, "photon" if self.kind == "photosynthetic" else self.kind)

    def to_si(self, value: float) -> float:
        return self.factor * (2.0**value if self.stops else value) ** self.sign

    def from_si(self, value: float) -> float:
        ratio = (value / self.factor) ** self.sign
        if self.stops:
            return math.log2(ratio) if ratio > 0.0 else -math.inf
        return ratio


_PHOTONS = f"1 umol = {UMOL:.9g} photons"
_GREY = f"L_e = {MIDDLE_GREY}"
UNITS = {
    unit.symbol: unit
    for unit in (
        Unit("W", "flux", "radiant"),
        Unit("lm", "flux", "luminous"),
        Unit("photons/s", "flux", "photon"),
        Unit("umol/s", "flux", "photosynthetic", UMOL, _PHOTONS),
        Unit("J", "energy", "radiant"),
        Unit("lm.s", "energy", "luminous"),
        Unit("talbot", "energy", "luminous", 1.0, "1 talbot = 1 lm s"),
        Unit("W/sr", "intensity", "radiant"),
        Unit("cd", "intensity", "luminous"),
        Unit("W/m2", "irradiance", "radiant"),
        Unit("lx", "irradiance", "luminous"),
        Unit("fc", "irradiance", "luminous", FOOT**-2, "1 fc = 1 lm/ft²"),
        Unit("umol/m2/s", "irradiance", "photosynthetic", UMOL, _PHOTONS),
        Unit("W/m2/sr", "radiance", "radiant"),
        Unit("cd/m2", "radiance", "luminous"),
        Unit("nit", "radiance", "luminous", 1.0, "1 nit = 1 cd/m²"),
        Unit("fl", "radiance", "luminous", FOOT**-2 / math.pi, "1 fl = 1/π cd/ft²"),
        Unit("EV100", "radiance", "luminous", 0.125, "L_v = 0.125 · 2^EV100", True),
        Unit("film-exposure", "radiance", "radiant", MIDDLE_GREY, f"{_GREY}/film", False, -1),
        Unit("view-exposure", "radiance", "radiant", MIDDLE_GREY, f"{_GREY}/2^view", True, -1),
    )
}


def ev100(f_number: float, shutter: float, iso: float) -> float:
    """Return EV100 of an aperture N, a shutter time [s] and a film speed S."""
    return math.log2(f_number**2 / shutter * 100.0 / iso)


def unit_named(symbol: str) -> Unit:
    """Return the unit of that symbol, in ASCII or not."""
    plain = symbol.translate(str.maketrans("²·µμ", "2.uu"))
    if plain not in UNITS:
        raise unknown_name("unit", symbol, "UNIT", list(UNITS))
    return UNITS[plain]
