# SPDX-License-Identifier: GPL-3.0-or-later
r"""Image texture: pixels interpolated as they are stored, then decoded.

Cycles keeps 8-bit sRGB images encoded, multiplies them by their alpha, interpolates, and only then
decodes them: between two texels the colour is that of the mean *encoded* value. It is divided by
alpha again only where the Alpha output is used.

====================== ==========================================================================
setting                meaning
====================== ==========================================================================
`pixels`               (h, w, 4) float32 or uint8, from the lower left; absent: no image, magenta
`encoded`              sRGB, to be decoded
`unassociate`          divide by alpha
`interpolation`        Closest, Linear, Cubic (B-spline, also for Smart)
`extension`            REPEAT, EXTEND, CLIP (transparent black outside), MIRROR
====================== ==========================================================================
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._base import TEXTURES, Array, Call

MISSING = np.array([[1.0, 0.0, 1.0, 1.0]])


def from_srgb(encoded: Array) -> Array:
    """Return linear values of sRGB ones (IEC 61966-2-1)."""
    curve = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded < 0.04045, np.maximum(encoded / 12.92, 0.0), curve)


@TEXTURES.register("ShaderNodeTexImage")
def _image(call: Call) -> Array:
    pixels = call.settings.get("pixels")
    rgba = MISSING if pixels is None else _sampled(pixels, call)
    if pixels is not None and call.settings["unassociate"]:
        alpha = rgba[:, 3:]
        rgba = np.append(rgba[:, :3] / np.where(alpha == 0.0, 1.0, alpha), alpha, axis=1)
    if call.output == "Alpha":
        return rgba[:, 3:]
    encoded = pixels is not None and call.settings["encoded"]
    return from_srgb(rgba[:, :3]) if encoded else rgba[:, :3]


def _sampled(pixels: NDArray[np.uint8] | NDArray[np.float32], call: Call) -> Array:
    uv = call["Vector"]
    (x, along), (y, across) = (
        _taps(uv[:, axis] * pixels.shape[1 - axis], call.settings["interpolation"])
        for axis in (0, 1)
    )
    total = np.zeros((len(uv), 4))
    for i, part in zip(y, across, strict=True):
        row, inside = _wrapped(i, pixels.shape[0], call.settings["extension"])
        for j, share in zip(x, along, strict=True):
            column, within = _wrapped(j, pixels.shape[1], call.settings["extension"])
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
