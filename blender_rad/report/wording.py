# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and verdicts in plain words. Every function takes None or nan for "not known"."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

UNKNOWN = "–"
HEADLINE_NAME = 48  # characters of a name in the headline
MISSING, DOUBLE = 0.02, 1.5  # factors from which percent no longer say it best
ORDER = {"differ": 0, "undecided": 1, "agree": 2, "faint": 3}
SEVERITIES = {"error": 0, "warning": 1, "info": 2}
VERDICTS = {
    "agree": "Agrees",
    "differ": "Differs",
    "undecided": "Undecided",
    "faint": "Too faint to judge",
}
HALF = 0.5  # of the lit pixels: with less there is no verdict
FAINT = 0.01  # of the energy: lights below take no part in the verdict
METRICS = {  # label, ideal, what it says of {witness}
    "energy_ratio": (
        "Energy ratio",
        "1",
        "Our light in total over that of {}. Above 1, {} is too dark as a whole.",
    ),
    "mean_signed_relative_error": (
        "Mean signed error",
        "0",
        "Ours less {}, pixel by pixel, then averaged. Noise cancels, a bias stays.",
    ),
    "p95_absolute_relative_error": (
        "95 % of pixels within",
        "0",
        "Only one value in twenty is further off. Noise counts here.",
    ),
    "relmse": (
        "relMSE",
        "0",
        "Mean squared error relative to brightness, as papers quote it. Noise counts here.",
    ),
}


def known(value: float | None) -> bool:
    """Return whether `value` is a finite number."""
    return value is not None and math.isfinite(value)


def number(value: float | None, digits: int = 4) -> str:
    """Return `value` with `digits` significant digits, thousands apart, a real minus sign.

    Examples
    --------
    >>> number(12345.678), number(-0.00123), number(None)
    ('12\u202f346', '−0.00123', '–')
    """
    if value is None or not math.isfinite(value):
        return UNKNOWN
    if 1e4 <= abs(value) < 1e9:
        text = f"{value:,.0f}".replace(",", "\u202f")
    else:
        text = f"{value:.{digits}g}"
    return text.replace("-", "−")


def percent(value: float | None) -> str:
    """Return a fraction as percent: 0.1234 is '12.3 %'."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    return number(100 * value, 3) + "\u202f%"


def signed_percent(value: float | None, error: float | None = None) -> str:
    """Return a signed fraction as percent, with its error where it is known.

    Digits stop at the error's second one: finer ones say nothing.

    Examples
    --------
    >>> signed_percent(0.02034, 0.0021)
    '+2.03\u202f% ± 0.21\u202f%'
    """
    if value is None or not math.isfinite(value):
        return UNKNOWN
    size = abs(value) if error is None or not math.isfinite(error) or error == 0 else error
    places = 2 if size == 0 else 1 - math.floor(math.log10(100 * size))
    places = min(max(places, 0), 3)
    text = f"{100 * value:+.{places}f}".replace("-", "−")
    if float(text.replace("−", "-")) == 0:
        text = text.replace("+", "").replace("−", "")
    text += "\u202f%"
    if error is not None and math.isfinite(error):
        text += f" ± {100 * error:.{places}f}\u202f%"
    return text


def visible(text: object) -> str:
    """Return `text` with control characters made visible, so that no name can upset the page."""
    symbols = {code: 0x2400 + code for code in range(32)} | {127: 0x2421}
    return str(text).translate(symbols).encode("utf-8", "replace").decode("utf-8")


def name(text: object, length: int | None = None) -> Markup:
    """Return a name from the scene, escaped, its writing direction kept to itself."""
    shown = visible(text)
    if length is not None and len(shown) > length:
        shown = shown[: length - 1] + "…"
    return Markup('<bdi dir="auto">{}</bdi>').format(shown)


def kind(text: object) -> str:
    """Return a type or key of the program as words: 'MESH_EMITTER' is 'Mesh emitter'."""
    return visible(text).replace("_", " ").replace("-", " ").strip().lower().capitalize()


def deviation(light: Mapping[str, Any]) -> str:
    """Return in words how the witness shows `light`."""
    scale, error = light.get("scale_in_witness"), light.get("standard_error")
    if scale is None or not math.isfinite(scale):
        return "cannot be measured"
    if abs(scale) < MISSING:
        return "is missing"
    if scale < 0:
        return "has the wrong sign"
    if scale >= DOUBLE:
        return f"is {number(scale, 3)} times as bright as it should be"
    text = signed_percent(abs(scale - 1), error).lstrip("+")
    return f"is {text} too {'bright' if scale > 1 else 'dark'}"


def by_importance(lights: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return `lights` with those that differ first, then by what they do to the picture."""

    def weight(light: Mapping[str, Any]) -> tuple[int, float, float]:
        energy, scale = light.get("energy_fraction"), light.get("scale_in_witness")
        share = energy if energy is not None and known(energy) else 0.0
        off = abs(scale - 1) if scale is not None and known(scale) else 0.0
        rank = ORDER[light["verdict"]]
        return rank, -share * off if rank == 0 else 0.0, -share

    return sorted(lights, key=weight)


