# SPDX-License-Identifier: GPL-3.0-or-later
"""Albedos by incidence, and balls in a white furnace, which hides those that keep all light."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..atomic import atomic_path
from .pictures import srgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..laws import Judged

COLUMNS, PIXELS = 3, 160
CHANNELS = ("#c1121f", "#2a7f3f", "#1d4e9e")
TOP = 2.0  # of the albedos shown
TOO_BRIGHT = (200, 0, 160)
EXCESS = 1.005  # of the furnace, from which on it is shown as too bright
CAPTION = (
    "solid: share of a beam that is reflected, by its angle · dotted: seen in a white furnace\n"
    "balls: in a white furnace, where one that keeps all light vanishes; magenta above 1"
)


def write_furnaces(judged: Sequence[Judged], path: str | os.PathLike[str]) -> None:
    """Write a PNG with a panel for each material that could be judged.

    Curves are the share of a beam that is reflected, by its angle and channel, mean over the
    surface; dotted ones are what is seen in a white furnace. In the balls magenta is above 1.
    """
    from matplotlib.figure import Figure

    shown = [each for each in judged if each.supported]
    rows = max(1, -(-len(shown) // COLUMNS))
    figure = Figure(figsize=(4.6 * COLUMNS, 2.7 * rows + 0.4), dpi=100, layout="constrained")
    ratios = [1.7, 1.0] * COLUMNS
    cells = figure.subplots(rows, 2 * COLUMNS, squeeze=False, width_ratios=ratios).reshape(-1, 2)
    for number, (left, right) in enumerate(cells):
        if number < len(shown):
            _panel(left, right, shown[number])
        else:
            left.set_axis_off()
            right.set_axis_off()
    figure.supxlabel(CAPTION, fontsize=9)
    with atomic_path(path) as target:
        figure.savefig(target, format="png")


def _panel(axes: Axes, beside: Axes, judged: Judged) -> None:
    angles, albedo = np.array(judged.angles_deg), np.array(judged.albedo)
    furnace = np.array(judged.furnace)
    top = min(TOP, max(1.15, 1.08 * float(albedo.max())))
    axes.axhspan(1.0, top, color="#c1121f", alpha=0.08, linewidth=0)
    axes.axhline(1.0, color="#444444", linewidth=0.8)
    for k, colour in enumerate(CHANNELS):
        axes.plot(angles, furnace[:, k], color=colour, linestyle=":", linewidth=1.2)
        axes.plot(angles, albedo[:, k], color=colour, linewidth=1.6, alpha=0.8)
    axes.set(xlim=(0, 90), ylim=(0, top), xticks=range(0, 91, 30))
    axes.set_xlabel("θ [°]", fontsize=8)
    axes.set_ylabel("albedo", fontsize=8)
    axes.tick_params(labelsize=8)
    name = judged.name if len(judged.name) <= 24 else f"{judged.name[:23]}…"
    most = f"{judged.max_albedo:.3g} at {judged.max_albedo_angle_deg:g}°"
    axes.set_title(f"{name}: up to {most}".replace("$", r"\$"), fontsize=9)
    beside.imshow(_ball(angles, furnace), interpolation="nearest")
    beside.set(xticks=[], yticks=[])


def _ball(angles: Floats, furnace: Floats) -> NDArray[np.uint8]:
    """Return a ball (h, w, 3) of the material in surroundings of radiance 1, which are white."""
    place = (np.arange(PIXELS) + 0.5) / PIXELS * 2.4 - 1.2
    square = np.add.outer(place**2, place**2)
    view = np.degrees(np.arcsin(np.sqrt(np.minimum(square, 1.0))))
    seen = np.stack([np.interp(view, angles, channel) for channel in furnace.T], axis=-1)
    seen[square > 1.0] = 1.0
    pixels = srgb(seen, 1.0, np.eye(3))
    pixels[(seen > EXCESS).any(axis=-1)] = TOO_BRIGHT
    return pixels
