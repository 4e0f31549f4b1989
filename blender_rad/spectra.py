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

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import RadError, unknown_name
from .lights._emission import RANGE_K
from .quantities import K_M, LIGHT_SPEED, PHOTOSYNTHETIC_NM, PLANCK

Array = NDArray[np.float64]
Limits = tuple[float, float]

VISIBLE_NM: Limits = (380.0, 780.0)
RANGE_NM: Limits = (10.0, 1e6)  # where a wavelength in nm is one of light
NM = 1e-9  # m
SECOND_RADIATION = 1.438776877e7  # nm K, hc/k
LARGEST_DUV = 0.05  # beyond it CIE 15 gives a colour no temperature
WHERE = "--spectrum"
FORMS = "blackbody:K, temperature:K, laser:NM, rgb:R,G,B or FILE.csv"


class Colour(NamedTuple):
    """Correlated temperature [K], distance from the Planckian locus (CIE 1960), CIE R_a."""

    temperature_K: float | None  # noqa: N815 - the unit's own spelling
    duv: float | None
    rendering_index: float | None


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A spectrum, of which only the shape counts.

    Attributes
    ----------
    name : what was asked for.
    wavelengths : (n,) [nm], increasing; a single one is a line.
    density : (n,) relative spectral power, linear in between.
    """

    name: str
    wavelengths: Array
    density: Array

    @property
    def limits_nm(self) -> Limits:
        """Wavelengths between which its watts are counted."""
        return float(self.wavelengths[0]), float(self.wavelengths[-1])

    def _per_watt(self, weight: Array, within: Limits = RANGE_NM) -> float:
        """Return ∫ S weight dλ between the limits over ∫ S dλ, by the trapezoidal rule."""
        x, y = self.wavelengths, self.density * weight
        inside = (x >= within[0]) & (x <= within[1])
        if len(x) == 1:
            return float(weight[0]) * bool(inside[0])
        return _integral(x[inside], y[inside]) / _integral(x, self.density)

    @property
    def efficacy_lm_W(self) -> float:
        """Luminous efficacy of radiation K = K_m ∫ S V dλ / ∫ S dλ [lm/W]."""
        return K_M * self._per_watt(_observer(self.wavelengths)[:, 1])

    @property
    def photons_per_J(self) -> float:
        """Photons a joule, ∫ S λ dλ / (hc ∫ S dλ)."""
        return self._per_watt(self.wavelengths * NM / (PLANCK * LIGHT_SPEED))

    @property
    def photosynthetic_photons_per_J(self) -> float:
        """The same of photons of 400–700 nm alone, which PPF and PPFD count."""
        return self._per_watt(self.wavelengths * NM / (PLANCK * LIGHT_SPEED), PHOTOSYNTHETIC_NM)

    @cached_property
    def colour(self) -> Colour:
        """Correlated temperature, Duv and R_a; None where the colour is too far from white."""
        observer = _observer(self.wavelengths)
        temperature, duv = colour_temperature([self._per_watt(bar) for bar in observer.T])
        if temperature is None:
            return Colour(None, None, None)
        grid = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1.0, 5.0)
        values = np.interp(grid, self.wavelengths, self.density, left=0.0, right=0.0)
        colour = _colour()
        rendering = colour.colour_rendering_index(colour.SpectralDistribution(values, grid))
        return Colour(temperature, duv, float(rendering))


def luminous_efficacy(name: str, limits: Limits | None = None) -> float:
    """Return the luminous efficacy of radiation [lm/W] of the spectrum of that name."""
    return spectrum(name, limits).efficacy_lm_W


def spectrum(name: str, limits: Limits | None = None) -> Spectrum:
    """Return the spectrum of that name, between `limits` [nm].

    Raises
    ------
    RadError
        For an unknown name, a file that is none, limits beyond what is tabulated, and where there
        is no power between them.
    """
    kind, colon, text = name.partition(":")
    if name.lower().endswith(".csv"):
        return _tabulated(name, _read_csv(Path(name)), limits)
    if not colon:
        known = {entry.lower(): entry for entry in _colour().SDS_ILLUMINANTS}
        if name.lower() not in known:
            raise unknown_name("spectrum", name, WHERE, [*known.values(), FORMS])
        table = _colour().SDS_ILLUMINANTS[known[name.lower()]]
        return _tabulated(name, (table.wavelengths, table.values), limits, VISIBLE_NM)
    if kind == "rgb":
        return _of_rgb(name, _numbers(name, text, 3), limits)
    if kind == "laser":
        return _line(name, _numbers(name, text, 1)[0], limits)
    if kind not in ("blackbody", "temperature"):
        raise unknown_name("spectrum", name, WHERE, [FORMS])
    (temperature,) = _numbers(name, text, 1)
    if temperature <= 0.0:
        raise RadError(f"{name} has no temperature", WHERE, "expected kelvins above 0")
    if kind == "temperature":
        temperature = min(max(temperature, RANGE_K[0]), RANGE_K[1])
    x = _grid(limits or VISIBLE_NM)
    return Spectrum(name, x, _planck(x, temperature))


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


def _observer(wavelengths: Array) -> Array:
    """Return x̄, ȳ = V, z̄ of CIE 1931 at wavelengths (n,), (n, 3); 0 outside 360–830 nm."""
    table = _colour().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    columns = [
        np.interp(wavelengths, table.wavelengths, values, left=0.0, right=0.0)
        for values in np.asarray(table.values).T
    ]
    return np.stack(columns, axis=1)


def _integral(x: Array, y: Array) -> float:
    return float(np.sum(0.5 * np.diff(x) * (y[1:] + y[:-1])))


def _grid(limits: Limits, knots: Array | None = None) -> Array:
    """Return every whole nanometre between the limits, the limits and the knots."""
    low, high = limits
    x = np.union1d(np.arange(np.ceil(low), high), [low, high])
    return x if knots is None else np.union1d(x, knots[(knots > low) & (knots < high)])


def _planck(wavelengths: Array, temperature: float) -> Array:
    """Return Planck's law (n,), scaled so that no temperature underflows."""
    x = SECOND_RADIATION / (wavelengths * temperature)
    return np.exp(x.min() - x) / (-np.expm1(-x) * wavelengths**5)


