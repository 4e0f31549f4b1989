# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for what is wrong with a light, by the factor or the picture that each cause predicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import Finding
from .factors import Problem, fit
from .pools import Array
from .result import LightInfo, Verdict

KM = 683.002  # lm/W, photopic
CYCLES_IES = 177.83  # lm/W, of Cycles' IES texture
RADIANCE = 179.0  # lm/W, of Radiance

SIGMAS = 3.0
SLACK = 1e-3  # relative; Cycles itself is up to 3e-4 off the closed forms

_FALLING_OFF = frozenset({"POINT", "SPOT", "AREA"})


@dataclass(frozen=True)
class Cause:
    """A mistake that multiplies a light by a number.

    Attributes
    ----------
    code, message : key and explanation of the finding.
    factors : the light's factors in the witness that it may cause, for a unit scale in m.
    types : the light types that it can hit, empty for all.
    """

    code: str
    message: str
    factors: Callable[[float], tuple[float, ...]]
    types: frozenset[str] = frozenset()


def _both(value: float) -> tuple[float, float]:
    return value, 1.0 / value


CAUSES = (
    Cause("hidden", "missing, hidden or linked away in the witness", lambda scale: (0.0,)),
    Cause(
        "unit-scale",
        "its fall-off counts metres on one side and Blender units on the other: unit scale squared",
        lambda scale: _both(scale**2),
        _FALLING_OFF,
    ),
    Cause(
        "area-four-over-pi",
        "area light powers of before Blender 4.0, P/(4A) in place of P/(πA): π/4 or 4/π",
        lambda scale: _both(4.0 / math.pi),
        frozenset({"AREA"}),
    ),
    Cause(
        "efficacy-cycles-ies",
        "lumens turned into watts with 177.83 on one side and 683.002 lm/W on the other",
        lambda scale: _both(KM / CYCLES_IES),
        _FALLING_OFF,
    ),
    Cause(
        "efficacy-radiance",
        "lumens turned into watts with 179 on one side and 683.002 lm/W on the other",
        lambda scale: _both(KM / RADIANCE),
        _FALLING_OFF,
    ),
    Cause("pi", "radiance taken for radiosity: π", lambda scale: _both(math.pi)),
    Cause(
        "four-pi",
        "intensity taken for power: 4π",
        lambda scale: _both(4.0 * math.pi),
        frozenset({"POINT", "SPOT"}),
    ),
)


@dataclass(frozen=True)
class Clues:
    """What the caller knows beyond the pictures.

    Attributes
    ----------
    alternatives : for a light's name, by code of a cause, the (n,)-flattened cell sums of the layer
        that the light would have under it.
    unit_scale_m : of the file.
    film_exposure : of the file, or None.
    """

    alternatives: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    unit_scale_m: float = 1.0
    film_exposure: float | None = None


@dataclass(frozen=True)
class Diagnosis:
    """Causes by group (None where there is none), their findings, and the layers they predict."""

    causes: list[str | None]
    findings: list[Finding]
    columns: Array


def _near(value: float, predicted: float, error: float) -> bool:
    return abs(value - predicted) <= SIGMAS * error + SLACK * predicted


def match_factor(factor: float, error: float, type_: str, scale: float) -> tuple[Cause, float] | None:
    """Return the one cause, and its factor, that explains a light's factor; None if not unique."""
    found = {
        cause.code: (cause, value)
        for cause in CAUSES
        if not cause.types or type_.upper() in cause.types
        for value in cause.factors(scale)
        if not _near(value, 1.0, error) and _near(factor, value, error)
    }
    return next(iter(found.values())) if len(found) == 1 else None


def _better(problem: Problem, columns: Array) -> tuple[float, float]:
    """Return by how much `columns` explain the witness better than ours, and that number's error.

    It is the fall of the weighted sum of squares of what is left, replicate by replicate, each
    side with its own best factors.
    """
    falls = np.zeros(len(problem.target))
    for sign, layers in ((1.0, problem.columns), (-1.0, columns)):
        left = problem.target - problem.factors(layers).value @ layers
        falls += sign * np.sum(problem.weights * left**2, axis=1)
    return float(falls.mean()), float(falls.std(ddof=1) / math.sqrt(len(falls)))


def _alternative(
    problem: Problem, g: int, layers: Array, names: tuple[str, ...], clues: Clues, needs_proof: bool
) -> tuple[str, str, float, Array] | None:
    """Return light, cause, effect and columns of the best alternative layer in group `g`."""
    best, best_gain = None, 0.0
    for j in problem.groups[g]:
        for code, layer in clues.alternatives.get(names[j], {}).items():
            columns = problem.columns.copy()
            columns[g] += layer - layers[j]
            factors = problem.factors(columns)
            gain, noise = _better(problem, columns)
            proven = gain - SIGMAS * noise > 0 if needs_proof else gain + SIGMAS * noise > 0
            fits = _near(float(factors.value[g]), 1.0, float(factors.error[g]))
            if proven and fits and (best is None or gain > best_gain):
                effect = float(layer.sum() / layers[j].sum() - 1.0) * 100.0
                best, best_gain = (names[j], code, effect, columns), gain
    return best


