# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a photometric file holds together: what it states against what its table gives."""

from collections.abc import Generator

import numpy as np

from ..errors import Finding, Severity
from ..quantities import K_M
from .distribution import Distribution

Note = tuple[str, Severity, str, float | None]

FLUX_TOLERANCE = 0.02  # of the stated flux; integration rules differ by less at usual steps
FLUX_ERROR = 0.10
EDGE = 0.01  # of the peak: less light at the table's end is no cut
POLE_SPREAD = 0.05  # of the peak: one direction, measured once for each plane
AIM_DEG = 45.0  # types A and B are measured about their beam
WHITE_EFFICACY = 300.0  # lm/W that white lamps stay below
OPENING_LIMIT = 10.0  # m


def check(light: Distribution, name: str) -> tuple[Finding, ...]:
    """Return what is wrong with the light that the file `name` describes."""
    if light.peak == 0:
        return (Finding("dark", "error", name, "every intensity is 0"),)
    notes = (*_flux(light), *_power(light), *_table(light), *_shape(light))
    return tuple(Finding(code, how, name, text, effect) for code, how, text, effect in notes)


def _flux(light: Distribution) -> Generator[Note]:
    flux, unit = light.luminous_flux(), "W" if light.radiometric else "lm"
    gives = f"the table gives {flux:.5g} {unit}, "
    stated, lamps = light.declared_flux, light.lamp_flux
    if stated is not None and abs(off := flux / stated - 1) > FLUX_TOLERANCE:
        text = f"{gives}the file states {stated:.5g} {unit}"
        yield "flux-mismatch", _severity(off), text, 100 * off
    if lamps is not None and (over := flux / lamps - 1) > FLUX_TOLERANCE:
        text = f"{gives}more than the lamps' {lamps:.5g} lm"
        yield "more-than-lamps", _severity(over), text, 100 * over
    if abs(coarse := light.interpolated_flux() / flux - 1) > FLUX_TOLERANCE:
        text = "the angles are coarse: interpolation and zonal sums give different fluxes"
        yield "coarse-angles", "warning", text, 100 * coarse
    if light.downward_fraction is not None:
        down = float(light.zonal_flux[light.latitude[1:] <= 0].sum() / flux)
        if abs(down - light.downward_fraction) > FLUX_TOLERANCE:
            text = f"{100 * down:.3g} % of the table's flux goes down, the file states "
            text += f"{100 * light.downward_fraction:.3g} %"
            yield "downward-fraction", "warning", text, None


def _severity(off: float) -> Severity:
    return "error" if abs(off) > FLUX_ERROR else "warning"


def _power(light: Distribution) -> Generator[Note]:
    if light.input_power is None:
        yield "no-power", "warning", "no input power above 0 W, so no efficacy", None
        return
    efficacy = light.luminous_flux() / light.input_power
    limit = 1.0 if light.radiometric else K_M
    if efficacy > (limit if light.radiometric else WHITE_EFFICACY):
        text = f"{efficacy:.4g} lm/W is more than lamps can do"
        text = "more power goes out than goes in" if light.radiometric else text
        yield "efficacy", "error" if efficacy > limit else "warning", text, None


def _table(light: Distribution) -> Generator[Note]:
    table = light.intensity
    for at, end in ((0, -90), (-1, 90)):
        inside = abs(light.latitude[at] - end) > 1e-6
        edge = float(table[:, at].max())
        if inside and edge > EDGE * light.peak:
            where = light.latitude[at] + (90 if light.kind == "C" else 0)
            text = f"the table ends at {where:g}° with {edge:.4g} of {light.peak:.4g}; 0 beyond"
            yield "table-cut", "warning", text, None
        spread = float(np.ptp(table[:, at])) / light.peak
        if not inside and spread > POLE_SPREAD:
            text = f"in one direction, latitude {end}°, the planes differ by "
            text += f"{100 * spread:.3g} % of the peak"
            yield "pole-differs", "warning", text, None


def _shape(light: Distribution) -> Generator[Note]:
    i, j = np.unravel_index(int(light.intensity.argmax()), light.intensity.shape)
    cosines = np.cos(np.radians([light.longitude[i], light.latitude[j]]))
    off = float(np.degrees(np.arccos(cosines.prod())))
    if light.kind != "C" and off > AIM_DEG:
        text = f"the peak is {off:.3g}° off the axis that type {light.kind} aims"
        yield "peak-off-axis", "warning", text, None
    opening = light.opening
    largest = max(opening.along_c0, opening.along_c90, opening.height)
    if largest > OPENING_LIMIT:
        yield "opening-size", "warning", f"a luminous opening of {largest:g} m", None
