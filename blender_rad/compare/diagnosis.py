# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for what is wrong with a light, by the factor or the picture that each cause predicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import Finding
from .factors import Problem, fit
from .pools import (
    CELLS_A_TILE,
    Array,
    Cells,
    Estimates,
    Pools,
    kept_tiles,
    tile_means,
    worst_tile,
)
from .result import MIN_ENERGY, Verdict
from .statistics import p_equivalent, p_outside

KM = 683.002  # lm/W, photopic
CYCLES_IES = 177.83  # lm/W, of Cycles' IES texture
RADIANCE = 179.0  # lm/W, of Radiance

SIGMAS = 3.0
NEGLIGIBLE = 0.25  # of the tolerance: structure below it is left alone
MAX_ERROR = 0.02  # a factor known no better would fit too many causes by chance
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

    alternatives: Mapping[str, Mapping[str, Array]]
    unit_scale_m: float
    film_exposure: float | None


@dataclass(frozen=True)
class Case:
    """A comparison that differs, and all that may tell why.

    Attributes
    ----------
    types : light type by name.
    verdicts : of the groups of `problem`, from the fit of our own layers.
    alpha : level of tests.
    """

    problem: Problem
    cells: Cells
    pools: Pools
    types: Mapping[str, str]
    verdicts: Sequence[Verdict]
    clues: Clues
    tolerance: float
    alpha: float


@dataclass(frozen=True)
class Named:
    """A cause found for one group, with the layer (p,) that it predicts for it, unscaled."""

    code: str
    message: str
    effect_percent: float
    column: Array


@dataclass(frozen=True)
class Diagnosis:
    """What is known of each group once the causes are: an innocent light is cleared.

    Attributes
    ----------
    factors, verdicts, causes : of the groups.
    """

    factors: Estimates
    verdicts: list[Verdict]
    causes: list[str | None]
    findings: list[Finding]


def _near(value: float, predicted: float, error: float) -> bool:
    return abs(value - predicted) <= SIGMAS * error + SLACK * predicted


def match_factor(
    factor: float, error: float, type_: str, scale: float
) -> list[tuple[Cause, float]]:
    """Return the causes, each with the factor it predicts, that explain a light's factor."""
    if error > MAX_ERROR * max(abs(factor), 1.0):
        return []
    return [
        (cause, value)
        for cause in CAUSES
        if not cause.types or type_.upper() in cause.types
        for value in cause.factors(scale)
        if not _near(value, 1.0, error) and _near(factor, value, error)
    ]


def _left(case: Case, columns: Array, known: Estimates) -> Array:
    """Return what `columns` at their factors leave of the witness, tile means (r, t, 3)."""
    model = case.cells.seen + (known.value @ columns).reshape(case.cells.seen.shape)
    return tile_means(case.cells, case.cells.residual(model))


def _tile_scale(pools: Pools) -> Array:
    return np.maximum(pools.tile_scale.reshape(-1, 3), np.finfo(float).tiny ** 0.5)


def misfit(case: Case, left: Array) -> tuple[float, float]:
    """Return the mean square relative structure in `left` (r, t, 3), and its standard error.

    Notes
    -----
    Products of different replicates, Σ_{i≠j} Σ_t x_i x_j / (r (r−1)), have no noise on average: it
    needs no noise model to see whether a fit is right. Tiles count by 1/scale, as the noise of
    light does.
    """
    if left.size == 0:
        return 0.0, 0.0
    count = len(left)
    scale = _tile_scale(case.pools)
    total = left.sum(axis=0)
    products = np.sum(left * (total - left) / scale, axis=(1, 2)) / (count - 1) / scale.sum()
    return float(products.mean()), float(2.0 * products.std(ddof=1) / math.sqrt(count))


def _is_structure(case: Case, found: tuple[float, float]) -> bool:
    value, error = found
    return value > max(SIGMAS * error, (case.tolerance * NEGLIGIBLE) ** 2)


