# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for what is wrong with a light, by the factor or the picture that each cause predicts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats
from ..errors import Finding
from ..quantities import EFFICACIES_LM_W
from .claims import claims_of_lights
from .factors import Problem, fit, problem_from_cells
from .pools import Cells, Estimates, Pools, kept_tiles, pool, spread_out, tile_means
from .result import MIN_ENERGY, Verdict

PHOTOPIC, CYCLES_IES, RADIANCE = EFFICACIES_LM_W.values()

SIGMAS = 3.0
LIKELY_SIGMAS = 2.0  # where only the factor tells a cause from a mere scale
NEGLIGIBLE = 0.25  # of the tolerance: structure below it is left alone
MAX_ERROR = 0.02  # a factor known no better would fit too many causes by chance
SLACK = 1e-3  # relative; Cycles itself is up to 3e-4 off the closed forms


class Cause(NamedTuple):
    """A mistake that multiplies a light by ``value * unit scale in m ** power``, or divides it."""

    code: str
    message: str
    value: float
    types: str = ""  # of lights that it can hit, separated by blanks; none for all
    power: int = 0

    def factors(self, scale: float) -> set[float]:
        """Return the light's factors in the witness that it may cause, for a unit scale in m."""
        value = self.value * scale**self.power
        return {value, 1.0 / value} if value else {0.0}


_FALLING_OFF = "POINT SPOT AREA"
_UNITS = "its fall-off counts metres on one side and Blender units on the other: unit scale squared"
_BEFORE_4 = "area light powers of before Blender 4.0, P/(4A) in place of P/(πA): π/4 or 4/π"
_LUMENS = "lumens turned into watts with {:g} on one side and 683.002 lm/W on the other"
CAUSES = (
    Cause("hidden", "missing, hidden or linked away in the witness", 0.0),
    Cause("unit-scale", _UNITS, 1.0, _FALLING_OFF, power=2),
    Cause("area-four-over-pi", _BEFORE_4, 4.0 / math.pi, "AREA"),
    Cause("efficacy-cycles-ies", _LUMENS.format(CYCLES_IES), PHOTOPIC / CYCLES_IES, _FALLING_OFF),
    Cause("efficacy-radiance", _LUMENS.format(RADIANCE), PHOTOPIC / RADIANCE, _FALLING_OFF),
    Cause("pi", "radiance taken for radiosity: π", math.pi),
    Cause("four-pi", "intensity taken for power: 4π", 4.0 * math.pi, "POINT SPOT"),
)


SHAPES = {"soft-falloff": "as if Soft Falloff were on in one and off in the other"}


def _near(value: float, predicted: float, error: float, sigmas: float = SIGMAS) -> bool:
    return abs(value - predicted) <= sigmas * error + SLACK * predicted


def match_factor(
    factor: float, error: float, types: set[str], scale: float
) -> list[tuple[Cause, float]]:
    """Return the causes that explain a factor of lights of all `types`, with what each predicts."""
    if error > MAX_ERROR * max(abs(factor), 1.0):
        return []
    return [
        (cause, value)
        for cause in CAUSES
        if not cause.types or types <= set(cause.types.split())
        for value in cause.factors(scale)
        if not _near(value, 1.0, error) and _near(factor, value, error)
    ]


class Left(NamedTuple):
    """What a fit leaves of the witness: mean square relative structure."""

    square: float
    error: float


class Named(NamedTuple):
    """A cause found for one group, with the layer (p,) that it predicts for it, unscaled."""

    code: str
    message: str
    effect_percent: float
    column: Floats


@dataclass(frozen=True)
class Diagnosis:
    """What is known of each group once the causes are: an innocent light is cleared."""

    factors: Estimates
    verdicts: list[Verdict]
    causes: list[str | None]
    findings: list[Finding]