def _tabulated(
    name: str, table: tuple[Array, Array], limits: Limits | None, usual: Limits = RANGE_NM
) -> Spectrum:
    """Return a table between `limits`, or as much of it as is in the `usual` ones."""
    x, y = table
    low, high = float(x[0]), float(x[-1])
    inner = limits or (max(usual[0], low), min(usual[1], high))
    if inner[0] < low or inner[1] > high:
        raise RadError(
            f"{name} is not tabulated between {inner[0]:g} and {inner[1]:g} nm",
            "--limits",
            f"expected limits within {low:g}-{high:g}",
        )
    grid = _grid(inner, x)
    density = np.interp(grid, x, y)
    if not density.any():
        raise RadError(f"{name} has no power", WHERE, f"expected some in {inner[0]:g}-{inner[1]:g}")
    return Spectrum(name, grid, density)


def _of_rgb(name: str, rgb: list[float], limits: Limits | None) -> Spectrum:
    basis = _colour().recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    daylight = _colour().SDS_ILLUMINANTS["D65"]
    white = np.interp(basis.wavelengths, daylight.wavelengths, daylight.values)
    if min(rgb) < 0.0:
        raise RadError(f"{name} is not the colour of a light", WHERE, "expected none below 0")
    return _tabulated(name, (basis.wavelengths, white * (basis.values @ np.array(rgb))), limits)


def _line(name: str, wavelength: float, limits: Limits | None) -> Spectrum:
    low, high = limits or RANGE_NM
    if not low <= wavelength <= high:
        raise RadError(f"{name} is out of range", WHERE, f"expected {low:g} to {high:g} nm")
    return Spectrum(name, np.array([wavelength]), np.ones(1))


def _numbers(name: str, text: str, count: int) -> list[float]:
    try:
        values = [float(entry) for entry in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise RadError(f"{name} is not a spectrum", WHERE, f"expected {FORMS}")
    return values


def _read_csv(path: Path) -> tuple[Array, Array]:
    """Return wavelengths [nm] and spectral power of a file, headings and comments aside."""
    expected = "expected two columns, wavelength in nm and spectral power"
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise RadError(str(error.strerror), str(path), expected) from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        if re.search(r"[;\t]", text):
            text = text.replace(",", ".")  # decimal commas
        try:
            row = [float(entry) for entry in re.split(r"[;,\s]+", text)]
        except ValueError:
            if rows and text:
                raise RadError("not numbers", f"{path}, line {number}", expected) from None
            continue
        if len(row) != 2:
            raise RadError(f"{len(row)} columns", f"{path}, line {number}", expected)
        rows.append(row)
    if len(rows) < 2:
        raise RadError("less than two wavelengths", str(path), expected)
    x, y = np.array(rows).T
    if not (np.isfinite(x).all() and (np.diff(x) > 0.0).all()):
        raise RadError("wavelengths do not increase", str(path), expected)
    if x[0] < RANGE_NM[0] or x[-1] > RANGE_NM[1]:
        raise RadError("wavelengths are not in nanometres", str(path), expected)
    if not (np.isfinite(y).all() and (y >= 0.0).all()):
        raise RadError("spectral power below 0 or not finite", str(path), expected)
    return x, y
