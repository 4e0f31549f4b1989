# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of light sources: what a watt of them is in lumens, photons and colour.

============================ ======================================================================
name                         spectrum
============================ ======================================================================
``D65``, ``FL2``, ``LED-B3`` a CIE illuminant, as tabulated
``blackbody:K``              Planck's law
``temperature:K``            what Blender makes of it: a blackbody, constant outside 800–12000 K
``rgb:R,G,B``                a Blender colour, linear Rec.709: D65 through the reflectances of
                             Mallett and Yuksel 2019, whose sum is 1
``laser:NM``                 one wavelength
``FILE.csv``                 two columns, wavelength in nm and relative spectral power
============================ ======================================================================

A radiant watt is the power between the limits that the spectrum states: 380 to 780 nm, a file's
own, a laser's line, or those asked for. Beyond them it has none. Wavelengths are as tabulated, in
air; photons count hc/λ with them, 0.03 % from vacuum's.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

from .arrays import Floats
from .errors import RadError, unknown_name
from .lights._emission import RANGE_K
from .quantities import K_M, LIGHT_SPEED, PHOTOSYNTHETIC_NM, PLANCK

Limits = tuple[float, float]

VISIBLE_NM: Limits = (380.0, 780.0)
RANGE_NM: Limits = (100.0, 1e5)  # where a wavelength in nm is one of light
NM = 1e-9  # m
SECOND_RADIATION = 1.438776877e7  # nm K, hc/k
LARGEST_DUV = 0.05  # beyond it CIE 15 gives a colour no temperature
WHERE = "--spectrum"
FORMS = "blackbody:K, temperature:K, laser:NM, rgb:R,G,B or FILE.csv"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A spectrum, of which only the shape counts."""

    name: str  # what was asked for
    wavelengths: Floats  # (n,) [nm], increasing; a single one is a line
    density: Floats  # (n,) relative spectral power, linear in between

    @property
    def limits_nm(self) -> Limits:
        """Wavelengths between which its watts are counted."""
        return float(self.wavelengths[0]), float(self.wavelengths[-1])

    @property
    def title(self) -> str:
        """Its name and its limits, for people."""
        low, high = self.limits_nm
        return self.name if low == high else f"{self.name}, {low:g}–{high:g} nm"

    def _per_watt(self, weight: Floats, within: Limits = RANGE_NM) -> float:
        """Return ∫ S weight dλ `within` over ∫ S dλ, by the trapezoidal rule."""
        x, y = self.wavelengths, self.density * weight
        inside = (x >= within[0]) & (x <= within[1])
        if len(x) == 1:
            return float(weight[0]) * bool(inside[0])
        return _integral(x[inside], y[inside]) / _integral(x, self.density)

    @property
    def efficacy_lm_W(self) -> float:
        """Luminous efficacy of radiation K = K_m ∫ S V dλ / ∫ S dλ [lm/W]."""
        return K_M * self._per_watt(_observer(self.wavelengths)[1])

    @property
    def xyz(self) -> list[float]:
        """Its colour, CIE 1931 X, Y, Z a watt."""
        return [self._per_watt(bar) for bar in _observer(self.wavelengths)]

    def photons_per_J(self, within: Limits = RANGE_NM) -> float:
        """Return photons of wavelengths `within` a joule, ∫ S λ dλ / (hc ∫ S dλ)."""
        return self._per_watt(self.wavelengths * NM / (PLANCK * LIGHT_SPEED), within)

    def described(self) -> dict[str, object]:
        """Return limits, efficacy, photons, correlated temperature, Duv and CIE R_a, by JSON key.

        The last three are None where the colour is too far from white.
        """
        temperature, duv = colour_temperature(self.xyz)
        rendering = None
        if temperature is not None:
            grid = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1.0, 5.0)
            values = np.interp(grid, self.wavelengths, self.density, left=0.0, right=0.0)
            table = _colour().SpectralDistribution(values, grid)
            rendering = float(_colour().colour_rendering_index(table))
        return {
            "name": self.name,
            "limits_nm": self.limits_nm,
            "efficacy_lm_W": self.efficacy_lm_W,
            "photons_per_J": self.photons_per_J(),
            "photosynthetic_photons_per_J": self.photons_per_J(PHOTOSYNTHETIC_NM),
            "correlated_colour_temperature_K": temperature,
            "duv": duv,
            "colour_rendering_index": rendering,
        }


def spectrum(name: str, limits: Limits | None = None) -> Spectrum:
    """Return the spectrum of that name, between `limits` [nm].

    RadError is for an unknown name, a file that is none, limits beyond what is tabulated, and where
    there is no power between them.
    """
    if limits and not RANGE_NM[0] <= limits[0] < limits[1] <= RANGE_NM[1]:
        expected = f"expected two wavelengths of {RANGE_NM[0]:g} to {RANGE_NM[1]:g} nm, rising"
        raise RadError("not limits", "--limits", expected)
    kind, colon, text = name.partition(":")
    if name.lower().endswith(".csv"):
        return _tabulated(name, _read_csv(Path(name)), limits)
    if not colon:
        known = {entry.lower(): entry for entry in _colour().SDS_ILLUMINANTS}
        if name.lower() not in known:
            raise unknown_name("spectrum", name, WHERE, [*known.values(), FORMS])
        table = _colour().SDS_ILLUMINANTS[known[name.lower()]]
        return _tabulated(name, (table.wavelengths, table.values), limits, VISIBLE_NM)
    numbers = _numbers(name, kind, text)
    if kind == "rgb":
        basis = _colour().recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
        white = _colour().SDS_ILLUMINANTS["D65"][basis.wavelengths]
        return _tabulated(name, (basis.wavelengths, white * (basis.values @ numbers)), limits)
    if kind == "laser":
        low, high = limits or RANGE_NM
        if not low <= numbers[0] <= high:
            raise RadError(f"{name} is out of range", WHERE, f"expected {low:g} to {high:g} nm")
        return Spectrum(name, numbers, np.ones(1))
    kelvin = numbers[0] if kind == "blackbody" else np.clip(numbers[0], *RANGE_K)
    x = _grid(*(limits or VISIBLE_NM))
    exponent = SECOND_RADIATION / (x * kelvin)  # scaled so that no temperature underflows
    return Spectrum(name, x, np.exp(exponent.min() - exponent) / (-np.expm1(-exponent) * x**5))


def colour_temperature(xyz: Sequence[float]) -> tuple[float | None, float | None]:
    """Return correlated colour temperature [K] and Duv of a colour (CIE 1931 X, Y, Z).

    None for both where |Duv| is above 0.05, where CIE 15 defines no temperature, and beyond
    1000–100 000 K. Ohno 2013, doi:10.1080/15502724.2014.839020.
    """
    x, y, z = xyz
    total = x + 15.0 * y + 3.0 * z
    if not total > 0.0:
        return None, None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = _colour().temperature.uv_to_CCT_Ohno2013([4.0 * x / total, 6.0 * y / total])
        except Warning:  # its table of temperatures has ended
            return None, None
    temperature, duv = map(float, found)
    return (temperature, duv) if abs(duv) <= LARGEST_DUV else (None, None)


@cache
def _colour() -> ModuleType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it names the optional packages that it did not find
        import colour
    return colour


def _observer(x: Floats) -> Floats:
    """Return x̄, ȳ = V, z̄ of CIE 1931 at wavelengths (n,), as (3, n); 0 outside 360–830 nm."""
    table = _colour().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    bars = np.asarray(table.values).T
    return np.stack([np.interp(x, table.wavelengths, bar, left=0.0, right=0.0) for bar in bars])


def _integral(x: Floats, y: Floats) -> float:
    return float(np.sum(0.5 * np.diff(x) * (y[1:] + y[:-1])))


def _grid(low: float, high: float) -> Floats:
    """Return both limits and every whole nanometre between."""
    return np.union1d(np.arange(math.ceil(low), high, dtype=np.float64), [low, high])


def _tabulated(
    name: str, table: tuple[Floats, Floats], limits: Limits | None, usual: Limits = RANGE_NM
) -> Spectrum:
    """Return a table between `limits`, or as much of it as is in the `usual` ones."""
    x, y = table
    low, high = float(x[0]), float(x[-1])
    inner = limits or (max(usual[0], low), min(usual[1], high))
    if not low <= inner[0] < inner[1] <= high:
        what = f"{name} is not known from {inner[0]:g} to {inner[1]:g} nm"
        raise RadError(what, "--limits", f"expected limits within {low:g},{high:g}")
    grid = np.union1d(_grid(*inner), x[(x > inner[0]) & (x < inner[1])])
    density = np.interp(grid, x, y)
    if not density.any():
        raise RadError(f"{name} has no power", WHERE, f"expected some in {inner[0]:g}–{inner[1]:g}")
    return Spectrum(name, grid, density)


def _numbers(name: str, kind: str, text: str) -> Floats:
    """Return the numbers of ``kind:number`` or ``rgb:number,number,number``."""
    try:
        numbers = np.array([float(entry) for entry in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    right = len(numbers) == {"blackbody": 1, "temperature": 1, "laser": 1, "rgb": 3}.get(kind)
    if not (right and np.isfinite(numbers).all() and numbers.min() >= 0.0 and numbers.any()):
        expected = f"expected {FORMS}, with numbers above 0"
        raise RadError(f"{name} is not a spectrum", WHERE, expected)
    return numbers


def _read_csv(path: Path) -> tuple[Floats, Floats]:
    """Return wavelengths [nm] and spectral power of a file, headings aside."""
    expected = "expected two columns: rising wavelengths in nm, and powers of 0 or more"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an empty file
            table = np.genfromtxt(path, delimiter=",", ndmin=2, encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise RadError(" ".join(str(error).split()), str(path), expected) from None
    if table.ndim != 2 or table.shape[1:] != (2,):
        raise RadError("not two columns", str(path), expected)
    x, y = table[np.maximum.accumulate(np.isfinite(table[:, 0]))].T
    low, high = RANGE_NM
    rising = len(x) > 1 and (np.diff(x, prepend=low - 1.0, append=high + 1.0) > 0.0).all()
    if not (rising and np.isfinite(y).all() and (y >= 0.0).all()):
        raise RadError("not a spectrum", str(path), expected)
    return x, y
