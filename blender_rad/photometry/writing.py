# SPDX-License-Identifier: GPL-3.0-or-later
"""Any distribution as an IES text: for other programs, or for Blender's IES Texture node."""

import numpy as np

from ..arrays import Floats
from .distribution import Distribution, cells, directions

# An opening's signs by its shape; all others are boxes, which their zeros tell apart.
SIGNS = {"circular": (-1, -1, 1), "vertical cylinder": (-1, -1, 1), "sphere": (-1, -1, -1)}
STEPS_DEG = (1.0, 2.0)  # least and greatest, of types A and B that are turned into type C
PER_LINE = 10
MADE_FOR_BLENDER = "planes turned for Blender's IES Texture"


def as_ies(light: Distribution, *, blender: bool = False) -> str:
    """Return an LM-63-2002 text of the same light: its angles, candelas, lamps, watts and opening.

    Read back, it gives the same intensities: planes keep their numbers, types A and B their kind.

    With `blender` it is made for Blender's IES Texture: on a light object that is not turned, C0
    shines along +X, C90 along +Y and gamma 0 down. Blender takes azimuth h to be the direction
    (-sin h, -cos h), so that h = 270° - C; it drops the light of the first and the last cell of
    azimuth, so that one more of each is added. Types A and B become C, in steps as fine as theirs.
    """
    longitude, vertical, table = light.longitude, light.latitude, light.intensity
    kind = "C" if blender else light.kind
    if kind != light.kind:
        longitude, vertical, table = _sampled(light)
    if kind == "C":
        vertical = np.round(vertical + 90.0, 9)
        longitude, table = _planes(longitude, table, blender)
    if kind == "B":
        longitude, vertical, table = vertical, longitude, table.T
    unit = 1e3 if light.radiometric else 1.0
    lamps = "1 -1" if light.lamp_flux is None else f"1 {light.lamp_flux!r}"
    opening, counts = light.opening, f"{len(vertical)} {len(longitude)}"
    size = np.array([opening.along_c90, opening.along_c0, opening.height], dtype=np.float64)
    size = size * SIGNS.get(opening.shape, (1, 1, 1))
    rows = ["IESNA:LM-63-2002", f"[LUMINAIRE] {light.name}", f"[OTHER] from {light.format}"]
    rows += ["[OTHER] radiometric units, mW/sr"] * light.radiometric
    if light.declared_flux is not None and light.lamp_flux is None:
        rows.append(f"[_ABSOLUTELUMENS] {light.declared_flux * unit:.10g}")
    rows += [f"[OTHER] {MADE_FOR_BLENDER}"] * blender
    rows += ["TILT=NONE", f"{lamps} 1 {counts} {'CBA'.index(kind) + 1} 2 {_line(size)}"]
    rows.append(f"1 1 {light.input_power or 0.0!r}")
    for values in (vertical, longitude, *(unit * table)):
        rows += [_line(values[i : i + PER_LINE]) for i in range(0, len(values), PER_LINE)]
    return "\n".join(rows) + "\n"


def _line(values: Floats) -> str:
    return " ".join(f"{value!r}".removesuffix(".0") for value in values.tolist())


def _planes(longitude: Floats, table: Floats, blender: bool) -> tuple[Floats, Floats]:
    """Return the planes from 0° to 360°, interpolated where the file has none at 0°."""
    if not blender and len(longitude) == 2 and (table[0] == table[1]).all():
        return longitude[:1], table[:1]
    first = longitude[0]
    if not blender and first == 0.0:
        return longitude, table
    sign, zero = (-1.0, 270.0) if blender else (1.0, 0.0)
    turned = np.round(np.mod(sign * longitude + zero, 360.0), 9)
    turned = np.unique(np.append(turned % 360.0, [0.0, 360.0]))
    if blender:
        turned = np.concatenate([[turned[-2] - 360.0], turned, [turned[1] + 360.0]])
    at = first + np.mod(sign * (turned - zero) - first, 360.0)
    i, part = cells(longitude, at)[:2]
    return turned, (1.0 - part)[:, None] * table[i] + part[:, None] * table[i + 1]


def _sampled(light: Distribution) -> tuple[Floats, Floats, Floats]:
    """Return C planes, latitudes and the table of a light of type A or B."""
    finest = min(np.diff(light.longitude).min(), np.diff(light.latitude).min())
    step = 90.0 / np.ceil(90.0 / np.clip(finest, *STEPS_DEG))
    planes, latitude = np.arange(0.0, 360.0 + step / 2, step), np.arange(-90.0, 90.1, step)
    sphere = directions(np.radians(planes), np.radians(latitude)).reshape(-1, 3)
    return planes, latitude, light.luminous_intensity(sphere).reshape(len(planes), -1)