def headline(document: Mapping[str, Any], witness: str, tiles_off: int) -> Markup:
    """Return the verdict as one plain sentence."""
    settings = document["settings"]
    tolerance, confidence = percent(settings["tolerance"]), percent(settings["confidence"])
    if document["verdict"] == "agree":
        text = "{} agrees with the physics of this scene within {}, at {} confidence."
        return Markup(text).format(witness, tolerance, confidence)
    if document["verdict"] == "undecided":
        return _why_undecided(document, tolerance)
    off = [x for x in by_importance(document["lights"]) if x["verdict"] == "differ"]
    if not off:
        return Markup("{} differs: {}.").format(witness, _where_else(document, tiles_off))
    first = Markup("“{}” {}").format(name(off[0]["name"], HEADLINE_NAME), deviation(off[0]))
    if len(off) == 1:
        return Markup("{} differs: light {}.").format(witness, first)
    text = "{} differs: {} of {} lights are off. What weighs most: {}."
    return Markup(text).format(witness, len(off), len(document["lights"]), first)


def _where_else(document: Mapping[str, Any], tiles_off: int) -> str:
    """Return what differs when every light by itself agrees."""
    if tiles_off:
        where = "one part" if tiles_off == 1 else f"{tiles_off} parts"
        return f"each light has the right power, but {where} of the picture did not come out right"
    return "the lights agree one by one, but the total energy does not"


def _why_undecided(document: Mapping[str, Any], tolerance: str) -> Markup:
    """Return what stood in the way of a verdict."""
    supported = document["coverage"]["supported_pixel_fraction"]
    if not document["pixels"]["compared"]:
        return Markup("Undecided: there is nothing to compare.")
    if known(supported) and supported < HALF:
        text = "Undecided: only {} of the lit picture could be compared."
        return Markup(text).format(percent(supported))
    text = "Undecided: the noise is still too high to tell within {}."
    return Markup(text).format(tolerance)


def next_step(document: Mapping[str, Any], rows: list[dict[str, Any]]) -> Markup | None:
    """Return what stands behind the verdict, or what would bring one; None where all is well.

    `rows` are the lights with ``cause``, what matters first.
    """
    if document["verdict"] == "differ":
        cause = next((row["cause"] for row in rows if row["cause"]), None)
        return Markup("Cause: {}").format(visible(cause)) if cause else None
    supported = document["coverage"]["supported_pixel_fraction"]
    if document["verdict"] == "agree" or not document["pixels"]["compared"]:
        return None
    if known(supported) and supported < HALF:
        way_out = Markup(" <code>--shading clay</code> checks the lights alone.")
        text = Markup("What is in the way stands under “What was left out”.")
        return text + (way_out if document["settings"]["shading"] == "full" else "")
    text = "More samples or a wider {} would decide it."
    return Markup(text).format(Markup("<code>--tolerance</code>"))


def metric(key: str, value: float | None, witness: str) -> tuple[str, str, str, str]:
    """Return a metric's label, its value, its ideal and what it says; plain for unknown ones."""
    label, ideal, words = METRICS.get(key, (kind(key), UNKNOWN, ""))
    if key == "mean_signed_relative_error":
        shown = signed_percent(value)
    else:
        shown = percent(value) if key.startswith("p95") else number(value, 5)
    return label, shown, ideal, words.replace("{}", witness)


def command(document: Mapping[str, Any]) -> str:
    """Return the command line that makes this report again."""
    given = document.get("command")
    if given is not None:
        return visible(given if isinstance(given, str) else shlex.join(given))
    scene, settings = document["scene"], document["settings"]
    words = ["blender-rad", "check", str(scene["file"]), "--report", "report"]
    words += ["--frame", str(scene["frame"]), "--camera", str(scene["camera"])]
    words += ["--resolution", "{}x{}".format(*scene["resolution"])]
    for key in ("tolerance", "confidence", "model", "shading"):
        words += [f"--{key}", str(settings[key])]
    words += ["--efficacy", str(settings["efficacy_lm_W"])]
    return visible(shlex.join(words))
