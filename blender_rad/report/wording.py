# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and verdicts in plain words; None is "not known"."""

import math
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from ..compare.result import MIN_SUPPORTED

UNKNOWN = "–"
HEADLINE_NAME = 48  # characters of a name in the headline
NEARLY_ALL = 0.98  # of the lit picture: what is compared is named below this
MISSING, DOUBLE = 0.02, 1.5  # factors from which percent no longer say it best
VERDICTS = {  # what matters first
    "differ": "Differs",
    "undecided": "Undecided",
    "agree": "Agrees",
    "faint": "Too faint to judge",
}


def number(value: float | None, digits: int = 4) -> str:
    """Return `value` with `digits` significant digits, thousands apart, a real minus sign."""
    if value is None:
        return UNKNOWN
    text = f"{value:,.0f}" if 1e4 <= abs(value) < 1e9 else f"{value:.{digits}g}"
    return text.replace(",", "\u202f").replace("-", "−")


def percent(value: float | None) -> str:
    """Return a fraction as percent: 0.1234 is '12.3 %'."""
    return UNKNOWN if value is None else number(100 * value, 3) + "\u202f%"


def signed_percent(value: float | None, error: float | None = None) -> str:
    """Return a signed fraction as percent, to its error's second digit: '+2.03 % ± 0.21 %'."""
    if value is None:
        return UNKNOWN
    size = error or abs(value)
    places = 2 if size == 0 else min(max(1 - math.floor(math.log10(100 * size)), 0), 3)
    rounded = round(100 * value, places)
    text = f"{rounded:+.{places}f}\u202f%" if rounded else f"{0:.{places}f}\u202f%"
    text += "" if error is None else f" ± {100 * error:.{places}f}\u202f%"
    return text.replace("-", "−")


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
    return str(text).replace("_", " ").replace("-", " ").strip().lower().capitalize()


def deviation(light: Mapping[str, Any]) -> str:
    """Return in words how the witness shows `light`."""
    scale = light["scale_in_witness"]
    if scale is None:
        return "cannot be measured"
    if abs(scale) < MISSING:
        return "is missing"
    if scale < 0:
        return "has the wrong sign"
    if scale >= DOUBLE:
        return f"is {number(scale, 3)} times as bright as it should be"
    text = signed_percent(abs(scale - 1), light["standard_error"]).lstrip("+")
    return f"is {text} too {'bright' if scale > 1 else 'dark'}"


def verdict(
    document: Mapping[str, Any], witness: str, rows: list[dict[str, Any]], tiles_off: int
) -> tuple[Markup, Markup]:
    """Return the verdict as one plain sentence, and what stands behind it or would bring one.

    `rows` are the lights with ``cause``, what matters first.
    """
    settings, coverage = document["settings"], document["coverage"]["supported_pixel_fraction"]
    tolerance = percent(settings["tolerance"])
    if document["verdict"] == "agree":
        text = "{} agrees with the physics of this scene within {}, at {} confidence."
        behind = "This holds for {} of the lit picture: see “What was left out”."
        behind = Markup(behind if coverage < NEARLY_ALL else "").format(percent(coverage))
        return Markup(text).format(witness, tolerance, percent(settings["confidence"])), behind
    if document["verdict"] == "differ":
        behind = Markup("")
        for row in [row for row in rows if row["cause"]][:1]:
            cause = visible(row["cause"])
            known = f"Cause: {cause}" if row["diagnosis"] != "scale" else cause
            behind = Markup("{}.").format(known[:1].upper() + known[1:])
        return Markup("{} differs: {}.").format(witness, _what_differs(rows, tiles_off)), behind
    if not document["pixels"]["compared"]:
        return Markup("Undecided: there is nothing to compare."), Markup("")
    if coverage < MIN_SUPPORTED:
        text = "Undecided: only {} of the lit picture could be compared."
        behind = "What is in the way stands under “What was left out”."
        if settings["shading"] == "full":
            behind += " <code>--shading clay</code> checks the lights alone."
        return Markup(text).format(percent(coverage)), Markup(behind)
    late = [x["message"] for x in document["findings"] if x["code"] == "out-of-time"]
    if late:
        behind = Markup("Give it a longer <code>--time-limit</code>.")
        if any(row["verdict"] == "differ" for row in rows):
            behind += Markup(" So far {}.").format(_what_differs(rows, tiles_off))
        return Markup("Undecided: {}.").format(late[0]), behind
    text = "Undecided: the noise is still too high to tell within {}."
    behind = (
        "More samples (<code>--samples</code>, or a longer <code>--time-limit</code>) or a wider "
        "<code>--tolerance</code> would decide it."
    )
    return Markup(text).format(tolerance), Markup(behind)


def _what_differs(rows: list[dict[str, Any]], tiles_off: int) -> Markup:
    off = [row for row in rows if row["verdict"] == "differ"]
    if off:
        first = Markup("“{}” {}").format(name(off[0]["name"], HEADLINE_NAME), deviation(off[0]))
        if len(off) == 1:
            return Markup("light {}").format(first)
        text = "{} of {} lights are off. What weighs most: {}"
        return Markup(text).format(len(off), len(rows), first)
    if tiles_off:
        where = "one part" if tiles_off == 1 else f"{tiles_off} parts"
        text = "each light has the right power, but {} of the picture did not come out right"
        return Markup(text).format(where)
    return Markup("the lights agree one by one, but the total energy does not")
