# SPDX-License-Identifier: GPL-3.0-or-later
"""EULUMDAT files (.ldt), Stockmar's format of 1990: one value a line, up to the tables."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from .distribution import Distribution, Opening
from .grid import check_range, light_of, read_table, unfold_planes
from .text import NUMBER, SAME_DEG, Numbers, Reader

MM = 1e-3
COUNTS = (  # by line, with their limits
    (3, "the symmetry indicator 0 to 4", 0, 4),
    (4, "the number of C planes", 1, 721),
    (6, "the number of angles in a plane", 2, 3601),
    (26, "the number of lamp sets", 1, 20),
)
FIRST_SET = 27  # line of the first lamp set, six lines each
RATIOS = 10  # of direct light in rooms, which nobody needs
# First and last C plane in the file, by symmetry indicator.
STORED = {0: (0.0, 360.0), 1: (0.0, 0.0), 2: (0.0, 180.0), 3: (-90.0, 90.0), 4: (0.0, 90.0)}


class LampSet(NamedTuple):
    """Lamps that the luminaire may carry."""

    absolute: bool
    lamps: str
    flux: float  # [lm] of all its lamps
    power: float | None  # [W]


def parse_ldt(reader: Reader, lamp_set: int = 1) -> Distribution:
    """Return the distribution of an EULUMDAT file with one of its lamp sets (from 1)."""
    reader.lines = [text.strip() for text in reader.lines]
    _start_at_first_line(reader)
    counts = (_field(reader, line).choice(what, low, high) for line, what, low, high in COUNTS)
    symmetry, n_planes, n_gamma, n_sets = counts
    sets = [_lamp_set(reader, FIRST_SET + 6 * i) for i in range(n_sets)]
    if lamp_set > n_sets:
        raise reader.refuse(f"no lamp set {lamp_set}", 26, f"expected one of 1 to {n_sets}")
    lamp = sets[lamp_set - 1]
    if n_sets > 1:
        listed = "; ".join(f"{i}: {s.lamps}, {s.flux:g} lm" for i, s in enumerate(sets, 1))
        reader.note("lamp-sets", "info", f"lamp set {lamp_set} is used of {listed}")
    longitude, gamma, table, label = _table(reader, symmetry, n_planes, n_gamma, n_sets)
    ratio = _lenient(reader, 23) / 100
    if lamp.absolute and abs(ratio - 1) > 1e-3:
        message = f"absolute photometry, but a light output ratio of {100 * ratio:g} %"
        reader.note("light-output-ratio", "warning", message)
    tilt = _lenient(reader, 25)
    if tilt:
        message = f"measured at a tilt of {tilt:g}°; not turned back"
        reader.note("tilted-measurement", "info", message)
    scale = lamp.flux / 1000 * _conversion(reader)
    return Distribution(
        name=reader.lines[8] or Path(reader.name).stem,
        format="EULUMDAT",
        kind="C",
        longitude=longitude,
        latitude=gamma - 90,
        intensity=light_of(reader, table, scale, len(reader.lines)),
        symmetry=label,
        opening=_opening(reader),
        lamp_flux=None if lamp.absolute else lamp.flux,
        declared_flux=lamp.flux * (1.0 if lamp.absolute else ratio) or None,
        downward_fraction=_lenient(reader, 22) / 100 if reader.lines[21] else None,
        input_power=lamp.power,
        findings=tuple(reader.findings),
    )


def _start_at_first_line(reader: Reader) -> None:
    """Drop blank lines before the maker's name, where the third line is not the symmetry."""
    blank = next((i for i, text in enumerate(reader.lines) if text), 0)
    if blank and not re.fullmatch(r"[0-4]", "".join(reader.lines[2:3])):
        message = f"{blank} blank lines before the first; left out, and not counted here"
        reader.note("blank-lines", "info", message)
        reader.lines = reader.lines[blank:]
    if len(reader.lines) < FIRST_SET + 6:
        expected = f"expected at least the {FIRST_SET + 5} lines before the tables of an LDT file"
        raise reader.refuse("the file ends", len(reader.lines), expected)


def _text(reader: Reader, line: int) -> str:
    """Return a line with decimal points, empty beyond the last."""
    return reader.lines[line - 1].replace(",", ".") if line <= len(reader.lines) else ""