@dataclass(frozen=True)
class Case:
    """A comparison, and all that may tell why it differs; see `judge`."""

    cells: Cells
    types: Mapping[str, str]  # by name of the light
    tolerance: float
    alpha: float  # level of the tests for `differ`
    agree_alpha: float  # and for `agree`
    alternatives: Mapping[str, Mapping[str, Floats]]  # cell sums (p,)
    unit_scale_m: float
    film_exposure: float | None
    bearable: float = math.inf  # error of a factor beyond which lights join: samples would not do

    @cached_property
    def pools(self) -> Pools:
        """Differences of the frame and the tiles."""
        return pool(self.cells)

    @cached_property
    def problem(self) -> Problem:
        """The fit of all lights."""
        return problem_from_cells(self.cells, self.pools).joined(self.bearable)

    def members(self, g: int) -> list[str]:
        """Return the names of the lights of group `g`."""
        return [self.cells.names[j] for j in self.problem.groups[g]]

    def verdicts(self, known: Estimates) -> list[Verdict]:
        """Return those of the groups from their factors."""
        claims = claims_of_lights(self.problem, known, self.tolerance)
        outside, within = claims.outside(self.alpha), claims.within(self.agree_alpha)
        return claims.verdicts(len(known.value), outside, within)

    @property
    def tile_scale(self) -> Floats:
        """What tiles count relative to, (t, 3)."""
        return np.maximum(self.pools.tiles.scale.reshape(-1, 3), np.finfo(float).tiny ** 0.5)

    def left(self, columns: Floats, known: Estimates) -> Floats:
        """Return what `columns` at their factors leave of the witness, tile means (r, t, 3)."""
        model = self.cells.seen + (known.value @ columns).reshape(self.cells.seen.shape)
        return tile_means(self.cells, self.cells.residual(model))

    def misfit(self, left: Floats, kept: Bools | None = None) -> Left:
        """Return how much structure there is in `left` (r, t, 3), in the tiles `kept` (t,).

        Notes
        -----
        Products of different replicates, Σ_{i≠j} Σ_t x_i x_j / (r (r−1)), have no noise of the
        witness on average: it needs no noise model to see whether a fit is right. Ours is the same
        in all; its variance v is taken off, which is known to √2 v, and three channels share it.
        Tiles count by 1/scale, as the noise of light does.
        """
        if left.size == 0:
            return Left(0.0, 0.0)
        count, scale = len(left), self.tile_scale
        weight = (1.0 if kept is None else kept[:, None]) / scale / scale.sum()
        ours = weight * self.pools.tiles.our_variance.reshape(-1, 3)
        total = left.sum(axis=0)
        products = np.sum(left * (total - left) * weight, axis=(1, 2)) / (count - 1)
        theirs = 2.0 * products.std(ddof=1) / math.sqrt(count)
        error = math.hypot(theirs, math.sqrt(2.0 * 3.0) * np.linalg.norm(ours))
        return Left(float(products.mean() - ours.sum()), error)

    def is_structure(self, found: Left) -> bool:
        """Tell whether `found` is neither noise nor negligible."""
        return found.square > max(SIGMAS * found.error, (self.tolerance * NEGLIGIBLE) ** 2)


def _shapes(case: Case, columns: Floats, g: int) -> list[Named]:
    """Return what else group `g` could look like: the alternatives given, and another colour."""
    names, problem = case.cells.names, case.problem
    layers = case.cells.layers.reshape(len(names), -1)
    shapes: list[Named] = []
    for j in problem.groups[g]:
        for code, layer in case.alternatives.get(names[j], {}).items():
            effect = 100.0 * float(layer.sum() / layers[j].sum() - 1.0)
            message = f"{SHAPES.get(code, code)}: {effect:+.2f} % of its light"
            shapes.append(Named(code, message, effect, columns[g] + layer - layers[j]))
    lit = problem.channel_energy()[g] >= MIN_ENERGY
    if lit.sum() > 1:
        channels = [problem.channel_factors(columns, c).value[g] for c in range(3)]
        values = np.where(lit, channels, 1.0)
        scaled = (columns[g].reshape(-1, 3) * values).ravel()
        listed = ", ".join(f"{v:.4g}" for v in values)
        effect = 100.0 * float(scaled.sum() / columns[g].sum() - 1.0)
        message = f"another colour in the witness: factors {listed} (R, G, B)"
        shapes.append(Named("colour", message, effect, scaled))
    return shapes


