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

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, Singles
from . import TEXTURES, Call, divided, unit

Pixels = NDArray[np.uint8] | Singles

MISSING = np.array([[1.0, 0.0, 1.0, 1.0]])


def from_srgb(encoded: Floats) -> Floats:
    """Return linear values of sRGB ones (IEC 61966-2-1)."""
    encoded = np.maximum(encoded, 0.0)
    return np.where(encoded < 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@TEXTURES.register("ShaderNodeTexImage")
def _image(call: Call) -> Floats:
    at, extension = call["Vector"], call.settings["extension"]
    if call.settings["projection"] != "BOX":
        return _decoded(call, _projected(at, call.settings["projection"]), extension)
    at, normal = np.broadcast_arrays(at, call.context.normal_in_object)
    parts = np.array([_decoded(call, uv, extension) for uv in _sides(at, normal)])
    return np.einsum("nk,knc->nc", _box_weights(normal, call.settings["projection_blend"]), parts)


def _projected(at: Floats, projection: str) -> Floats:
    """Return where places (n, 3) in the unit cube are on a picture, (n, 2) or more."""
    if projection == "FLAT":
        return at
    x, y = (2.0 * at[:, :2] - 1.0).T
    around = np.where((x == 0.0) & (y == 0.0), 0.0, 0.5 - np.arctan2(x, y) / (2.0 * np.pi))
    if projection == "TUBE":
        return np.stack([around, at[:, 2]], axis=1)
    return np.stack([around, 1.0 - np.arccos(unit(2.0 * at - 1.0)[:, 2]) / np.pi], axis=1)


def _sides(at: Floats, normal: Floats) -> list[Floats]:
    """Return where a place is on the pictures that look along the axes x, y and z, (n, 2) each."""
    pairs = ((1, 2, normal[:, 0] < 0.0), (0, 2, normal[:, 1] > 0.0), (1, 0, normal[:, 2] > 0.0))
    return [
        np.stack([np.where(turned, 1.0 - at[:, u], at[:, u]), at[:, v]], axis=1)
        for u, v, turned in pairs
    ]


def _box_weights(normal: Floats, blend: float) -> Floats:
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
def _environment(call: Call) -> Floats:
    x, y, z = unit(call["Vector"]).T
    if call.settings["projection"] == "EQUIRECTANGULAR":
        uv = np.stack([0.5 - np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arcsin(z) / np.pi], axis=1)
    else:
        across = np.sqrt(2.0 * np.maximum(1.0 - y, 1e-30))
        uv = 0.5 + 0.5 * np.stack([x, z], axis=1) / across[:, None]
    return _decoded(call, uv, "REPEAT")


def _decoded(call: Call, uv: Floats, extension: str) -> Floats:
    """Return what an output of an image node gives at `uv` (n, 2)."""
    settings, rgba = call.settings, MISSING
    missing = settings.get("pixels") is None
    if not missing:
        rgba = _on_tiles(settings, uv, extension)
    colour, alpha = rgba[:, :3], rgba[:, 3:]
    if call.output == "Alpha":
        return alpha
    if not missing and settings["unassociate"]:
        colour = colour / np.where(alpha == 0.0, 1.0, alpha)
    return from_srgb(colour) if not missing and settings["encoded"] else colour


def _on_tiles(settings: Mapping[str, Any], uv: Floats, extension: str) -> Floats:
    """Return what is at `uv` (n, 2), which are columns and rows of tiles if there are any."""
    tiles, interpolation = settings.get("tiles"), settings["interpolation"]
    if tiles is None:
        return _sampled(settings["pixels"], uv, interpolation, extension)
    found = np.tile(MISSING, (len(uv), 1))
    column, row = place = np.trunc(uv[:, :2]).T
    number = np.where((column < 10) & (place >= 0).all(axis=0), 1001 + column + 10 * row, 0)
    for tile, pixels in tiles.items():
        own = number == tile
        found[own] = _sampled(pixels, uv[own, :2] - place.T[own], interpolation, extension)
    return found


def _sampled(pixels: Pixels, uv: Floats, interpolation: str, extension: str) -> Floats:
    columns, rows = (
        _taps(uv[:, axis], pixels.shape[1 - axis], interpolation, extension) for axis in (0, 1)
    )
    total = np.zeros((len(uv), 4))
    for row, part in rows:
        for column, share in columns:
            total += (part * share)[:, None] * pixels[row, column]
    return total / 255.0 if pixels.dtype == np.uint8 else total


def _taps(u: Floats, size: int, interpolation: str, extension: str) -> list[tuple[Ints, Floats]]:
    """Return the texels (n,) that count along one axis, and their weights (n,)."""
    at = u * size - (0.0 if interpolation == "Closest" else 0.5)
    first = np.floor(at).astype(np.int64)
    t = at - first
    if interpolation == "Closest":
        weights = {0: np.ones_like(t)}
    elif interpolation == "Linear":
        weights = {0: 1.0 - t, 1: t}
    else:
        weights = {
            -1: (1.0 - t) ** 3 / 6.0,
            0: (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0,
            1: (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0,
            2: t**3 / 6.0,
        }
    taps = [(first + k, _wrapped(first + k, size, extension), w) for k, w in weights.items()]
    if extension == "CLIP":
        return [(texel, np.where(texel == index, w, 0.0)) for index, texel, w in taps]
    return [(texel, w) for _, texel, w in taps]


def _wrapped(index: Ints, size: int, extension: str) -> Ints:
    """Return the texels that stand for `index` (n,)."""
    if extension == "REPEAT":
        return index % size
    if extension == "MIRROR":
        folded = index % (2 * size)
        return np.minimum(folded, 2 * size - 1 - folded)
    return np.clip(index, 0, size - 1)