def common_factor(problem: Problem) -> tuple[float, float, int] | None:
    """Return the factor that all lights and all seen emission share, its error and their number.

    None where they do not share one.
    """
    columns = np.vstack([problem.columns, problem.seen])
    factors = fit(columns, problem.target + problem.seen * (problem.weights > 0),
                  problem.weights, problem.variance)
    size = np.abs(columns.sum(axis=1))
    counts = size >= 0.01 * size.sum()
    value, error = factors.value[counts], factors.error[counts]
    if not counts.any():
        return None
    common = float(np.average(value, weights=1.0 / error**2))
    near = all(_near(v, common, e) for v, e in zip(value, error, strict=True))
    known = float(1.0 / np.sqrt(np.sum(1.0 / error**2)))
    return (common, known, int(counts.sum())) if near else None


def _exposure(problem: Problem, clues: Clues) -> tuple[float, bool] | None:
    """Return the film exposure that explains everything, and whether the file states it."""
    shared = common_factor(problem)
    if shared is None or _near(shared[0], 1.0, shared[1]):
        return None
    factor, error, number = shared
    if clues.film_exposure is not None:
        return (factor, True) if _near(factor, clues.film_exposure, error) else None
    return (factor, False) if number > 1 else None


def diagnose(
    problem: Problem,
    names: tuple[str, ...],
    layers: NDArray[np.float64],
    infos: Mapping[str, LightInfo],
    verdicts: list[Verdict],
    clues: Clues,
) -> Diagnosis:
    """Name the cause for each group of lights that differs, and for any that differs in shape.

    Parameters
    ----------
    layers : (j, p) cell sums of our lights, in the order of `names`.
    verdicts : of the groups.
    """
    factors = problem.factors()
    causes: list[str | None] = [None] * len(problem.groups)
    findings: list[Finding] = []
    columns = problem.columns.copy()

    def name(g: int, code: str, message: str, effect: float) -> None:
        causes[g] = code
        members = ", ".join(names[j] for j in problem.groups[g])
        findings.append(Finding(code, "error", members, message, effect))

    exposure = _exposure(problem, clues)
    seen_too = float(np.abs(problem.seen).sum()) > 0.01 * float(np.abs(problem.columns).sum())
    if exposure is not None and (exposure[1] or seen_too):
        return _all_exposed(problem, exposure[0], verdicts, clues)
    for g, verdict in enumerate(verdicts):
        value, error = float(factors.value[g]), float(factors.error[g])
        found = _alternative(problem, g, layers, names, clues, verdict != "differ")
        if found is not None and (verdict == "differ" or problem.energy[g] > 0):
            light, code, effect, replaced = found
            columns[g] = replaced[g]
            name(g, code, f"{light}: the witness shows it as {code} predicts "
                 f"({effect:+.2f} % of its light)", effect)
            continue
        if verdict != "differ":
            continue
        types = {infos[names[j]].type for j in problem.groups[g]}
        match = match_factor(value, error, types.pop(), clues.unit_scale_m) if len(types) == 1 else None
        measured = f"measured {value:.5g} ± {error:.2g}"
        if match is not None:
            cause, predicted = match
            name(g, cause.code, f"{cause.message}; predicted {predicted:.5g}, {measured}",
                 100.0 * (value - 1.0))
    open_groups = [g for g, v in enumerate(verdicts) if v == "differ" and causes[g] is None]
    if exposure is not None and open_groups:
        return _all_exposed(problem, exposure[0], verdicts, clues)
    for g in open_groups:
        name(g, *_unnamed(problem, g, factors.value[g], factors.error[g]))
    return Diagnosis(causes, findings, columns)


def _unnamed(problem: Problem, g: int, value: float, error: float) -> tuple[str, str, float]:
    """Return code, message and effect for a light that is off by a number, or in its colour."""
    channels = [problem.channel_factors(c) for c in range(3)]
    value_c = np.array([channel.value[g] for channel in channels])
    error_c = np.array([channel.error[g] for channel in channels])
    lit = problem.channel_energy()[g] >= 0.01
    effect = 100.0 * (float(value) - 1.0)
    if lit.sum() > 1 and np.ptp(value_c[lit]) > SIGMAS * np.hypot.reduce(error_c[lit]) + SLACK:
        listed = ", ".join(f"{v:.4g}" for v in value_c)
        return "colour", f"its colour is another in the witness: factors {listed} (R, G, B)", effect
    return "scale", f"no known cause; it is {value:.5g} ± {error:.2g} times ours", effect


def _all_exposed(
    problem: Problem, factor: float, verdicts: list[Verdict], clues: Clues
) -> Diagnosis:
    said = "" if clues.film_exposure is None else f"; the file says {clues.film_exposure:.5g}"
    message = f"everything is {factor:.5g} times ours: film exposure{said}"
    finding = Finding("film-exposure", "error", "", message, 100.0 * (factor - 1.0))
    causes = ["film-exposure" if v == "differ" else None for v in verdicts]
    return Diagnosis(causes, [finding], problem.columns)