def _reshape(case: Case, verdicts: Sequence[Verdict]) -> dict[int, Named]:
    """Return the shapes of groups that leave least structure.

    One group after the other takes the shape that helps most, as long as it halves what is left
    and needs no further factor. Where scaling leaves nothing, an alternative that needs no factor
    still explains more than one that has no name.
    """
    problem, named = case.problem, dict[int, Named]()
    current = case.misfit(case.left(problem.columns, problem.known))
    for _ in problem.groups:
        structured, columns = case.is_structure(current), _with_shapes(problem.columns, named)
        tried: list[tuple[Left, int, Named]] = []
        for g in np.flatnonzero(problem.energy).tolist():
            for shape in _shapes(case, columns, g) if g not in named else []:
                changed = _with_shapes(columns, {g: shape})
                known = problem.factors(changed)
                found = case.misfit(case.left(changed, known))
                if structured:
                    good, sigmas = found.square < 0.5 * current.square, SIGMAS
                else:
                    free = shape.code != "colour" and verdicts[g] == "differ"
                    good, sigmas = free and not case.is_structure(found), LIKELY_SIGMAS
                if good and _near(float(known.value[g]), 1.0, float(known.error[g]), sigmas):
                    tried.append((found, g, shape))
        if not tried:
            break
        current, g, named[g] = min(tried, key=lambda each: each[0].square)
    return named


def _with_shapes(columns: Floats, named: Mapping[int, Named]) -> Floats:
    changed = columns.copy()
    for g, shape in named.items():
        changed[g] = shape.column
    return changed


def _by_factor(case: Case, g: int, known: Estimates) -> tuple[bool, Named]:
    """Return whether one cause alone explains the factor of group `g`, and that or what may."""
    value, error = known.value[g], known.error[g]
    types = {case.types[name] for name in case.members(g)}
    matches = match_factor(value, error, types, case.unit_scale_m)
    if len(matches) == 1:
        cause, predicted = matches[0]
        code = cause.code
        said = f"{cause.message}; predicted {predicted:.5g}, measured {value:.5g} ± {error:.2g}"
    else:
        possible = ", ".join(cause.code for cause, _ in matches)
        why = f"one of {possible}" if possible else "no known cause"
        code, said = "scale", f"{why}; {value:.5g} ± {error:.2g} times ours"
    effect = 100.0 * (value - 1.0)
    return len(matches) == 1, Named(code, said, effect, case.problem.columns[g])


def _exposure(case: Case) -> tuple[float, bool] | None:
    """Return the factor of everything, directly seen emission too; and whether it is proven.

    It is where the file states it, or where seen emission shares it; else it may be lights alone.
    """
    problem, stated = case.problem, case.film_exposure
    columns = np.vstack([problem.columns, problem.seen])
    noise = np.vstack([problem.noise, np.zeros_like(problem.seen)])
    target = problem.target + problem.seen * (problem.weights > 0)
    known = fit(columns, noise, target, problem.weights, problem.variance)
    size = np.abs(columns.sum(axis=1))
    counts = size >= 0.01 * size.sum()
    if not counts.any():
        return None
    value, error = known.value[counts], known.error[counts]
    common = float(np.average(value, weights=1.0 / error**2))
    error_of_common = float(1.0 / np.linalg.norm(1.0 / error))
    shared = all(_near(v, common, e) for v, e in zip(value, error, strict=True))
    if not shared or _near(common, 1.0, error_of_common) or common <= SIGMAS * error_of_common:
        return None
    if stated is not None:
        return (common, True) if _near(common, stated, error_of_common) else None
    return (common, bool(counts[-1])) if counts.sum() > 1 else None


def _exposed(case: Case, factor: float, verdicts: list[Verdict]) -> Diagnosis:
    said = f"everything is {factor:.5g} times ours"
    if case.film_exposure is not None:
        said += f"; the file says {case.film_exposure:.5g}"
    finding = Finding("film-exposure", "error", "", said, 100.0 * (factor - 1.0))
    causes = ["film-exposure" if v == "differ" else None for v in verdicts]
    return Diagnosis(case.problem.known, verdicts, causes, [finding])


