# SPDX-License-Identifier: GPL-3.0-or-later
"""`report.html`: a comparison as one self-contained page, on a screen, a phone or paper."""

from __future__ import annotations

import functools
import shlex
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compare.claims import TILE_TOLERANCES
from ..compare.result import MIN_ENERGY
from . import wording
from .data import ReportData
from .difference import difference, outline
from .pictures import COLOURS, difference_picture, nice_above, photograph, white_luminance

if TYPE_CHECKING:
    import jinja2

TEMPLATES = Path(__file__).parent / "templates"
AXIS_TOLERANCES = 3.0  # the least that the plot of lights reaches, in tolerances
SHOWN_LIGHTS = 0.92  # part of the lights that the axis covers: all of up to twelve
SHOWN_PIXELS = 99.5  # percent of the map that its colours cover
WHISKER = 3.0  # standard errors
SEVERITIES = ("error", "warning", "info")


def _reach(lights: list[dict[str, Any]], tolerance: float) -> float:
    """Return the deviation that the plot of lights ends at: all but the wildest of many fit."""
    reach = [
        min(abs(light["scale_in_witness"] - 1) + WHISKER * (light["standard_error"] or 0.0), 1.0)
        for light in lights
        if light["scale_in_witness"] is not None
    ]
    most = float(np.quantile([0.0, *reach], SHOWN_LIGHTS, method="higher"))
    return nice_above(max(most, AXIS_TOLERANCES * tolerance))


def _totals(data: ReportData) -> dict[str, float | None]:
    """Return mean luminances [cd/m²] of what was compared, and the witness's over ours less 1."""
    use = data.compared
    if not use.any():
        return dict.fromkeys(("ours", "witness", "excess"))
    ours, witness = (float(data.luminance(x)[use].mean()) for x in (data.ours, data.witness))
    return {"ours": ours, "witness": witness, "excess": witness / ours - 1 if ours else None}


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
        name, group, verdict = light["name"], light["group"], light["verdict"]
        if verdict == "undecided" and (light["energy_fraction"] or 0.0) < MIN_ENERGY:
            verdict = "faint"
        alike = [x["name"] for x in document["lights"] if group is not None and x["group"] == group]
        added = {
            "verdict": verdict,
            "cause": messages.get((light["diagnosis"], name)),
            "others": [other for other in alike if other != name],
        }
        rows.append(light | added)
    return sorted(rows, key=_importance)


def _importance(light: Mapping[str, Any]) -> tuple[int, float, float]:
    """Return what sorts lights: those that differ first, then by what they do to the picture."""
    share, scale = light["energy_fraction"] or 0.0, light["scale_in_witness"]
    off = abs(scale - 1) if scale is not None and light["verdict"] == "differ" else 0.0
    return list(wording.VERDICTS).index(light["verdict"]), -share * off, -share


def _pictures(data: ReportData, tolerance: float) -> dict[str, Any]:
    """Return the three pictures and everything that their legends and captions say."""
    import matplotlib as mpl
    from matplotlib.colors import to_hex

    relative, tiles = difference(data, tolerance)
    sizes = np.abs(relative[data.compared])
    extent = float(np.percentile(sizes, SHOWN_PIXELS)) if sizes.size else 0.0
    white = white_luminance(data)
    limit = min(nice_above(max(extent, TILE_TOLERANCES * tolerance)), 1.0)
    sides = {"brighter": tiles > 0, "darker": tiles < 0}
    height, width = relative.shape
    return {
        "ours": photograph(data, data.ours, white),
        "witness": photograph(data, data.witness, white),
        "map": difference_picture(data, relative, limit),
        "colours": [to_hex(c) for c in mpl.colormaps[COLOURS](np.linspace(0.0, 1.0, 13))],
        "limit": limit,
        "white": white,
        "exposure": float(np.log2(data.efficacy_lm_W / white)),
        "outlines": {side: outline(mask, (height, width)) for side, mask in sides.items()},
        "off": {side: int(mask.sum()) for side, mask in sides.items()},
        "tile_tolerance": TILE_TOLERANCES * tolerance,
        "noise_known": data.variance_witness is not None,
        "excluded": float(1 - data.compared.sum() / max(data.inside.sum(), 1)),
        "bordered": not bool(data.inside.all()),
        "peak": float(data.luminance(data.ours).max(initial=0.0)),
    }


@functools.cache
def _template() -> jinja2.Template:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: wording.visible(value) if type(value) is str else value,
    )
    for word in ("number", "percent", "signed_percent", "name", "kind"):
        environment.filters[word] = getattr(wording, word)
    environment.filters["quoted"] = lambda text: shlex.quote(str(text))
    return environment.get_template("report.html")


def render_report(data: ReportData) -> str:
    """Return the page of `data`; names from the scene are escaped, nothing is fetched."""
    document = data.document
    tolerance = document["settings"]["tolerance"]
    pictures, lights = _pictures(data, tolerance), _rows(document)
    return _template().render(
        d=document,
        witness=data.witness_name,
        css=(TEMPLATES / "report.css").read_text(encoding="utf-8"),
        said=wording.verdict(document, data.witness_name, lights, sum(pictures["off"].values())),
        verdicts=wording.VERDICTS,
        lights=lights,
        count=Counter(light["verdict"] for light in lights),
        limit=_reach(lights, tolerance),
        whisker=WHISKER,
        totals=_totals(data),
        pictures=pictures,
        size=(data.ours.shape[1], data.ours.shape[0]),
        findings=sorted(document["findings"], key=lambda f: SEVERITIES.index(f["severity"])),
    )
