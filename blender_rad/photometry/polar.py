# SPDX-License-Identifier: GPL-3.0-or-later
"""The polar diagram of a luminaire, as data sheets have it: the nadir at the bottom."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from ..atomic import atomic_path
from ..report.pictures import nice_above
from .distribution import Distribution

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes

Unit = Literal["cd", "cd/klm"]
STEP_DEG = 0.25
RINGS = 5
# Angle, label, colour and line of each plane: told apart in grey too.
PLANES = ((0.0, "C0 – C180", "#c1121f", "-"), (90.0, "C90 – C270", "#1d4e9e", (0, (5, 2))))


def scale_of(light: Distribution, unit: Unit) -> tuple[float, str]:
    """Return the factor from the table to `unit`, and the unit's text.

    Per 1000 lm of the lamps; of the luminaire where the photometry is absolute.
    """
    if light.radiometric:
        return 1.0, "W/sr"
    reference = light.lamp_flux or light.luminous_flux()
    if unit == "cd" or reference <= 0:
        return 1.0, "cd"
    return 1000 / reference, "cd/klm"


def write_polar(light: Distribution, path: str | os.PathLike[str], unit: Unit = "cd") -> None:
    """Write the diagram to `path`, a PNG or SVG file."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    factor, text = scale_of(light, unit)
    figure = Figure(figsize=(6.4, 7.2), layout="constrained")
    axes = cast("PolarAxes", figure.add_subplot(projection="polar"))
    axes.set_theta_zero_location("S")
    axes.set_theta_direction(1)
    gamma = np.linspace(-180.0, 180.0, round(360 / STEP_DEG) + 1)
    top = 0.0
    for c, label, colour, line in PLANES:
        values = light.cut(c, gamma) * factor
        top = max(top, float(values.max()))
        axes.plot(np.radians(gamma), values, color=colour, linestyle=line, linewidth=2, label=label)
        if c == 0:
            axes.fill(np.radians(gamma), values, color=colour, alpha=0.07, linewidth=0)
    _rings(axes, nice_above(top))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2, frameon=False)
    name = light.name if len(light.name) <= 64 else f"{light.name[:63]}…"
    figure.suptitle(name.replace("$", r"\$"), fontsize=12)
    amount = f"{light.luminous_flux():.5g} {'W' if light.radiometric else 'lm'}"
    text += " of the lamps" if text == "cd/klm" and light.lamp_flux else ""
    caption = f"{text} · {amount} · {light.format}, type {light.kind}"
    axes.set_title(caption, fontsize=9, color="#444444")
    vector = Path(path).suffix.lower() == ".svg"
    options: dict[str, Any] = {"metadata": {"Date": None}} if vector else {"dpi": 150}
    with mpl.rc_context({"svg.hashsalt": "polar"}), atomic_path(path) as target:
        figure.savefig(target, format="svg" if vector else "png", **options)


def _rings(axes: PolarAxes, top: float) -> None:
    """Draw rings up to `top` and the angles from the nadir, alike on both sides."""
    angles = np.arange(0, 360, 30)
    axes.set_thetagrids(angles, [f"{min(a, 360 - a)}°" for a in angles], fontsize=9)
    ring = nice_above(top / RINGS)
    rings = np.arange(1, np.ceil(top / ring * (1 - 1e-9)) + 1) * ring
    axes.set_ylim(0, rings[-1])
    axes.set_rgrids(rings, [f"{value:g}" for value in rings], angle=15, fontsize=8)
    axes.grid(color="#cccccc", linewidth=0.6)
    axes.spines["polar"].set_color("#999999")