def _without_tiles(case: Case, columns: Floats) -> Estimates | None:
    """Return the factors from tiles where a fit leaves nothing; None if over a quarter is out.

    What a local error does to a fit spreads over the picture, so the worst tile goes first and the
    others are looked at again.
    """
    where = tuple(case.pools.where.T)
    kept = np.ones(kept_tiles(case.cells).shape, bool)
    for _ in range(len(case.pools.where) // 4 + 1):
        cells = spread_out(kept.astype(float), case.cells.ours.shape)
        known = case.problem.factors(columns, np.repeat(cells, 3))
        left = case.left(columns, known)
        if not case.is_structure(case.misfit(left, kept[where])):
            return known
        score = kept[where] * (left.mean(axis=0) ** 2 / case.tile_scale).sum(axis=1)
        row, column = case.pools.where[np.argmax(score)]
        kept[row, column] = False
    return None


_UNEXPLAINED = {
    "extra-light": "has light that none of ours explains",
    "extra-shadow": "lacks light that no light of ours as a whole explains",
    "unexplained": "spreads light in a way that no light of ours explains",
}


def _unexplained(case: Case, columns: Floats, known: Estimates, sound: bool) -> Finding:
    """Return the finding for what no lights explain: local, or everywhere of one sign, or neither.

    What sign it has shows in the difference from our own picture; a fit takes part of it up.
    """
    pools, tiles = case.pools, case.pools.tiles
    difference = case.left(columns, known).mean(axis=0).ravel() if sound else tiles.value
    relative, x, y = pools.worst(difference)
    noise = SIGMAS * tiles.error + SLACK * pools.tiles.scale
    brighter = relative > 0 if sound else (tiles.value > -noise).all()
    darker = sound or (tiles.value < noise).all()
    code = "extra-light" if brighter else "extra-shadow" if darker else "unexplained"
    hint = "" if sound else "; until that is found, the factors of lights mean little"
    where = f"most at pixel ({x}, {y}): {100 * relative:+.2f} %"
    message = f"the witness {_UNEXPLAINED[code]}, {where}{hint}"
    effect = 100.0 * float(difference.sum() / pools.tiles.scale.sum())
    return Finding(code, "error", "", message, effect)


def diagnose(case: Case, verdicts: list[Verdict]) -> Diagnosis:
    """Name the cause for each group of lights that is off in its factor, colour or shape.

    A proven film exposure comes first; then the shapes that leave least unexplained; what is left
    in few tiles is local, and the lights are judged by the others; what is left all over means that
    the lights cannot be judged; a factor without a signature is only held against a light if it
    moves more light than what is left. One that all share is a film exposure after all. `verdicts`
    are those of the groups, from all claims.
    """
    exposure = _exposure(case)
    if exposure is not None and exposure[1]:
        return _exposed(case, exposure[0], verdicts)
    problem, causes, findings = case.problem, _reshape(case, verdicts), list[Finding]()
    columns, leak = _with_shapes(problem.columns, causes), 0.0
    known = problem.factors(columns)
    if case.is_structure(case.misfit(case.left(columns, known))):
        causes = {g: shape for g, shape in causes.items() if shape.code != "colour"}
        columns = _with_shapes(problem.columns, causes)
        trimmed = _without_tiles(case, columns)
        known = trimmed or problem.factors(columns)
        findings.append(_unexplained(case, columns, known, trimmed is not None))
        leak = abs(findings[0].effect_percent or 0.0) / 100.0 if trimmed else math.inf
    again = case.verdicts(known)
    off = {g: _by_factor(case, g, known) for g, v in enumerate(again) if v == "differ"}
    off = {g: found for g, found in off.items() if g not in causes}
    if exposure is not None and not all(certain for certain, _ in off.values()):
        return _exposed(case, exposure[0], verdicts)
    for g, (certain, cause) in off.items():
        again[g] = "undecided"
        if certain or problem.energy[g] * abs(known.value[g] - 1.0) >= leak:
            causes[g] = cause
    for g in causes:
        again[g] = "differ"
    named = [
        Finding(
            cause.code, "error", ", ".join(case.members(g)), cause.message, cause.effect_percent
        )
        for g, cause in sorted(causes.items())
    ]
    codes = [causes[g].code if g in causes else None for g in range(len(again))]
    return Diagnosis(_of_ours(problem, known, columns), again, codes, [*named, *findings])


def _of_ours(problem: Problem, known: Estimates, columns: Floats) -> Estimates:
    """Return the factors of the shapes found as factors of our layers' energies."""
    ours = problem.columns.sum(axis=1)
    ratio = np.divide(columns.sum(axis=1), ours, out=np.ones_like(ours), where=ours != 0)
    theirs, own = known.witness_variance * ratio**2, known.our_variance * ratio**2
    return replace(known, value=known.value * ratio, witness_variance=theirs, our_variance=own)
