# SPDX-License-Identifier: GPL-3.0-or-later
"""`report.html`: a comparison as one self-contained page, on a screen, a phone or paper."""

from __future__ import annotations

import functools
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..atomic import atomic_path
from . import wording
from .data import ReportData
from .difference import TILE_TOLERANCES, Difference, difference, outline
from .pictures import (
    difference_picture,
    map_colours,
    map_limit,
    nice_above,
    photograph,
    white_luminance,
)

if TYPE_CHECKING:
    import jinja2

TEMPLATES = Path(__file__).parent / "templates"
COLOUR_STOPS = 13
AXIS_TOLERANCES = 3.0  # the least that the plot of lights reaches, in tolerances
SHOWN_LIGHTS = 0.92  # part of the lights that the axis covers: all of up to twelve
WHISKER = 3.0  # standard errors


@dataclass(frozen=True)
class Axis:
    """The axis that all lights share: deviations from 1 up to ±`limit`, 0 to 100 across."""

    limit: float

    def at(self, deviation: float) -> float:
        """Return the place of `deviation` in percent of the width; what lies outside is clipped."""
        return round(float(np.clip(50 + 50 * deviation / self.limit, 0.0, 100.0)), 2)


def _axis(lights: list[dict[str, Any]], tolerance: float) -> Axis:
    """Return the axis that shows all but the wildest of many lights, and the tolerance band."""
    reach = [0.0]
    for light in lights:
        scale, error = light.get("scale_in_witness"), light.get("standard_error") or 0.0
        if scale is not None and wording.known(scale) and wording.known(error):
            reach.append(min(abs(scale - 1) + WHISKER * error, 1.0))
    most = float(np.quantile(reach, SHOWN_LIGHTS, method="higher"))
    return Axis(nice_above(max(most, AXIS_TOLERANCES * tolerance)))


def _totals(data: ReportData) -> dict[str, float]:
    """Return mean luminances [cd/m²] of what was compared, and the witness's over ours less 1."""
    use = data.compared
    ours, witness = (
        float(data.luminance(side)[use].mean()) if use.any() else float("nan")
        for side in (data.ours, data.witness)
    )
    excess = witness / ours - 1 if ours else float("nan")
    return {"ours": ours, "witness": witness, "excess": excess}


def _rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the lights as the table shows them, what matters first.

    Added to each: ``cause``, the message behind its diagnosis, and ``others``, the lights that it
    cannot be told apart from. Undecided ones that are too faint to be judged are called that.
    """
    messages = {
        (finding["code"], light): finding["message"]
        for finding in document["findings"]
        for light in {finding["object"], *finding["object"].split(", ")}
    }
    rows: list[dict[str, Any]] = []
    for light in document["lights"]:
        group, faint = light["group"], (light["energy_fraction"] or 0.0) < wording.FAINT
        alike = [x["name"] for x in document["lights"] if group is not None and x["group"] == group]
        verdict = "faint" if faint and light["verdict"] == "undecided" else light["verdict"]
        rows.append(
            light
            | {
                "verdict": verdict,
                "cause": messages.get((light["diagnosis"], light["name"])),
                "others": [other for other in alike if other != light["name"]],
            }
        )
    return wording.by_importance(rows)


def _outlines(data: ReportData, result: Difference) -> dict[str, str]:
    shape = data.ours.shape[0], data.ours.shape[1]
    return {
        "brighter": outline(result.tiles > 0, shape),
        "darker": outline(result.tiles < 0, shape),
    }


def _pictures(data: ReportData, tolerance: float) -> dict[str, Any]:
    """Return the three pictures and everything that their legends and captions say."""
    result = difference(data, tolerance)
    white, limit = white_luminance(data), map_limit(result, TILE_TOLERANCES * tolerance)
    return {
        "ours": photograph(data, data.ours, white),
        "witness": photograph(data, data.witness, white),
        "map": difference_picture(data, result, limit),
        "colours": map_colours(COLOUR_STOPS),
        "limit": limit,
        "white": white,
        "exposure": float(np.log2(data.efficacy_lm_W / white)),
        "outlines": _outlines(data, result),
        "brighter": int((result.tiles > 0).sum()),
        "darker": int((result.tiles < 0).sum()),
        "tile_tolerance": TILE_TOLERANCES * tolerance,
        "noise_known": result.noise_known,
        "excluded": float(1 - data.compared.sum() / max(data.inside.sum(), 1)),
        "bordered": not bool(data.inside.all()),
        "peak": float(data.luminance(data.ours).max(initial=0.0)),
    }


def _shown(value: object) -> object:
    """Return text from outside with its control characters visible, and all else as it is."""
    return wording.visible(value) if type(value) is str else value


@functools.cache
def _template() -> jinja2.Template:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    words = ("number", "percent", "signed_percent", "name", "kind", "deviation", "known")
    environment.filters.update(  # pyright: ignore[reportUnknownMemberType] - as jinja2 types it
        {word: getattr(wording, word) for word in words}
    )
    return environment.get_template("report.html")


def render_report(data: ReportData) -> str:
    """Return the page of `data`; names from the scene are escaped, nothing is fetched."""
    document = data.document
    tolerance = document["settings"]["tolerance"]
    pictures = _pictures(data, tolerance)
    lights = _rows(document)
    tiles_off = pictures["brighter"] + pictures["darker"]
    return _template().render(
        d=document,
        witness=data.witness_name,
        css=(TEMPLATES / "report.css").read_text(encoding="utf-8"),
        headline=wording.headline(document, data.witness_name, tiles_off),
        next_step=wording.next_step(document, lights),
        verdicts=wording.VERDICTS,
        lights=lights,
        count=Counter(light["verdict"] for light in lights),
        axis=_axis(lights, tolerance),
        whisker=WHISKER,
        totals=_totals(data),
        pictures=pictures,
        size=(data.ours.shape[1], data.ours.shape[0]),
        metrics=[wording.metric(k, v, data.witness_name) for k, v in document["metrics"].items()],
        findings=sorted(document["findings"], key=lambda f: wording.SEVERITIES[f["severity"]]),
        command=wording.command(document),
    )


def write_report(path: str | os.PathLike[str], data: ReportData) -> None:
    """Write the page of `data` to `path`, whole or not at all."""
    page = render_report(data)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
