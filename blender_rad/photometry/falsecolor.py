# SPDX-License-Identifier: GPL-3.0-or-later
"""Illuminance and luminance of a rendered picture, in colours with a legend in their unit."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..atomic import atomic_path
from ..compare.pools import block_sums
from ..errors import Finding, RadError
from ..exr import read_passes, stated_chromaticities
from ..film import Image
from ..quantities import K_M, QUANTITIES
from ..report.difference import spread
from ..report.pictures import hatched, nice_above
from ..working_space import REC709, luminance_weights

Quantity = Literal["illuminance", "luminance"]
Scale = Literal["log", "linear"]

PASSES: dict[Quantity, tuple[tuple[str, ...], ...]] = {
    "illuminance": (("Illuminance.V",), ("DiffDir.RGB", "DiffInd.RGB", "DiffCol.RGB")),
    "luminance": (("Combined.RGB",),),
}
LEAST_ALBEDO = 1e-4  # Cycles divides light by DiffCol; below, nothing is left to divide
PERCENTILES = (0, 5, 25, 50, 75, 95, 100)
DECADES, LEAST_RATIO = 4, 5  # at most, and at least, of a log range that is not given
COLOURS = "viridis"
LENGTH_IN = 10.0  # of the picture's longer side on the page
MARGINS_IN = (0.25, 0.45, 1.35, 0.45)  # left, below, right, above
LEAST_PIXELS = 960  # smaller pictures are blown up by whole numbers
BLOCKS, MEDIAN = 320, 5  # isolines: blocks across the picture, and how many wide a median is
_LAMBERTIAN = (
    "illuminance from diffuse passes holds for Lambertian surfaces: sheen, rough diffuse and "
    "subsurface read 2 to 5 % low, translucent surfaces mix in the light on their back, and the "
    "passes do not tell where; a clay render is exact"
)


@dataclass(frozen=True)
class LightMap:
    """A photometric quantity over a picture."""

    quantity: Quantity
    values: Image  # (h, w) [lx] or [cd/m²], row 0 at the top, nan where there is no data
    efficacy_lm_W: float  # noqa: N815 - the unit's own spelling
    findings: tuple[Finding, ...]

    @property
    def unit(self) -> str:
        return QUANTITIES[self.quantity].unit

    @property
    def no_data_fraction(self) -> float:
        return float(np.isnan(self.values).mean())

    @property
    def percentiles(self) -> dict[str, float | None]:
        """Values below which so many percent of the pixels with data lie."""
        known = self.values[np.isfinite(self.values)]
        found = np.percentile(known, PERCENTILES).tolist() if known.size else None
        return {str(p): found and found[i] for i, p in enumerate(PERCENTILES)}


def read_map(
    path: str | os.PathLike[str],
    quantity: Quantity,
    *,
    efficacy_lm_W: float | None = None,
    exposure: float = 1.0,
    view_layer: str | None = None,
) -> LightMap:
    """Return illuminance or luminance of an EXR file, of ours or of Cycles.

    Luminance is L = K·Σ wᵢ Lᵢ of the beauty pass. Illuminance is our own layer, or from Cycles'
    diffuse passes E = π·K·Σ wᵢ (DiffDirᵢ + DiffIndᵢ): a Lambertian surface reflects L = E·albedo/π,
    and Cycles divides that by DiffCol = albedo. The weights w are those of the file's colours.

    `efficacy_lm_W` is K; None means the file's own, or 683.002 lm/W. Values are divided by the film
    `exposure` of the render. `view_layer` None means the first that has the passes; where none has,
    RadError names those that there are.
    """
    also = ("Depth.V", "Combined.A")
    passes, header = read_passes(path, *PASSES[quantity], also=also, view_layer=view_layer)
    images = {name: image.astype(np.float64) for name, image in passes.items()}
    own_efficacy = float(header.get("efficacy_lm_W", K_M))
    efficacy = efficacy_lm_W or own_efficacy
    findings: list[Finding] = []
    if "Illuminance.V" in images:
        values = images["Illuminance.V"][..., 0] * (efficacy / own_efficacy)
        nothing = np.isposinf(images.get("Depth.V", images["Illuminance.V"])[..., 0])
    else:
        stated = stated_chromaticities(header)
        if stated is None:
            said = "the file does not say what its colours are: weights are those of Rec.709"
            findings.append(Finding("no-chromaticities", "info", "", said))
        weights = efficacy * np.array(luminance_weights(stated or REC709))
        if quantity == "luminance":
            values = images["Combined.RGB"] @ weights
            nothing = (values == 0) & (images.get("Combined.A", np.ones(1))[..., 0] == 0)
        else:
            values = np.pi * (images["DiffDir.RGB"] + images["DiffInd.RGB"]) @ weights
            nothing = ~(images["DiffCol.RGB"] >= LEAST_ALBEDO).all(axis=-1)
            findings.append(Finding("lambertian", "info", "", _LAMBERTIAN))
    if count := np.count_nonzero(~nothing & ~np.isfinite(values)):
        said = f"{count} pixels are not finite and have no data"
        findings.append(Finding("not-finite", "warning", "", said))
    values = np.where(nothing | ~np.isfinite(values), np.nan, values / exposure)
    if not (values > 0).any():
        findings.append(Finding("nothing-lit", "warning", "", "no pixel is above 0"))
    return LightMap(quantity, values, efficacy, tuple(findings))


def value_range(
    values: Image, scale: Scale, low: float | None = None, high: float | None = None
) -> tuple[float, float]:
    """Return the ends of the legend: those given, else round numbers that nearly all lies within.

    RadError says where the range is empty, or reaches 0 on a logarithmic scale.
    """
    lit = values[values > 0]
    least, most = np.percentile(lit, (2, 98)).tolist() if lit.size else (1.0, 1.0)
    top = nice_above(most) if high is None else high
    if low is None and scale == "log":
        below = max(1 / nice_above(1 / least), top / 10**DECADES)
        low = min(below, top / LEAST_RATIO)
    low = low or 0.0
    if scale == "log" and min(low, top) <= 0:
        raise RadError("0 or less", "--min or --max", "expected more than 0 on a log scale")
    if low >= top:
        raise RadError("an empty range", f"{low:g} to {top:g}", "expected --min below --max")
    return low, top


def write_map(
    light: LightMap,
    path: str | os.PathLike[str],
    scale: Scale,
    limits: tuple[float, float],
    isolines: Sequence[float] | None = (),
) -> Sequence[float]:
    """Draw `light` into a PNG or PDF file, pixel for pixel, and return the values of isolines.

    Small pictures are blown up by a whole number, so that the legend can be read. `limits` are the
    legend's ends; None for `isolines` means its ticks.
    """
    import matplotlib as mpl
    from matplotlib import cm, colors
    from matplotlib.figure import Figure

    height, width = light.values.shape
    grow = max(1, LEAST_PIXELS // max(height, width))
    tall, wide = grow * height, grow * width
    dpi = max(tall, wide) / LENGTH_IN
    left, below, right, above = (round(inch * dpi) for inch in MARGINS_IN)
    across, up = left + wide + right, below + tall + above
    figure = Figure(((across + 0.01) / dpi, (up + 0.01) / dpi), dpi)  # whole pixels, rounded down
    axes, beside = (
        figure.add_axes((x / across, below / up, w / across, tall / up))
        for x, w in ((left, wide), (left + wide + 0.25 * dpi, 0.2 * dpi))
    )
    norm = (colors.LogNorm if scale == "log" else colors.Normalize)(*limits)
    legend = cm.ScalarMappable(norm, mpl.colormaps[COLOURS])
    large = spread(light.values, grow, (tall, wide))
    pixels = legend.to_rgba(np.clip(np.nan_to_num(large, nan=limits[0]), *limits), bytes=True)
    pixels = hatched(pixels, np.isnan(large))
    axes.imshow(pixels, extent=(0, width, height, 0), interpolation="none")
    axes.set_axis_off()
    axes.set_title(f"{light.quantity.capitalize()} [{light.unit}]", loc="left", fontsize=13)
    below_it: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(_caption(light), (0, 0), (0, -18), **below_it, fontsize=9, color="#444444")
    ticks = _ticks(scale, *limits)
    lines = ticks if isolines is None else isolines
    _draw_isolines(axes, light.values, lines)
    beyond = (light.values < limits[0]).any() + 2 * (light.values > limits[1]).any()
    extend = ("neither", "min", "max", "both")[beyond]
    bar = figure.colorbar(legend, cax=beside, extend=extend, extendfrac=0.03)
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.minorticks_off()
    kind = Path(path).suffix.lower()[1:]
    undated = {"CreationDate": None} if kind == "pdf" else None
    with atomic_path(path) as target:
        figure.savefig(target, format=kind, metadata=undated)
    return lines


def _ticks(scale: Scale, low: float, high: float) -> list[float]:
    """Return round numbers: 1, 2, 5 and their decades, or evenly spaced."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    even = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(low, high)
    log = LogLocator(subs=(1, 2, 5), numticks=30).tick_values(low, high) if scale == "log" else even
    found = [[float(tick) for tick in ticks if low <= tick <= high] for ticks in (log, even)]
    return found[0] if len(found[0]) > 1 else found[1]