def _shapes(case: Case, columns: Array, g: int) -> list[Named]:
    """Return what else group `g` could look like: the alternatives given, and another colour."""
    names, problem = case.cells.names, case.problem
    layers = case.cells.layers.reshape(len(names), -1)
    shapes: list[Named] = []
    for j in problem.groups[g]:
        for code, layer in case.clues.alternatives.get(names[j], {}).items():
            effect = 100.0 * float(layer.sum() / layers[j].sum() - 1.0)
            message = f"looks as {code} predicts, {effect:+.2f} % of its light"
            shapes.append(Named(code, message, effect, columns[g] + layer - layers[j]))
    lit = problem.channel_energy()[g] >= MIN_ENERGY
    if lit.sum() > 1:
        channels = [fit(columns, problem.target, problem.weights * only, problem.variance).value[g]
                    for only in np.arange(columns.shape[1]) % 3 == np.arange(3)[:, None]]
        values = np.where(lit, channels, 1.0)
        scaled = (columns[g].reshape(-1, 3) * values).ravel()
        listed = ", ".join(f"{v:.4g}" for v in values)
        effect = 100.0 * float(scaled.sum() / columns[g].sum() - 1.0)
        message = f"another colour in the witness: factors {listed} (R, G, B)"
        shapes.append(Named("colour", message, effect, scaled))
    return shapes


def _reshape(case: Case) -> tuple[Array, dict[int, Named]]:
    """Return the columns that leave least structure, and the groups that were changed for it.

    One group after the other takes the shape that helps most, as long as it halves what is left
    and needs no further factor. Where scaling leaves nothing, an alternative that needs no factor
    still explains more than one that has no name.
    """
    columns, named = case.problem.columns.copy(), dict[int, Named]()
    current = misfit(case, _left(case, columns, case.problem.known))
    for _ in case.problem.groups:
        structured = _is_structure(case, current)
        best: tuple[tuple[float, float], int, Named] | None = None
        for g in range(len(columns)):
            if g in named or case.problem.energy[g] == 0.0:
                continue
            for shape in _shapes(case, columns, g):
                tried = columns.copy()
                tried[g] = shape.column
                known = case.problem.factors(tried)
                found = misfit(case, _left(case, tried, known))
                free = shape.code != "colour" and case.verdicts[g] == "differ"
                good = found[0] < 0.5 * current[0] if structured else free and not _is_structure(
                    case, found
                )
                if good and _near(known.value[g], 1.0, known.error[g]) and (
                    best is None or found[0] < best[0][0]
                ):
                    best = found, g, shape
        if best is None:
            break
        current, g, named[g] = best
        columns[g] = named[g].column
    return columns, named


def _matches(case: Case, g: int, known: Estimates) -> list[tuple[Cause, float]]:
    """Return the causes that explain the factor of group `g` for each type of light in it."""
    types = {case.types[case.cells.names[j]] for j in case.problem.groups[g]}
    found = [
        match_factor(known.value[g], known.error[g], type_, case.clues.unit_scale_m)
        for type_ in sorted(types)
    ]
    return [match for match in found[0] if all(match in others for others in found)]


def _by_factor(case: Case, g: int, known: Estimates) -> Named | None:
    """Return the one cause that explains the factor of group `g`."""
    matches = _matches(case, g, known)
    if len(matches) != 1:
        return None
    cause, predicted = matches[0]
    value, error = known.value[g], known.error[g]
    message = f"{cause.message}; predicted {predicted:.5g}, measured {value:.5g} ± {error:.2g}"
    return Named(cause.code, message, 100.0 * (value - 1.0), case.problem.columns[g])


