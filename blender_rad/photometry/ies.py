# SPDX-License-Identifier: GPL-3.0-or-later
"""IES LM-63 files of 1986, 1991, 1995, 2002 and 2019."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..arrays import Floats
from .distribution import Distribution, Kind, Opening
from .grid import both_sides, check_range, light_of, read_table, unfold_planes
from .text import SAME_DEG, Numbers, Reader

FEET = 0.3048  # m
VERSION = re.compile(r"\s*IES(?:NA)?[:\s]*(?:LM-?63-?)?(?:19|20)?(86|91|95|02|19)\b", re.IGNORECASE)
YEARS = {"86": 1986, "91": 1991, "95": 1995, "02": 2002, "19": 2019}
TILT = re.compile(r"\s*TILT\s*=\s*(.*)", re.IGNORECASE)
KEYWORD = re.compile(r"\s*\[([^\]]*)\]\s*(.*)")
STATED_FLUX = ("ABSOLUTELUMENS", "TOTALLUMINAIRELUMENS", "LUMINAIRELUMENS")
RADIOMETRIC = re.compile(r"\bmW/sr\b|radiometric units", re.IGNORECASE)
VERTICAL: dict[Kind, tuple[int, int]] = {"A": (-90, 90), "B": (-180, 180), "C": (0, 180)}
HORIZONTAL: dict[Kind, tuple[int, int]] = {"A": (-180, 180), "B": (-90, 90), "C": (-360, 720)}
SIZES = "number of lamps, lumens, multiplier, counts of angles, type, units, width, length, height"
POWERS = "ballast factor, future use, input watts"
# Shapes by the signs of width, length, height. A zero beside a negative width is a circle's
# diameter in files before 2002.
SHAPES = """000 point, ++0 rectangular, +++ box, --0 circular, --+ vertical cylinder, --- sphere,
+00 line, 0+0 line, 00+ line, +0+ vertical rectangle, 0++ vertical rectangle, -00 circular,
-+- horizontal cylinder along C0, +-- horizontal cylinder along C90"""
SHAPES_BEFORE_2002 = """-0- sphere, -0+ vertical cylinder, 0+- horizontal cylinder along C0,
+0- horizontal cylinder along C90, -+0 ellipse, +-0 ellipse, -+- ellipsoid, +-- ellipsoid"""


def is_ies(reader: Reader) -> bool:
    """Return whether the file has the one line that every IES file has."""
    return any(TILT.match(text) for text in reader.lines)


def parse_ies(reader: Reader, folder: Path | None = None) -> Distribution:
    """Return the distribution of an IES file; its tilt file is looked for in `folder`."""
    tilt_line = next(n for n, text in enumerate(reader.lines, 1) if TILT.match(text))
    year = _year(reader)
    header = reader.lines[: tilt_line - 1]
    matches = (KEYWORD.match(text) for text in reversed(header))  # of each keyword the first
    labels = {m[1].strip().upper().lstrip("_"): m[2].strip() for m in matches if m}
    numbers = reader.tokens(tilt_line + 1)
    tilt = _tilt(reader.lines[tilt_line - 1], numbers, folder)
    lamps, lumens = numbers.take(2, SIZES)
    multiplier = _factor(numbers, SIZES, "multiplier")
    n_vertical = numbers.choice("the number of vertical angles", 2)
    n_horizontal = numbers.choice("the number of horizontal angles", 1)
    kind: Kind = ("C", "B", "A")[numbers.choice("photometric type 1 (C), 2 (B) or 3 (A)", 1, 3) - 1]
    metres = numbers.choice("units of length 1 (feet) or 2 (metres)", 1, 2) == 2
    opening = _opening(reader, numbers.take(3, SIZES) * (1.0 if metres else FEET), year)
    ballast = _factor(numbers, POWERS, "ballast factor") * _lamp_factor(numbers, year)
    watts = numbers.one(POWERS)
    longitude, latitude, table, symmetry = _table(numbers, kind, n_vertical, n_horizontal)
    radiometric = bool(RADIOMETRIC.search("\n".join(header)))
    unit = 1e-3 if radiometric else 1.0
    if radiometric:
        message = "the table holds mW/sr, not cd; powers are given in W, and no lumens"
        reader.note("radiometric", "warning", message)
    lamp_flux = float(lamps * lumens * ballast) if lumens >= 0 and not radiometric else None
    if lamp_flux is not None and lamp_flux <= 0:
        reader.note("no-lamps", "warning", f"{lamps:g} lamps of {lumens:g} lm: taken as not known")
        lamp_flux = None
    return Distribution(
        name=_name(labels, reader),
        format=f"LM-63-{year}",
        kind=kind,
        longitude=longitude,
        latitude=latitude,
        intensity=light_of(reader, table, multiplier * ballast * unit, numbers.line),
        symmetry=symmetry,
        opening=opening,
        lamp_flux=lamp_flux,
        declared_flux=_stated_flux(labels, unit) if lumens < 0 else None,
        input_power=watts if watts > 0 else None,
        radiometric=radiometric,
        tilt=tilt,
        findings=tuple(reader.findings),
    )


def _year(reader: Reader) -> int:
    """Return the edition that the file's first line with text names, 1986 where it names none."""
    first = next((text for text in reader.lines if text.strip()), "")
    match = VERSION.match(first)
    if match is None and first.strip().upper().startswith("IES"):
        message = f"unknown edition {first.strip()[:40]!r}; read as LM-63-2002"
        reader.note("unknown-edition", "warning", message)
        return 2002
    return YEARS[match[1]] if match else 1986


