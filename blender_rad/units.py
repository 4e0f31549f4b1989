# SPDX-License-Identifier: GPL-3.0-or-later
"""From unit to unit: through the emitter's shape, its spectrum, and the camera.

A unit is a quantity and a factor. An emitter rests on its intensity on axis, I (point, sphere,
spot, area, mesh), or on the irradiance of what faces it, E (sun, sky, no emitter); its other
quantities are a number times that. A spectrum is lumens and photons a watt. So a conversion is a
product, and its inverse the reciprocal.

A spot's flux is that of its cone alone, by which Blender's watts are not divided; this and an
area's spread are derived in `lights.spot` and `lights.area`. From an area E is I/d² from afar and,
where the area is given, that of a disc. A mesh is flat and shines from both faces. The flux of sun
and sky is what falls onto an area that faces them.

Camera. EV100 = log₂(N²/t · 100/S) is what a reflected-light meter with K = 12.5 (ISO 2720) says of
L_v = K/100 · 2^EV100. Exposed so, it becomes middle grey: the picture's value 0.18 is L_e · film
exposure · 2^(view exposure), and each of the two, the other at rest, is a unit of L_e.
"""

import math
import sys
from collections.abc import Callable, Mapping
from typing import NamedTuple

from .errors import RadError, unknown_name
from .quantities import PHOTOSYNTHETIC_NM, Unit, unit_named
from .spectra import Spectrum

Shape = Mapping[str, float]  # metres, m², seconds and radians, by the name of the option
# An equation, and the quantity over that on which the emitter rests; KeyError names what it lacks.
Relation = Callable[[Shape], tuple[str, float]]


def _from_ball(shape: Shape) -> tuple[str, float]:
    """Return I/d², which holds while all of the ball shines on the point."""
    c = math.cos(0.5 * shape.get("cone", math.pi))
    even = c + (1.0 - c) * shape.get("blend", 0.0)
    if shape.get("radius", 0.0) > shape["distance"] * math.sqrt(1.0 - even**2) * (1.0 + 1e-12):
        raise RadError("too near the ball for the inverse square", "--distance", "expected more")
    return "E = I/d²", shape["distance"] ** -2


def _from_disc(shape: Shape) -> tuple[str, float]:
    """Return E/I on the axis of a disc, L(θ) ∝ tan h − tan θ up to θ = t."""
    if "area" not in shape:
        return "E = I/d²", shape["distance"] ** -2
    half = 0.5 * shape.get("spread", math.pi)
    t = min(math.atan2(math.sqrt(shape["area"] / math.pi), shape["distance"]), half)
    lost = (t - math.sin(t) * math.cos(t)) / math.tan(half)
    text = "E = π I/A (sin²t − (t − sin t cos t)/tan h), t = min(h, atan(√(A/π)/d)), h = spread/2"
    text = text if "spread" in shape else "E = I/(d² + A/π)"
    return text, math.pi / shape["area"] * (math.sin(t) ** 2 - lost)


def _spot_flux(shape: Shape) -> tuple[str, float]:
    cap, kept = 1.0 - math.cos(0.5 * shape["cone"]), 1.0 - 0.5 * shape.get("blend", 0.0)
    return "Φ = 2π (1 − cos(cone/2)) (1 − blend/2) I", 2.0 * math.pi * cap * kept


def _area_flux(shape: Shape) -> tuple[str, float]:
    if "spread" not in shape:
        return "Φ = π I", math.pi
    half = 0.5 * shape["spread"]
    tangent = math.tan(half)
    return "Φ = π I (tan h − h)/tan h, h = spread/2", math.pi * (tangent - half) / tangent


def _sun_radiance(shape: Shape) -> tuple[str, float]:
    return "E = π sin²(angle/2) L", 1.0 / (math.pi * math.sin(0.5 * shape["angle"]) ** 2)


def _times(text: str, factor: float, name: str = "", power: int = 1) -> Relation:
    """Return the relation factor · option^power."""
    return lambda shape: (text, factor * (shape[name] ** power if name else 1.0))


_BALL = {
    "intensity": _times("", 1.0),
    "irradiance": _from_ball,
    "radiance": _times("L = I/(πr²)", 1.0 / math.pi, "radius", -2),
}
_POINT = _BALL | {"flux": _times("Φ = 4π I", 4.0 * math.pi)}
_PLATE = {
    "intensity": _times("", 1.0),
    "irradiance": _from_disc,
    "radiance": _times("L = I/A", 1.0, "area", -1),
}
_LIT = {"irradiance": _times("", 1.0), "flux": _times("Φ = E A", 1.0, "area")}
# What each may be given, and its quantities by form; None is no emitter.
EMITTERS: dict[str | None, tuple[tuple[str, ...], Mapping[str, Relation]]] = {
    None: (("distance", "area"), _LIT | {"intensity": _times("E = I/d²", 1.0, "distance", 2)}),
    "point": (("distance", "radius"), _POINT),
    "sphere": (("distance", "radius"), _POINT),
    "spot": (("distance", "radius", "cone", "blend"), _BALL | {"flux": _spot_flux}),
    "area": (("distance", "area", "spread"), _PLATE | {"flux": _area_flux}),
    "mesh": (("distance", "area"), _PLATE | {"flux": _times("Φ = 2π I", 2.0 * math.pi)}),
    "sun": (("angle", "area"), _LIT | {"radiance": _sun_radiance}),
    "sky": (("area",), _LIT | {"radiance": _times("E = π L", 1.0 / math.pi)}),
}
_ANGLE = (math.pi, "degrees above 0, up to 180")
_RANGES = {"cone": _ANGLE, "spread": _ANGLE, "angle": _ANGLE, "blend": (1.0, "0 to 1")}