def _exposure(case: Case) -> tuple[float, bool] | None:
    """Return the factor of everything, directly seen emission too; and whether it is proven.

    It is where the file states it, or where seen emission shares it; else it may be lights alone.
    """
    problem = case.problem
    columns = np.vstack([problem.columns, problem.seen])
    target = problem.target + problem.seen * (problem.weights > 0)
    known = fit(columns, target, problem.weights, problem.variance)
    size = np.abs(columns.sum(axis=1))
    counts = size >= 0.01 * size.sum()
    value, error = known.value[counts], known.error[counts]
    if not counts.any():
        return None
    common = float(np.average(value, weights=1.0 / error**2))
    error_of_common = float(1.0 / np.linalg.norm(1.0 / error))
    shared = all(_near(v, common, e) for v, e in zip(value, error, strict=True))
    if not shared or _near(common, 1.0, error_of_common) or common <= SIGMAS * error_of_common:
        return None
    stated = case.clues.film_exposure
    if stated is not None:
        return (common, True) if _near(common, stated, error_of_common) else None
    return (common, bool(counts[-1])) if counts.sum() > 1 else None


def _exposed(case: Case, factor: float) -> Diagnosis:
    stated = case.clues.film_exposure
    said = "" if stated is None else f"; the file says {stated:.5g}"
    message = f"everything is {factor:.5g} times ours{said}"
    finding = Finding("film-exposure", "error", "", message, 100.0 * (factor - 1.0))
    causes = ["film-exposure" if v == "differ" else None for v in case.verdicts]
    return Diagnosis(case.problem.known, list(case.verdicts), causes, [finding])