def _name(labels: Mapping[str, str], reader: Reader) -> str:
    """Return maker and catalogue number, else the description, else the file's name."""
    number = labels.get("LUMCAT", "")
    named = f"{labels.get('MANUFAC', '')} {number}" if number else labels.get("LUMINAIRE", "")
    return named.strip() or Path(reader.name).stem


def _stated_flux(labels: Mapping[str, str], unit: float) -> float | None:
    """Return the luminaire's flux [lm, W] that a keyword states."""
    for key in STATED_FLUX:
        match = re.match(r"\d+(?:\.\d+)?", labels.get(key, ""), re.ASCII)
        if match and 0 < float(match[0]) < np.inf:
            return float(match[0]) * unit
    return None


def _factor(numbers: Numbers, record: str, name: str) -> float:
    value = numbers.one(record)
    if not value > 0:
        expected = f"expected above 0 in {record}"
        raise numbers.reader.refuse(f"a {name} of {value:g}", numbers.line, expected)
    return value


def _lamp_factor(numbers: Numbers, year: int) -> float:
    """Return what field 12 multiplies: the ballast-lamp factor until 1995, nothing since.

    2002 keeps it at 1 for future use; 2019 states there how the file came about.
    """
    if year <= 1995:
        return _factor(numbers, POWERS, "ballast-lamp factor")
    future = numbers.one(POWERS)
    if year == 2002 and future != 1:
        message = f"field 12 is for future use and should be 1; {future:g} is not applied"
        numbers.reader.note("future-use", "warning", message, 100 * (future - 1))
    return 1.0


def _tilt(line: str, numbers: Numbers, folder: Path | None) -> tuple[tuple[float, float], ...]:
    """Return (tilt [deg], factor) as TILT= gives them: here, in a file beside this one, or none."""
    source = numbers.reader
    what = re.sub(r"^FILE\s+", "", TILT.sub(r"\1", line).strip(), flags=re.IGNORECASE)
    if what.upper() in ("NONE", ""):
        return ()
    if what.upper() != "INCLUDE":
        path = folder / re.split(r"[/\\:]", what)[-1] if folder else None
        if path is None or not path.is_file():
            message = f"no file {what[:60]!r} beside this one; output when tilted is not known"
            source.note("tilt-file-missing", "warning", message)
            return ()
        numbers = Reader(path.read_bytes(), str(path)).tokens(1)
    numbers.choice("lamp-to-luminaire geometry", 1, 3)
    count = numbers.choice("the number of tilt angles", 1)
    angles = numbers.take(count, f"{count} tilt angles")
    factors = numbers.take(count, f"{count} tilt factors")
    if (factors < 0).any():
        raise numbers.reader.refuse("a negative tilt factor", numbers.line, "expected 0 or more")
    message = f"tilted lamps give {factors.min():g} to {factors.max():g} of the flux; not applied"
    source.note("lamp-tilt", "info", message)
    return tuple(zip(angles.tolist(), factors.tolist(), strict=True))


def _opening(reader: Reader, size: Floats, year: int) -> Opening:
    """Return the opening of signed width, length, height [m]; the signs say its shape."""
    width, length, height = np.abs(size).tolist()
    known = SHAPES + (f", {SHAPES_BEFORE_2002}" if year < 2002 else ", -0- vertical circle")
    names: dict[str, str] = dict(re.findall(r"([-+0]{3}) ([^,]+)", known))
    shape = names.get("".join("0+-"[int(sign)] for sign in np.sign(size)))
    if shape is None:
        shape = "rectangular" if height == 0 else "box"
        message = f"no shape has the signs of {size.tolist()} m; taken as {shape}"
        reader.note("opening-shape", "warning", message)
    if shape in ("circular", "sphere", "vertical cylinder"):
        width, length = width or length, length or width
        if abs(width - length) > 1e-9 * width:
            shape = {"circular": "ellipse", "sphere": "ellipsoid"}.get(shape, "elliptic cylinder")
    elif shape.startswith("horizontal cylinder"):
        width, length = width or height, length or height
    return Opening(shape, length, width, height)


def _table(
    numbers: Numbers, kind: Kind, n_vertical: int, n_horizontal: int
) -> tuple[Floats, Floats, Floats, str]:
    """Return longitude, latitude [deg], the unfolded table, and the symmetry.

    In types A and B, angles that start at 0 hold for both sides.
    """
    reader, names = numbers.reader, ("horizontal angle", "vertical angle")
    v = numbers.take(n_vertical, f"{n_vertical} vertical angles")
    line = numbers.line
    h = numbers.take(n_horizontal, f"{n_horizontal} horizontal angles")
    h, v, table = read_table(numbers, h, v, names, line)
    check_range(reader, v, *VERTICAL[kind], line)
    check_range(reader, h, *HORIZONTAL[kind], line)
    if kind == "C":
        planes, table, symmetry = unfold_planes(reader, h, table, line)
        return planes, v - 90, table, symmetry
    if len(h) < 2:
        raise reader.refuse("one horizontal angle", line, f"expected two or more in type {kind}")
    starts = {"left-right": h[0], "up-down": v[0]}
    same = " and ".join(name for name, angle in starts.items() if abs(angle) < SAME_DEG) or "none"
    h, table = both_sides(h, table)
    v, transposed = both_sides(v, table.T)
    return (h, v, transposed.T, same) if kind == "A" else (v, h, transposed, same)
