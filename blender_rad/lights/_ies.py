# SPDX-License-Identifier: GPL-3.0-or-later
"""IES photometry on a light: as Cycles reads the text, or as its maker declares it.

====================== ==========================================================================
record property        meaning
====================== ==========================================================================
`ies_text`             bytes of the file; absent: no IES
`ies_frame`            (3, 3), from a leaving world direction to the vector that the node gets
====================== ==========================================================================

`cycles`: emission is times candela × multiplier × both ballast factors × 4π/177.83, so that a point
of 1 W has I = candela/177.83 W/sr; lumens, TILT, units and sizes are not looked at. Both angles are
cubic, in cells counted evenly, 0 outside of the table. Beyond the table's edge the cubic takes 0 in
4.5; in 5.2 the edge again, but after the last azimuth the one before it. Below a first vertical
angle of 0 it mirrors. It means to go round where the azimuths span 360°, but in single precision
its test fails. Planes from 90° to 270° are turned to 0° to 180°. What it cannot read counts 100.

`physical`: the file as `photometry` reads it, linear, all the way round; I = candela/K for 1 W
whatever the shape, so that an area light's radiance is I/(A cosθ). It is aimed as Cycles aims it.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..photometry import MADE_FOR_BLENDER, parse_photometry
from ..photometry import Distribution as Photometry
from ..photometry.distribution import directions
from ..photometry.grid import both_sides, mirrored
from ..quantities import K_M
from ._base import Array, LightRecord, Model
from ._distribution import Distribution

FROM_CANDELA = 4.0 * np.pi / 177.83
UNREADABLE = 100.0
CLOSE_DEG = 1e-4
EVEN_SINCE = (5, 0, 0)  # Blender interpolates over a table's edges
UNLIKE = 0.02  # of the light, that goes elsewhere in a mirror
# Longitude 0, longitude 90° and pole of each type's own grid, as Cycles turns it.
AXES = {"A": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "B": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}
AXES["C"] = [[0, -1, 0], [-1, 0, 0], [0, 0, 1]]
REAL = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)", re.ASCII)
WHOLE = re.compile(r"\s*([+-]?\d+)", re.ASCII)


class UnreadableError(ValueError):
    """Cycles cannot read the text."""


def ies_fields(record: LightRecord, model: Model, facing: Array | None = None) -> dict[str, Any]:
    """Return what the record's IES text makes of its light: `distribution` and `notes`.

    `facing` (3,) is the normal of an emitter that is flat.
    """
    text = record.properties.get("ies_text")
    if text is None:
        return {"distribution": None, "notes": ()}
    frame = np.array(record.properties["ies_frame"], dtype=np.float64)
    if model == "physical":
        declared = _declared(parse_photometry(text, record.name), frame, facing)
        return {"distribution": declared, "notes": ()}
    even = record.blender_version >= EVEN_SINCE
    light = _shown(text, np.array(AXES["C"]) @ frame, even)
    notes: list[str] = []
    if not light.cubic:
        notes.append("ies-unreadable")
    elif len(light.longitude) == 2 and not even:
        notes.append("ies-seam")
    if MADE_FOR_BLENDER.encode() not in text and _handed(light):
        notes.append("ies-mirrored")
    return {"distribution": light, "notes": tuple(notes)}


def _handed(light: Distribution) -> bool:
    """Return whether no turn about its pole makes a light its mirror image."""
    around, up = np.radians(np.arange(2.5, 360, 5)), np.radians(np.arange(-87.5, 90, 5))
    local = directions(around, up).reshape(-1, 3)
    table = light.factor(local @ np.linalg.inv(light.frame).T).reshape(len(around), -1)
    misfits = [np.abs(np.roll(table[::-1], k, axis=0) - table).sum() for k in range(len(around))]
    return bool(min(misfits) > UNLIKE * table.sum())


def _declared(light: Photometry, frame: Array, facing: Array | None) -> Distribution:
    """Return the light as its maker declares it, 4π times the intensity of 1 W."""
    per_watt = 4.0 * np.pi / (1.0 if light.radiometric else K_M)
    longitude = np.radians(light.longitude)
    return Distribution(
        longitude=longitude,
        latitude=np.radians(light.latitude),
        table=np.pad(per_watt * light.intensity, 1),
        frame=np.array(AXES[light.kind]) @ frame,
        cubic=False,
        first=float(longitude[0]),
        facing=facing,
    )


def _shown(text: bytes, frame: Array, even: bool) -> Distribution:
    """Return the light as Cycles reads the text; `even` where it interpolates over edges."""
    try:
        azimuth, vertical, table = cycles_table(text)
    except (UnreadableError, OverflowError):  # the latter of a count with 309 digits
        azimuth, vertical = np.array([0.0, 2.0 * np.pi]), np.array([0.0, np.pi])
        table, cubic = np.full((4, 4), UNREADABLE), False
    else:
        table, cubic = _edged(azimuth, vertical, table, even), True
    latitude = vertical - 0.5 * np.pi
    return Distribution(longitude=azimuth, latitude=latitude, table=table, frame=frame, cubic=cubic)


def _edged(azimuth: Array, vertical: Array, table: Array, even: bool) -> Array:
    """Return `table` with the rows that the cubic takes beyond its edges."""
    if min(table.shape) < 2:
        return np.zeros(np.maximum(np.add(table.shape, 2), 4))
    inner, tiny = float(even), np.float32(1e-7)
    round_v = vertical[-1] > np.float32(np.pi) - tiny
    round_h = azimuth[0] < tiny and azimuth[-1] > np.float32(2.0 * np.pi) - tiny
    low = table[:, 1] if vertical[0] < tiny else inner * table[:, 0]
    high = table[:, -2] if round_v else inner * table[:, -1]
    table = np.column_stack([low, table, high])
    before = table[-2] if round_h else inner * table[0]
    after = table[1] if round_h else inner * table[-2]
    return np.vstack([before, table, after])


def cycles_table(data: bytes) -> tuple[Array, Array, Array]:
    """Return azimuths (m,), vertical angles (n,) [rad] and factors (m, n) of an IES text.

    Raises
    ------
    UnreadableError
        Where Cycles cannot read it.
    """
    text = data.decode("latin-1").replace(",", " ")
    start = text.find("\nTILT=")
    include = text.startswith("\nTILT=INCLUDE", start)
    place = start + 13 if include else text.find("\n", start + 1)
    if min(start, place) < 0:
        raise UnreadableError

    def take(pattern: re.Pattern[str]) -> float:
        nonlocal place
        match = pattern.match(text, place)
        if match is None:
            raise UnreadableError
        place = match.end()
        return float(match[1])

    def reals(count: int) -> Array:
        return np.array([take(REAL) for _ in range(count)])

    if include:
        reals(1)
        reals(2 * int(take(WHOLE)))
    take(WHOLE)
    factor = reals(2)[1] * FROM_CANDELA
    n_vertical, n_horizontal, kind = (int(take(WHOLE)) for _ in range(3))
    if kind not in (1, 2, 3) or min(n_vertical, n_horizontal) < 1:
        raise UnreadableError
    take(WHOLE)
    factor *= reals(6)[3:5].prod()
    vertical, azimuth = reals(n_vertical), reals(n_horizontal)
    table = factor * reals(n_horizontal * n_vertical).reshape(n_horizontal, -1)
    azimuth, vertical, table = (_turned_c, _turned_b, _turned_a)[kind - 1](azimuth, vertical, table)
    return _radians(azimuth), _radians(vertical), table


def _radians(angle: Array) -> Array:
    """Return what single precision makes of angles [deg]."""
    degree = np.float32(np.pi) / np.float32(180)
    return np.asarray(angle.astype(np.float32) * degree, dtype=np.float64)


def _close(angle: float, to: float) -> bool:
    return bool(abs(angle - to) < CLOSE_DEG)


def _turned_a(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    h, table = both_sides(h, table, CLOSE_DEG)
    return 180 - h[::-1], v + 90, table[::-1]


def _turned_b(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    across, table = both_sides(h, table, CLOSE_DEG)
    around, transposed = both_sides(v, table.T, CLOSE_DEG)
    return around + 90, across + 90, transposed


def _turned_c(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    if _close(h[0], 90):
        h = h - 90
    if len(h) == 1:
        return np.array([0.0, 360.0]), v, np.repeat(table, 2, axis=0)
    for end in (90, 180):
        if _close(h[-1], end):
            h, table = mirrored(h, table)
    gap = 360 - h[-1]
    steps = (h[-1] - h[-2], h[1] - h[0])
    if _close(h[0], 0) and not _close(gap, 0) and any(_close(step, gap) for step in steps):
        h, table = np.append(h, 360), np.concatenate([table, table[:1]])
    return h, v, table