def _field(reader: Reader, line: int) -> Numbers:
    """Return the number that a line holds, and nothing else."""
    return Numbers(reader, [(line, _text(reader, line))])


def _lenient(reader: Reader, line: int) -> float:
    """Return the number that a line starts with, 0 without: for what does not change the light."""
    text = _text(reader, line)
    match = NUMBER.match(text)
    if text and not match:
        message = f"{text[:30]!r} in line {line} is no number; left out"
        reader.note("not-a-number", "info", message)
    return reader.number(match[0], line, "a number") if match else 0.0


def _lamp_set(reader: Reader, line: int) -> LampSet:
    count = _field(reader, line).one("the number of lamps")
    flux = _field(reader, line + 2).one("the luminous flux of the lamps in lm")
    if not flux > 0:
        expected = "expected lumens above 0, since the intensities are per 1000 of them"
        raise reader.refuse(f"a lamp flux of {flux:g}", line + 2, expected)
    if count == 0:
        reader.note("no-lamps", "warning", f"no lamps in line {line}; the flux of the set counts")
    name = f"{abs(count):g} × {reader.lines[line]}"
    power = _lenient(reader, line + 5)
    return LampSet(count < 0, name, flux, power if power > 0 else None)


def _conversion(reader: Reader) -> float:
    """Return the factor on the intensities that the measurement asks for."""
    given = "the conversion factor of the intensities"
    factor = _field(reader, 24).one(given) if reader.lines[23] else 0.0
    if factor < 0:
        raise reader.refuse(f"a conversion factor of {factor:g}", 24, "expected above 0")
    if factor == 0:
        reader.note("conversion-factor", "warning", "no conversion factor; taken as 1")
    elif factor != 1:
        reader.note("conversion-factor", "info", f"{given} is {factor:g}", 100 * (factor - 1))
    return factor or 1.0


def _opening(reader: Reader) -> Opening:
    """Return the luminous area of lines 16 to 21 [mm]; the length lies along C90–C270."""
    length, width = (abs(_lenient(reader, line)) * MM for line in (16, 17))
    height = max(abs(_lenient(reader, line)) * MM for line in range(18, 22))
    if length and not width:
        return Opening("vertical cylinder" if height else "circular", length, length, height)
    shape = "box" if height else "rectangular" if length or width else "point"
    return Opening(shape, width, length, height)


def _table(
    reader: Reader, symmetry: int, n_planes: int, n_gamma: int, n_sets: int
) -> tuple[Floats, Floats, Floats, str]:
    """Return C planes, gamma [deg], the unfolded table [cd/klm], and the symmetry.

    All planes of the full turn are listed, those that symmetry leaves out as well; the tables hold
    the others from `STORED`'s first to its last.
    """
    numbers = reader.tokens(FIRST_SET + 6 * n_sets + RATIOS, decimal_comma=True)
    planes, line = numbers.take(n_planes, f"{n_planes} C planes"), numbers.line
    check_range(reader, planes, 0, 360, line)
    planes = _stored(reader, symmetry, planes, line)
    gamma = numbers.take(n_gamma, f"{n_gamma} gamma angles")
    check_range(reader, gamma, 0, 180, numbers.line)
    names = "C plane", "gamma angle"
    planes, gamma, table = read_table(numbers, planes, gamma, names, numbers.line)
    planes, table, label = unfold_planes(reader, planes, table, line, ring=symmetry == 0)
    return planes, gamma, table, label


def _stored(reader: Reader, symmetry: int, planes: Floats, line: int) -> Floats:
    """Return the planes that the tables hold, those of C270 to C360 before C0."""
    first, last = STORED[symmetry]
    if symmetry == 1:
        return planes[:1]
    turned = np.where(planes >= first + 360 - SAME_DEG, planes - 360, planes)
    if symmetry == 3:
        turned = np.sort(turned)
    kept = turned[(turned >= first - SAME_DEG) & (turned <= last + SAME_DEG)]
    if symmetry and (len(kept) < 2 or abs(kept[0] - first) + abs(kept[-1] - last) > SAME_DEG):
        expected = f"expected C planes from {first % 360:g}° to {last:g}° for symmetry {symmetry}"
        raise reader.refuse("planes are missing", line, expected)
    return kept