def _draw_isolines(axes: Any, values: Image, lines: Sequence[float]) -> None:
    """Draw labelled lines along medians of means of small blocks: noise does not fray them."""
    from matplotlib.patheffects import withStroke

    size = -(-max(values.shape) // BLOCKS)
    known = np.isfinite(values)
    count = block_sums(known.astype(np.float64), size, 0)
    means = block_sums(np.where(known, values, 0.0), size, 0) / np.maximum(count, 1.0)
    means[2 * count <= count.max()] = np.nan
    known, rim = np.isfinite(means), MEDIAN // 2
    near = np.lib.stride_tricks.sliding_window_view(np.pad(means, rim, "edge"), (MEDIAN, MEDIAN))
    means[known] = np.nanmedian(near[known], axis=(1, 2))
    within = sorted(x for x in lines if (means < x).any() and (means > x).any())
    if not within or min(means.shape) < 2:
        return
    y, x = ((np.arange(length) + 0.5) * size for length in means.shape)
    drawn = axes.contour(x, y, means, within, colors="white", linewidths=0.9)
    labels = axes.clabel(drawn, fmt=lambda line: f"{line:g}", fontsize=7.5)
    for artist in (drawn, *labels):
        artist.set_path_effects([withStroke(linewidth=1.7, foreground="black")])


def _caption(light: LightMap) -> str:
    said = [f"{light.efficacy_lm_W:g} lm/W"] + ["hatched: no data"] * (light.no_data_fraction > 0)
    if light.no_data_fraction < 1:
        found = light.percentiles
        low, middle, high = (f"{float(f'{found[key]:.3g}'):g}" for key in ("5", "50", "95"))
        said.insert(0, f"median {middle} {light.unit}, 90 % of the picture {low} to {high}")
    return " · ".join(said)
