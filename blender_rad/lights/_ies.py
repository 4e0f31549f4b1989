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
from dataclasses import replace
from typing import Any

import numpy as np

from ..photometry import MADE_FOR_BLENDER, parse_photometry
from ..photometry.distribution import directions
from ..photometry.grid import mirrored
from ._base import Array, LightRecord, Model
from ._distribution import Distribution

PHOTOPIC = 683.002  # lm/W
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
    light = ies_distribution(record, model, facing)
    notes: list[str] = []
    if light is not None and model == "cycles":
        axial = len(light.longitude) == 2
        notes += ["ies-unreadable"] * (not light.cubic)
        notes += ["ies-seam"] * (light.cubic and axial and record.blender_version < EVEN_SINCE)
        for_blender = MADE_FOR_BLENDER.encode() in record.properties["ies_text"]
        notes += ["ies-mirrored"] * (not for_blender and _handed(light))
    return {"distribution": light, "notes": tuple(notes)}


def _handed(light: Distribution) -> bool:
    """Return whether no turn about its pole makes a light its mirror image."""
    around, up = np.radians(np.arange(2.5, 360, 5)), np.radians(np.arange(-87.5, 90, 5))
    local = directions(around, up).reshape(-1, 3)
    table = light.factor(local @ np.linalg.inv(light.frame).T).reshape(len(around), -1)
    misfits = [np.abs(np.roll(table[::-1], k, axis=0) - table).sum() for k in range(len(around))]
    return bool(min(misfits) > UNLIKE * table.sum())


def ies_distribution(
    record: LightRecord, model: Model, facing: Array | None = None
) -> Distribution | None:
    """Return what the record's IES text does to its light, None without one; see `ies_fields`."""
    text = record.properties.get("ies_text")
    if text is None:
        return None
    frame = np.array(record.properties["ies_frame"], dtype=np.float64)
    if model == "physical":
        return replace(_declared(text, record, frame), facing=facing)
    frame = np.array(AXES["C"]) @ frame
    try:
        azimuth, vertical, table = cycles_table(text)
    except UnreadableError:
        around, whole = np.array([0.0, 2.0 * np.pi]), np.array([-0.5, 0.5]) * np.pi
        return _even(around, whole, np.full((2, 2), UNREADABLE), frame)
    table = _edged(azimuth, vertical, table, record.blender_version)
    latitude = vertical - 0.5 * np.pi
    return Distribution(longitude=azimuth, latitude=latitude, table=table, frame=frame)


def _declared(text: bytes, record: LightRecord, frame: Array) -> Distribution:
    light = parse_photometry(text, record.name)
    unit = 1.0 if light.radiometric else 1.0 / PHOTOPIC
    longitude, latitude = np.radians(light.longitude), np.radians(light.latitude)
    table = 4.0 * np.pi * unit * light.intensity
    return _even(longitude, latitude, table, np.array(AXES[light.kind]) @ frame)


def _even(longitude: Array, latitude: Array, table: Array, frame: Array) -> Distribution:
    edged, first = np.pad(table, 1), float(longitude[0])
    return Distribution(
        longitude=longitude, latitude=latitude, table=edged, frame=frame, cubic=False, first=first
    )


def _edged(azimuth: Array, vertical: Array, table: Array, version: tuple[int, ...]) -> Array:
    """Return `table` with the rows that the cubic takes beyond its edges."""
    if min(table.shape) < 2:
        return np.zeros(np.maximum(np.add(table.shape, 2), 4))
    inner, tiny = float(version >= EVEN_SINCE), np.float32(1e-7)
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

    def take(pattern: re.Pattern[str], count: int = 1) -> Array:
        nonlocal place
        values: list[float] = []
        for _ in range(count):
            match = pattern.match(text, place)
            if match is None:
                raise UnreadableError
            values.append(float(match[1]))
            place = match.end()
        return np.array(values)

    if include:
        take(REAL)
        take(REAL, 2 * int(take(WHOLE)[0]))
    take(WHOLE)
    factor = take(REAL, 2)[1] * FROM_CANDELA
    n_vertical, n_horizontal, kind = (int(take(WHOLE)[0]) for _ in range(3))
    if kind not in (1, 2, 3) or min(n_vertical, n_horizontal) < 1:
        raise UnreadableError
    take(WHOLE)
    factor *= take(REAL, 6)[3:5].prod()
    vertical, azimuth = take(REAL, n_vertical), take(REAL, n_horizontal)
    table = factor * take(REAL, n_horizontal * n_vertical).reshape(n_horizontal, -1)
    azimuth, vertical, table = (_turned_c, _turned_b, _turned_a)[kind - 1](azimuth, vertical, table)
    return _radians(azimuth), _radians(vertical), table


def _radians(angle: Array) -> Array:
    """Return what single precision makes of angles [deg]."""
    degree = np.float32(np.pi) / np.float32(180)
    return np.asarray(angle.astype(np.float32) * degree, dtype=np.float64)


def _close(angle: float, to: float) -> bool:
    return bool(abs(angle - to) < CLOSE_DEG)


def _turned_a(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    if _close(h[0], 0):
        h, table = mirrored(h, table, at_end=False)
    return 180 - h[::-1], v + 90, table[::-1]


def _turned_b(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    across, table = _both_sides(h, table)
    around, table = _both_sides(v, table.T)
    return around, across, table


def _both_sides(angle: Array, table: Array) -> tuple[Array, Array]:
    if _close(angle[0], 0):
        angle, table = mirrored(angle, table, at_end=False)
    return angle + 90.0, table


def _turned_c(h: Array, v: Array, table: Array) -> tuple[Array, Array, Array]:
    if _close(h[0], 90):
        h = h - 90
    if len(h) == 1:
        return np.array([0.0, 360.0]), v, np.repeat(table, 2, axis=0)
    for end in (90, 180):
        if _close(h[-1], end):
            h, table = mirrored(h, table, at_end=True)
    gap = 360 - h[-1]
    steps = (h[-1] - h[-2], h[1] - h[0])
    if _close(h[0], 0) and not _close(gap, 0) and any(_close(step, gap) for step in steps):
        h, table = np.append(h, 360), np.concatenate([table, table[:1]])
    return h, v, table