class Conversion(NamedTuple):
    """A converted value, the efficacy that is known [lm/W], and how it came about."""

    value: float
    efficacy_lm_W: float | None  # noqa: N815 - the unit's own spelling
    formula: str


def convert(
    value: float,
    unit: str,
    to: str,
    *,
    emitter: str | None = None,
    shape: Shape | None = None,
    light: Spectrum | float | None = None,
) -> Conversion:
    """Return `value` in another of `UNITS`.

    The `emitter` is of `EMITTERS`, its `shape` and place by name, each above 0 (blend may be 0);
    `light` is a spectrum, or a luminous efficacy [lm/W] by convention. RadError names what is
    unknown, out of range, not finite or missing.
    """
    source, target, shape = unit_named(unit), unit_named(to), shape or {}
    if not math.isfinite(value) or (value < 0.0 and not source.stops):
        raise RadError(f"{value:g} {unit} is no amount of light", "VALUE", "expected 0 or more")
    _check(emitter, shape)
    texts, missing, result = [source.definition], list[str](), math.nan
    try:
        result = source.to_si(value)
        for end, other, sign in ((source, target, -1), (target, source, 1)):
            for relation in _by_kind(end, other, light) + _by_form(end, other, emitter, shape):
                try:
                    text, factor = relation(shape)
                except KeyError as lacking:
                    missing += [name for name in lacking.args if name not in missing]
                else:
                    texts.append(text)
                    result *= factor**sign
        result = target.from_si(result)
    except ArithmeticError:
        result = math.nan
    if missing:
        options = ", ".join(f"--{name}" for name in missing)
        options = options.replace("--spectrum", "--spectrum (for lumens, --efficacy will do)")
        angular = ("emitter", "cone", "angle")
        words = " and ".join(name + " (solid angle)" * (name in angular) for name in missing)
        raise RadError(f"{unit} to {to} needs: {words}", options, "expected as well, see --help")
    if not math.isfinite(result):
        what = f"{value:g} {unit} is no finite number of {to}"
        raise RadError(what, "VALUE", "expected another value, shape or spectrum")
    formula = "; ".join(dict.fromkeys(text for text in (*texts, target.definition) if text))
    known = light.efficacy_lm_W if isinstance(light, Spectrum) else light
    return Conversion(result, known, formula or f"1 {unit} = 1 {to}")


def _check(emitter: str | None, shape: Shape) -> None:
    """Raise for an unknown emitter, for what it has not, and for what is out of range."""
    if emitter and emitter not in EMITTERS:
        raise unknown_name("emitter", emitter, "--emitter", [name for name in EMITTERS if name])
    takes = (*EMITTERS[emitter][0], "duration")
    for name, value in shape.items():
        if name not in takes:
            what = f"{emitter or 'no emitter'} has no {name}"
            raise RadError(what, f"--{name}", f"expected any of: {', '.join(takes)}")
        high, expected = _RANGES.get(name, (sys.float_info.max, "more than 0"))
        if not (0.0 < value <= high or (value == 0.0 and name == "blend")):
            raise RadError(f"no {name} is like that", f"--{name}", f"expected {expected}")


def _by_kind(end: Unit, other: Unit, light: Spectrum | float | None) -> list[Relation]:
    """Return what leads from radiant to `end`; photons need no spectrum to be counted in µmol."""
    kinds = {end.kind, other.kind}
    counting = kinds == {"photon", "photosynthetic"} and not isinstance(light, Spectrum)
    if len(kinds) == 1 or end.kind == "radiant" or counting:
        return []
    if isinstance(light, Spectrum):
        if end.kind == "luminous":
            factor, text = light.efficacy_lm_W, "X_v = K X_e, K = {:.6g} lm/W ({})"
        elif end.kind == "photon":
            factor, text = light.photons_per_J(), "X_p = n X_e, n = {:.6g}/J ({})"
        else:
            factor = light.photons_per_J(PHOTOSYNTHETIC_NM)
            text = "X_p = n X_e, n = {:.6g}/J of 400–700 nm ({})"
        return [_times(text.format(factor, light.title), factor)]
    if light is None or end.kind != "luminous":
        return [_times("", 1.0, "spectrum")]
    return [_times(f"X_v = K X_e, K = {light:.6g} lm/W by convention", light)]


def _by_form(end: Unit, other: Unit, emitter: str | None, shape: Shape) -> list[Relation]:
    """Return what leads from that on which the emitter rests to `end`; energy is flux times t."""
    form, away = ("flux" if unit.form == "energy" else unit.form for unit in (end, other))
    steps = [_times("Q = Φ t", 1.0, "duration")] if end.form == "energy" != other.form else []
    if form == away:
        return steps
    pair = {form, away}
    bare = pair == {"irradiance", "flux"} and "area" in shape
    if not emitter and not bare and pair != {"irradiance", "intensity"}:
        lacking = ("emitter", "distance") if "irradiance" in pair else ("emitter",)
        return [_times("", 1.0, name) for name in lacking]
    if form not in EMITTERS[emitter][1]:
        what = f"{emitter} has no {end.quantity.words}"
        raise RadError(what, "--emitter", "expected another emitter")
    return [*steps, EMITTERS[emitter][1][form]]
