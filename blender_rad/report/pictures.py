# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as data URIs, with the numbers that their legends need."""

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compare.pools import block_sums
from ..film import Image
from ..working_space import rec709_from_working
from .data import ReportData
from .difference import spread

MAX_WIDTH = 1000  # of what is shrunk for the file's size [px]
MAP_WIDTH = 960  # that the difference map is blown up towards, so that hatching is fine [px]
WHITE_PERCENTILE = 98.0
NICE = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
COLOURS = "RdBu_r"
HATCH = ((70, 70, 70, 255), (205, 205, 205, 255))  # line and gap, RGBA
HATCHES = 80  # lines across the picture


def nice_above(value: float) -> float:
    """Return the smallest round number that is not below `value`: 0.04 for 0.031; 1 for 0."""
    if not value > 0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(m * decade for m in NICE if m * decade >= value * (1 - 1e-12)))


def white_luminance(data: ReportData) -> float:
    """Return the luminance [cd/m²] that is shown white: almost all of the picture lies below."""
    lit = data.luminance(data.ours)[data.inside]
    lit = lit[lit > 0]
    return nice_above(float(np.percentile(lit, WHITE_PERCENTILE))) if lit.size else 1.0


def srgb(radiance: Image, white: float, matrix: Image) -> NDArray[np.uint8]:
    """Return the sRGB display values (h, w, 3) of `radiance`, where `white` [W/(m² sr)] is 255."""
    linear = np.nan_to_num(radiance, nan=0.0, posinf=white, neginf=0.0) @ matrix.T / white
    linear = np.clip(linear, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(curve * 255).astype(np.uint8)


def _encode(pixels: NDArray[np.uint8], kind: str) -> str:
    """Return `pixels` (h, w, 3 or 4) as a PNG or JPEG in a data URI."""
    from matplotlib.image import imsave  # pyright: ignore[reportUnknownVariableType] - PathLike

    buffer = io.BytesIO()
    options = {"quality": 90} if kind == "jpeg" else {"optimize": True}
    imsave(buffer, pixels, format=kind, pil_kwargs=options)
    return f"data:image/{kind};base64,{base64.b64encode(buffer.getvalue()).decode('ascii')}"


def photograph(data: ReportData, radiance: Image, white_cd_m2: float) -> str:
    """Return `radiance` as an sRGB picture; wide ones are averaged down, in linear light."""
    step = -(-radiance.shape[1] // MAX_WIDTH)
    if step > 1:
        known, ones = np.nan_to_num(radiance), np.ones_like(radiance)
        radiance = block_sums(known, step) / block_sums(ones, step)
    matrix = rec709_from_working(data.chromaticities)
    pixels = srgb(radiance, white_cd_m2 / data.efficacy_lm_W, matrix)
    return _encode(pixels, "jpeg" if step > 1 else "png")


def hatched(pixels: NDArray[Any], where: NDArray[Any]) -> NDArray[np.uint8]:
    """Return `pixels` (h, w, 4) with grey hatching `where` (h, w) there is nothing to show."""
    period = max(6, max(where.shape) // HATCHES)
    rows, columns = (np.arange(length, dtype=np.intp) for length in where.shape)
    in_gap = np.add.outer(rows, columns) % period >= period // 3
    hatch = np.array(HATCH, np.uint8)[in_gap.astype(np.intp)]
    return np.where(where[..., None], hatch, pixels)


def difference_picture(data: ReportData, relative: Image, limit: float) -> str:
    """Return the map in colours; excluded pixels hatched, pixels outside the border clear."""
    import matplotlib as mpl

    height, width = relative.shape
    grow, step = max(1, MAP_WIDTH // width), -(-width // (2 * MAP_WIDTH))
    size = -(-height // step) * grow, -(-width // step) * grow
    value, out, inside = (
        spread(plane[::step, ::step], grow, size)
        for plane in (np.nan_to_num(relative / limit), ~data.compared, data.inside)
    )
    pixels = hatched(mpl.colormaps[COLOURS](value * 0.5 + 0.5, bytes=True), out)
    pixels[..., 3] = np.where(inside, 255, 0)
    return _encode(pixels, "png")
