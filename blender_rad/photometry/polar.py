# SPDX-License-Identifier: GPL-3.0-or-later
"""The polar diagram of a luminaire, as data sheets have it: the nadir at the bottom."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from ..atomic import atomic_path
from ..report.pictures import nice_above
from .distribution import Distribution

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes

STEP_DEG = 0.25
RINGS = 5
# Angle, label, colour and line of each plane: told apart in grey too.
PLANES = ((0.0, "C0 – C180", "#c1121f", "-"), (90.0, "C90 – C270", "#1d4e9e", (0, (5, 2))))


def write_polar(
    light: Distribution, path: str | os.PathLike[str], *, per_klm: bool = False
) -> None:
    """Write the diagram to `path`, a PNG or SVG file.

    `per_klm` is per 1000 lm of the lamps; of the luminaire where the photometry is absolute.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    reference = light.lamp_flux or light.luminous_flux()
    per_klm = per_klm and not light.radiometric and reference > 0
    factor = 1000 / reference if per_klm else 1.0
    figure = Figure(figsize=(6.4, 7.2), dpi=150, layout="constrained")
    axes = cast("PolarAxes", figure.add_subplot(projection="polar"))
    axes.set_theta_zero_location("S")
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
    unit, total = ("W/sr", "W") if light.radiometric else ("cd/klm" if per_klm else "cd", "lm")
    unit += " of the lamps" if per_klm and light.lamp_flux else ""
    caption = f"{unit} · {light.luminous_flux():.5g} {total} · {light.format}, type {light.kind}"
    axes.set_title(caption, fontsize=9, color="#444444")
    vector = Path(path).suffix.lower() == ".svg"
    with mpl.rc_context({"svg.hashsalt": "polar"}), atomic_path(path) as target:
        kind, metadata = ("svg", {"Date": None}) if vector else ("png", None)
        figure.savefig(target, format=kind, metadata=metadata)


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
