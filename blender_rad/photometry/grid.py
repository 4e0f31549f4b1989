# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables as files have them, put in order, made whole by their symmetry, and checked."""

import numpy as np

from ..arrays import Floats
from .text import SAME_DEG, Numbers, Reader

INTENSITY_LIMIT = 1e12  # cd; the brightest searchlights have 1e9
NEGATIVE_NOISE = 0.01  # of the peak; more of it is an error


def read_table(
    numbers: Numbers, rows: Floats, columns: Floats, names: tuple[str, str], line: int
) -> tuple[Floats, Floats, Floats]:
    """Return `rows` (m,) and `columns` (n,) [deg] rising, and the intensities (m, n) that follow.

    RadError is for a single column, at the `line` of these angles; `names` are theirs.
    """
    what = f"{len(rows)} × {len(columns)} intensities"
    table = numbers.take(len(rows) * len(columns), what).reshape(len(rows), -1)
    numbers.note_rest()
    rows, table = _in_order(numbers.reader, rows, table, names[0])
    columns, transposed = _in_order(numbers.reader, columns, table.T, names[1])
    if len(columns) < 2:
        raise numbers.reader.refuse(f"one {names[1]}", line, "expected two that differ")
    return rows, columns, transposed.T


def check_range(reader: Reader, angles: Floats, low: float, high: float, line: int) -> None:
    """Refuse angles [deg] outside of `low` to `high`."""
    bad = angles[(angles < low - SAME_DEG) | (angles > high + SAME_DEG)]
    if len(bad):
        raise reader.refuse(f"an angle of {bad[0]:g}°", line, f"expected {low:g}° to {high:g}°")


def _in_order(reader: Reader, angles: Floats, table: Floats, what: str) -> tuple[Floats, Floats]:
    """Return `angles` (m,) rising and the rows (m, n) of `table` with them.

    Rows out of order still belong to their angles, so sorting changes no light; of two rows at one
    angle the first counts.
    """
    if (np.diff(angles) > 0).all():
        return angles, table
    order = np.argsort(angles, kind="stable")
    if (order != np.arange(len(angles))).any():
        reader.note("angles-not-rising", "error", f"{what}s are not in rising order; sorted")
    angles, table = angles[order], table[order]
    keep = np.append(True, np.diff(angles) > SAME_DEG)
    if not keep.all():
        twin = np.flatnonzero(~keep)
        differ = not np.allclose(table[twin], table[twin - 1], rtol=1e-3)
        message = f"{what}s repeat {angles[twin[0]]:g}°; the first counts"
        reader.note("angle-twice", "error" if differ else "warning", message)
    return angles[keep], table[keep]


def mirrored(angles: Floats, table: Floats) -> tuple[Floats, Floats]:
    """Return the table with its mirror image beyond its last angle."""
    beyond = 2 * angles[-1] - angles[-2::-1]
    return np.concatenate([angles, beyond]), np.concatenate([table, table[-2::-1]])


def both_sides(angles: Floats, table: Floats, slack: float = SAME_DEG) -> tuple[Floats, Floats]:
    """Return a table that starts at 0 with its mirror image before it, any other as it is."""
    if abs(angles[0]) >= slack:
        return angles, table
    before = 2 * angles[0] - angles[:0:-1]
    return np.concatenate([before, angles]), np.concatenate([table[:0:-1], table])


def unfold_planes(
    reader: Reader, planes: Floats, table: Floats, line: int, *, ring: bool = False
) -> tuple[Floats, Floats, str]:
    """Return C planes over 360° with the intensities (m, n) of `table`, and the symmetry declared.

    The span of the planes says what is to be mirrored: 90° about two planes, 180° about one. With
    `ring` they go all the way round, and the last is followed by the first.
    """
    if planes[-1] - planes[0] > 360 + SAME_DEG:  # more than once round
        once = (planes > -SAME_DEG) & (planes < 360 + SAME_DEG)
        planes, table = planes[once], table[once]
    span = planes[-1] - planes[0]
    if len(planes) == 1:
        return np.array([0.0, 360.0]), np.repeat(table, 2, axis=0), "axial"
    if abs(span - 360) < SAME_DEG:
        return planes, table, "none"
    if ring or 180 + SAME_DEG < span < 360:
        if not ring:
            message = f"planes end at C{planes[-1]:g}; taken as followed by C{planes[0]:g}"
            reader.note("planes-not-closed", "warning", message)
        return np.append(planes, planes[0] + 360), np.append(table, table[:1], axis=0), "none"
    multiple = abs(planes[0] / 90 - round(planes[0] / 90)) < SAME_DEG
    if not multiple or min(abs(span - 90), abs(span - 180)) > SAME_DEG:
        got = f"C planes from {planes[0]:g}° to {planes[-1]:g}°"
        expected = "expected 0 alone, or 0 to 90, 180 or 360, or 90 to 270"
        raise reader.refuse(got, line, expected)
    names = ("C0-C180", "C90-C270")
    symmetry = names[round(planes[0] / 90) % 2]
    if span < 135:
        symmetry = " and ".join(names)
        planes, table = mirrored(planes, table)
    return *mirrored(planes, table), symmetry


def light_of(reader: Reader, table: Floats, scale: float, line: int) -> Floats:
    """Return `table` times `scale` as intensities [cd], none of them negative."""
    peak = np.abs(table).max(initial=0.0)
    if not peak * scale < INTENSITY_LIMIT:
        expected = f"expected less than {INTENSITY_LIMIT:g} cd"
        raise reader.refuse(f"an intensity of {peak:g} × {scale:g}", line, expected)
    if table.min() < 0:
        noise = -table.min() <= NEGATIVE_NOISE * peak
        message = f"{np.sum(table < 0)} negative intensities, down to {table.min():g}; taken as 0"
        reader.note("negative-intensity", "warning" if noise else "error", message)
    return np.maximum(table * scale, 0.0)
