# SPDX-License-Identifier: GPL-3.0-or-later
r"""Image and environment textures: pixels interpolated as they are stored, then decoded.

Cycles keeps 8-bit sRGB images encoded, multiplies them by their alpha, interpolates, and only then
decodes them: between two texels the colour is that of the mean *encoded* value. It is divided by
alpha again only where the Alpha output is used.

====================== ==========================================================================
setting                meaning
====================== ==========================================================================
`pixels`               (h, w, 4) float32 or uint8, from the lower left; absent: no image, magenta
`tiles`                pixels by the number of a UDIM tile; absent: `pixels` repeat
`encoded`              sRGB, to be decoded
`unassociate`          divide by alpha
`interpolation`        Closest, Linear, Cubic (B-spline, also for Smart)
`extension`            REPEAT, EXTEND, CLIP (transparent black outside), MIRROR
`projection`           FLAT, BOX (with a `projection_blend`), SPHERE, TUBE; of environments, which
                       repeat: EQUIRECTANGULAR, MIRROR_BALL
====================== ==========================================================================

A direction (x, y, z) is at u = ½ - atan2(y, x)/2π, v = ½ + asin(z)/π of an environment; on the
picture of a mirror ball, seen along +y, at ½ + ½(x, z)/√(2(1 - y)).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ._base import TEXTURES, Array, Call, divided, unit

Pixels = NDArray[np.uint8] | NDArray[np.float32]

MISSING = np.array([[1.0, 0.0, 1.0, 1.0]])


def from_srgb(encoded: Array) -> Array:
    """Return linear values of sRGB ones (IEC 61966-2-1)."""
    curve = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded < 0.04045, np.maximum(encoded / 12.92, 0.0), curve)


@TEXTURES.register("ShaderNodeTexImage")
def _image(call: Call) -> Array:
    extension, projection = call.settings["extension"], call.settings["projection"]
    if projection != "BOX":
        return _decoded(call, lambda: _PLACES[projection](call["Vector"]), extension)
    normal = call.context.normal @ np.linalg.inv(call.context.object_from_world[:3, :3])
    sides = _sides(call["Vector"], normal)
    parts = (_decoded(call, lambda uv=uv: uv, extension) for uv in sides)
    weights = _box_weights(normal, call.settings["projection_blend"])
    return np.asarray(sum(w[:, None] * part for w, part in zip(weights.T, parts, strict=True)))


def _around(at: Array) -> Array:
    """Return how far around the z axis places (n, 3) in the unit cube are, from 0 to 1."""
    x, y, _ = (2.0 * at - 1.0).T
    return np.where((x == 0.0) & (y == 0.0), 0.0, 0.5 - np.arctan2(x, y) / (2.0 * np.pi))


def _on_sphere(at: Array) -> Array:
    return np.stack([_around(at), 1.0 - np.arccos(unit(2.0 * at - 1.0)[:, 2]) / np.pi], axis=1)


_PLACES: dict[str, Callable[[Array], Array]] = {
    "FLAT": lambda at: at,
    "SPHERE": _on_sphere,
    "TUBE": lambda at: np.stack([_around(at), at[:, 2]], axis=1),
}


def _sides(at: Array, normal: Array) -> list[Array]:
    """Return where a place is on the pictures that look along the axes x, y and z, (n, 2) each."""
    pairs = ((1, 2, normal[:, 0] < 0.0), (0, 2, normal[:, 1] > 0.0), (1, 0, normal[:, 2] > 0.0))
    return [
        np.stack([np.where(turned, 1.0 - at[:, u], at[:, u]), at[:, v]], axis=1)
        for u, v, turned in pairs
    ]


def _box_weights(normal: Array, blend: float) -> Array:
    """Return how much the pictures along the axes count (n, 3), where normals point.

    One counts alone where its axis has more than (1 + `blend`)/2 of it and each of the others,
    two where the third has too little; between them all do.
    """
    share = np.abs(normal) / np.maximum(np.abs(normal).sum(axis=1, keepdims=True), 1e-30)
    limit = 0.5 * (1.0 + blend)
    if blend:
        weight = ((2.0 - limit) * share + limit - 1.0) / blend
    else:
        weight = np.tile([1.0, 0.0, 0.0], (len(share), 1))
    for k in (1, 0, 2) if blend else ():
        i, j = (k + 1) % 3, (k + 2) % 3
        pair = share[:, i] + share[:, j]
        first = np.clip((divided(share[:, i], pair) - 0.5) / blend + 0.5, 0.0, 1.0)
        two = share[:, k] < (1.0 - limit) * pair
        weight[two, k], weight[two, i], weight[two, j] = 0.0, first[two], 1.0 - first[two]
    for k in (2, 1, 0):
        others = np.maximum(share[:, (k + 1) % 3], share[:, (k + 2) % 3])
        weight[share[:, k] > limit * (share[:, k] + others)] = np.eye(3)[k]
    return weight


@TEXTURES.register("ShaderNodeTexEnvironment")
def _environment(call: Call) -> Array:
    def place() -> Array:
        x, y, z = unit(call["Vector"]).T
        if call.settings["projection"] == "EQUIRECTANGULAR":
            return np.stack([0.5 - np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arcsin(z) / np.pi], 1)
        across = np.sqrt(2.0 * np.maximum(1.0 - y, 1e-30))
        return 0.5 + 0.5 * np.stack([x, z], axis=1) / across[:, None]

    return _decoded(call, place, "REPEAT")


def _decoded(call: Call, place: Callable[[], Array], extension: str) -> Array:
    """Return what an output of an image node gives at `place` (n, 2)."""
    pixels = call.settings.get("pixels")
    rgba = MISSING
    if pixels is not None:
        rgba = _on_tiles(call, pixels, place(), extension)
    if pixels is not None and call.settings["unassociate"]:
        alpha = rgba[:, 3:]
        rgba = np.append(rgba[:, :3] / np.where(alpha == 0.0, 1.0, alpha), alpha, axis=1)
    if call.output == "Alpha":
        return rgba[:, 3:]
    encoded = pixels is not None and call.settings["encoded"]
    return from_srgb(rgba[:, :3]) if encoded else rgba[:, :3]


def _on_tiles(call: Call, pixels: Pixels, uv: Array, extension: str) -> Array:
    """Return what is at `uv` (n, 2), which are columns and rows of tiles if there are any."""
    tiles, interpolation = call.settings.get("tiles"), call.settings["interpolation"]
    if tiles is None:
        return _sampled(pixels, uv, interpolation, extension)
    found = np.tile(MISSING, (len(uv), 1))
    column, row = place = np.trunc(uv[:, :2]).T
    number = np.where((column < 10) & (place >= 0).all(axis=0), 1001 + column + 10 * row, 0)
    for tile, own_pixels in tiles.items():
        own = number == tile
        within = uv[own, :2] - place.T[own]
        found[own] = _sampled(own_pixels, within, interpolation, extension)
    return found


def _sampled(pixels: Pixels, uv: Array, interpolation: str, extension: str) -> Array:
    (x, along), (y, across) = (
        _taps(uv[:, axis] * pixels.shape[1 - axis], interpolation) for axis in (0, 1)
    )
    total = np.zeros((len(uv), 4))
    for i, part in zip(y, across, strict=True):
        row, inside = _wrapped(i, pixels.shape[0], extension)
        for j, share in zip(x, along, strict=True):
            column, within = _wrapped(j, pixels.shape[1], extension)
            weight = np.where(inside & within, part * share, 0.0)
            total += weight[:, None] * pixels[row, column]
    return total / 255.0 if pixels.dtype == np.uint8 else total


def _taps(at: Array, interpolation: str) -> tuple[list[NDArray[np.int64]], list[Array]]:
    """Return the texels (n,) that count along one axis, and their weights (n,)."""
    if interpolation == "Closest":
        return [np.floor(at).astype(np.int64)], [np.ones(len(at))]
    first = np.floor(at - 0.5).astype(np.int64)
    t = at - 0.5 - first
    if interpolation == "Linear":
        return [first, first + 1], [1.0 - t, t]
    weights = [
        (1.0 - t) ** 3 / 6.0,
        (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0,
        (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0,
        t**3 / 6.0,
    ]
    return [first + k for k in (-1, 0, 1, 2)], weights


def _wrapped(
    index: NDArray[np.int64], size: int, extension: str
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the texels that stand for `index` (n,), and whether they are in the image."""
    inside = np.ones(len(index), dtype=bool)
    match extension:
        case "REPEAT":
            return index % size, inside
        case "MIRROR":
            folded = index % (2 * size)
            return np.minimum(folded, 2 * size - 1 - folded), inside
        case "EXTEND":
            return np.clip(index, 0, size - 1), inside
        case _:
            return np.clip(index, 0, size - 1), (index >= 0) & (index < size)