def _without_tiles(case: Case, columns: Array) -> Estimates | None:
    """Return the factors from tiles where a fit leaves nothing; None if over a quarter is out.

    What a local error does to a fit spreads over the picture, so the worst tile goes first and the
    others are looked at again.
    """
    problem, where = case.problem, tuple(case.pools.where.T)
    kept = np.ones(kept_tiles(case.cells).shape, bool)
    rows, width = case.cells.ours.shape[:2]
    for _ in range(len(case.pools.where) // 4 + 1):
        cells = kept.repeat(CELLS_A_TILE, axis=0).repeat(CELLS_A_TILE, axis=1)[:rows, :width]
        weights = problem.weights * np.repeat(cells, 3)
        known = fit(columns, problem.target, weights, problem.variance)
        left = _left(case, columns, known) * kept[where][:, None]
        if not _is_structure(case, misfit(case, left)):
            return known
        score = (left.mean(axis=0) ** 2 / _tile_scale(case.pools)).sum(axis=1)
        row, column = case.pools.where[np.argmax(score)]
        kept[row, column] = False
    return None


def _unexplained(case: Case, columns: Array, known: Estimates, sound: bool) -> Finding:
    """Return the finding for what no lights explain: local, or everywhere of one sign, or neither.

    What sign it has shows in the difference from our own picture; a fit takes part of it up.
    """
    local = _left(case, columns, known).mean(axis=0).ravel()
    tiles = case.pools.tiles
    difference = local if sound else tiles.value
    relative, x, y = worst_tile(case.pools, difference)
    noise = SIGMAS * tiles.error + SLACK * case.pools.tile_scale
    if sound:
        code = "extra-light" if relative > 0 else "extra-shadow"
    elif (tiles.value > -noise).all():
        code = "extra-light"
    else:
        code = "extra-shadow" if (tiles.value < noise).all() else "unexplained"
    what = {
        "extra-light": "has light that none of ours explains",
        "extra-shadow": "lacks light that no light of ours as a whole explains",
        "unexplained": "spreads light in a way that no light of ours explains",
    }[code]
    hint = "" if sound else "; until that is found, the factors of lights mean little"
    message = f"the witness {what}, most at pixel ({x}, {y}): {100 * relative:+.2f} %{hint}"
    effect = 100.0 * float(difference.sum() / case.pools.tile_scale.sum())
    return Finding(code, "error", "", message, effect)


def _judge_again(case: Case, known: Estimates, named: Mapping[int, Named]) -> list[Verdict]:
    """Return the groups' verdicts with the causes in place."""
    judged = case.problem.energy >= MIN_ENERGY
    delta, limit = known.value - 1.0, np.full(len(known.value), case.tolerance)
    level = case.alpha / max(judged.sum(), 1)
    outside = judged & (p_outside(delta, known.error, known.df, limit) <= level)
    within = judged & (p_equivalent(delta, known.error, known.df, limit) <= case.alpha)
    return [
        "differ" if outside[g] or g in named else "agree" if within[g] else "undecided"
        for g in range(len(judged))
    ]


def diagnose(case: Case) -> Diagnosis:
    """Name the cause for each group of lights that is off in its factor, colour or shape.

    A proven film exposure comes first; then the shapes that leave least unexplained; what is left
    in few tiles is local, and the lights are judged by the others; what is left all over means that
    the lights cannot be judged; a factor without a signature is only held against a light if it
    moves more light than what is left. One that all share is a film exposure after all.
    """
    exposure = _exposure(case)
    if exposure is not None and exposure[1]:
        return _exposed(case, exposure[0])
    columns, named, findings = *_reshape(case), list[Finding]()
    known, leak = case.problem.factors(columns), 0.0
    if _is_structure(case, misfit(case, _left(case, columns, known))):
        named = {g: shape for g, shape in named.items() if shape.code != "colour"}
        columns = _with_shapes(case.problem.columns, named)
        trimmed = _without_tiles(case, columns)
        sound = trimmed is not None
        known = trimmed or case.problem.factors(columns)
        findings.append(_unexplained(case, columns, known, sound))
        leak = abs(findings[0].effect_percent or 0.0) / 100.0 if sound else math.inf
    verdicts = _judge_again(case, known, named)
    matched = {
        g: cause for g, verdict in enumerate(verdicts)
        if verdict == "differ" and g not in named and (cause := _by_factor(case, g, known))
    }
    off = [g for g, v in enumerate(verdicts) if v == "differ" and g not in {**named, **matched}]
    if exposure is not None and off:
        return _exposed(case, exposure[0])
    causes = {**named, **matched}
    for g in off:
        if case.problem.energy[g] * abs(known.value[g] - 1.0) >= leak:
            causes[g] = _scaled(case, g, known)
        else:
            verdicts[g] = "undecided"
    findings = [*(_finding(case, g, cause) for g, cause in sorted(causes.items())), *findings]
    codes = [causes[g].code if g in causes else None for g in range(len(verdicts))]
    return Diagnosis(_of_ours(case, known, columns), verdicts, codes, findings)


def _with_shapes(columns: Array, named: Mapping[int, Named]) -> Array:
    changed = columns.copy()
    for g, shape in named.items():
        changed[g] = shape.column
    return changed


def _scaled(case: Case, g: int, known: Estimates) -> Named:
    value, error = known.value[g], known.error[g]
    possible = ", ".join(cause.code for cause, _ in _matches(case, g, known))
    why = f"one of {possible}" if possible else "no known cause"
    message = f"{why}; {value:.5g} ± {error:.2g} times ours"
    return Named("scale", message, 100.0 * (value - 1.0), case.problem.columns[g])


def _finding(case: Case, g: int, cause: Named) -> Finding:
    members = ", ".join(case.cells.names[j] for j in case.problem.groups[g])
    return Finding(cause.code, "error", members, cause.message, cause.effect_percent)


def _of_ours(case: Case, known: Estimates, columns: Array) -> Estimates:
    """Return the factors of the shapes found as factors of our layers' energies."""
    ours = case.problem.columns.sum(axis=1)
    ratio = np.divide(columns.sum(axis=1), ours, out=np.ones_like(ours), where=ours != 0)
    return Estimates(
        known.value * ratio, known.witness_variance * ratio**2, known.our_variance * ratio**2,
        known.df,
    )
