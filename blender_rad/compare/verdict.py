# SPDX-License-Identifier: GPL-3.0-or-later
"""`agree`, `differ` or `undecided`: from pictures to a `Comparison`. The tests are in `claims`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..arrays import Bools, Floats
from ..errors import Finding, RadError
from ..film import REST, Film
from .claims import FRAME, TILE_TOLERANCES, TILES, claims_of, foretell
from .diagnosis import Case, Diagnosis, diagnose
from .metrics import compute_all
from .pools import (
    DARK,
    FLOAT32_ROUNDING,
    MAX_DF,
    Cells,
    Picture,
    Pools,
    cell_sums,
    cells_from_seeds,
    frame_means,
    split_in_space,
)
from .result import MIN_SUPPORTED, Comparison, LightInfo, LightResult, PixelCounts
from .statistics import critical_value

MANY_TIMES = 1e3  # ours: no number is worth saying
SHARED_ERRORS = 10.0  # ratio of variances; blue noise alone keeps it below 1 on average
REGROUPED = 1.0 / 8.0  # (1 − 2⁻⁴)(1 + 1/16) < 1, half of a level being that of lights
Layers = Mapping[str, Mapping[str, Picture]]


def judge(
    film: Film,
    pictures: Picture,
    *,
    lights: Sequence[LightInfo],
    tolerance: float = 0.01,
    confidence: float = 0.99,
    round_index: int = 0,
    independent: bool = True,
    budget: float = math.inf,
    alternatives: Layers | None = None,
    unit_scale_m: float = 1.0,
    film_exposure: float | None = None,
) -> Comparison:
    """Return the verdict of a witness's pictures on our film.

    Parameters
    ----------
    film : ours; its layers by light are what the witness's light is shared out to.
    pictures : (s, h, w, 3) radiance [W/(m² sr)], s ≥ 2 seeds of equal samples each; or s ≥ 1
        pictures of which nothing is known, where they are not `independent`. The noise of these
        is estimated from how parts of each tile disagree in their mean. What all parts share
        (pixels that sample alike) does not show so: a single picture, or copies of one, never
        agree, and where pictures as a whole disagree with one another more than their parts do,
        their spread is the noise, as with seeds.
    lights : rows of the light table, in the order of the result.
    tolerance : relative, of energies and lights; tiles have five times that.
    confidence : false alarms, and false agreements, each at most 1 − confidence over all rounds.
    round_index : how often this comparison has been judged before with fewer samples.
    budget : how many times the samples there could be. Lights whose factors even these would not
        tell are judged as groups, if nothing differs before: of `REGROUPED` times the level, so
        that false alarms over four rounds stay what they are.
    alternatives : for a light's name, by code of a cause, the (h, w, 3) layer that it would have.
    unit_scale_m : of the file, for the diagnosis.
    film_exposure : of the witness's file if it was not set to 1, for the diagnosis.

    RadError is for too few pictures, or pictures of another size than ours.
    """
    least = 2 if independent else 1
    if len(pictures) < least:
        expected = f"expected at least {least}: they show the noise"
        raise RadError(f"{len(pictures)} pictures", "witness", expected)
    pictures, compared, findings = _support(film, pictures)
    cells, copies = cells_from_seeds(film, pictures, compared), False
    if not independent:
        parts = split_in_space(cells)
        copies = all(np.array_equal(pictures[0], other) for other in pictures[1:])
        cells = parts if copies or not _share_errors(cells, parts) else cells
    infos = {**{name: LightInfo(name, "") for name in film.lights}, **{i.name: i for i in lights}}
    alpha = (1.0 - confidence) / (2.0 ** (round_index + 1) if independent else 1.0)
    types = {name: info.type for name, info in infos.items()}
    others = {
        light: {code: cell_sums(layer, compared).ravel() for code, layer in layers.items()}
        for light, layers in (alternatives or {}).items()
    }
    agree_alpha = 0.0 if copies else alpha
    case = Case(cells, types, tolerance, alpha, agree_alpha, others, unit_scale_m, film_exposure)
    # An error of τ/(t + 1) leaves a difference of one error within the tolerance τ.
    bearable = tolerance * math.sqrt(budget) / (critical_value(alpha / 2.0, MAX_DF) + 1.0)
    return _judge(_Job(film, pictures, compared, findings, infos, case, bearable))


judge_pictures = partial(judge, independent=False)


@dataclass(frozen=True)
class _Job:
    """A comparison to be made; `findings` grow while it is. `bearable` : for a second look."""

    film: Film
    pictures: Picture
    compared: Bools
    findings: list[Finding]
    infos: Mapping[str, LightInfo]
    case: Case
    bearable: float = math.inf

    def has(self, code: str) -> bool:
        return any(finding.code == code for finding in self.findings)


def _share_errors(whole: Cells, parts: Cells) -> bool:
    """Return whether the frame's mean varies more over pictures than their parts let expect."""
    over_pictures, over_parts = (
        np.var(frame_means(cells), axis=0, ddof=1) / len(cells.witness) for cells in (whole, parts)
    )
    return bool((over_pictures > SHARED_ERRORS * over_parts).any())


def _support(film: Film, seeds: Picture) -> tuple[Picture, Bools, list[Finding]]:
    """Return the pictures, finite throughout, which pixels can be compared, and findings."""
    if seeds.shape[1:] != film.radiance.shape:
        expected = f"expected ours, {film.radiance.shape}"
        raise RadError(f"pictures of shape {seeds.shape[1:]}", "witness", expected)
    finite = np.isfinite(seeds).all(axis=(0, 3)) & np.isfinite(film.radiance).all(axis=2)
    compared = film.inside & ~film.excluded & finite
    lit = film.inside & ((film.radiance != 0).any(axis=2) | (seeds != 0).any(axis=(0, 3)))
    said: dict[str, str] = {}
    if broken := int((film.inside & ~finite).sum()):
        seeds = np.where(finite[..., None], seeds, 0.0)
        said["not-finite"] = f"{broken} pixels are not finite and are left out"
    if not (lit & compared).any():
        said["nothing-compared"] = "no lit pixel can be compared"
    elif (fraction := (lit & compared).sum() / lit.sum()) < MIN_SUPPORTED:
        supported = f"only {100 * fraction:.1f} % of the lit pixels can be compared"
        said["coverage-low"] = f"{supported}, 50 % are needed"
    return seeds, compared, [Finding(code, "warning", "", text) for code, text in said.items()]


def _judge(job: _Job) -> Comparison:
    mean = job.pictures.mean(axis=0, dtype=float)
    metrics = compute_all(job.film.radiance[job.compared], mean[job.compared])
    if job.has("nothing-compared"):
        rows = tuple(_rows(job.infos).values())
        return Comparison("undecided", _pixels(job, mean), metrics, rows, tuple(job.findings))
    case, problem = job.case, job.case.problem
    claims = claims_of(case.pools, problem, case.tolerance)
    outside, within = claims.outside(case.alpha), claims.within(case.agree_alpha)
    verdict = "undecided" if job.has("coverage-low") else claims.verdict(outside, within)
    undecided = verdict == "undecided" and not job.has("coverage-low")
    if undecided and job.bearable < case.bearable:
        joined = replace(case, bearable=job.bearable, alpha=REGROUPED * case.alpha)
        if len(joined.problem.groups) < len(problem.groups):
            return _judge(replace(job, case=joined))
    verdicts = claims.verdicts(len(problem.groups), outside, within)
    explained = Diagnosis(problem.known, verdicts, [None] * len(verdicts), [])
    if verdict == "differ":
        explained = diagnose(case, verdicts)
        job.findings.extend(explained.findings)
        job.findings.extend(_tile_findings(case.pools, outside[claims.group == TILES]))
    rows = _light_results(job, explained)
    comparison = Comparison(verdict, _pixels(job, mean), metrics, rows, tuple(job.findings))
    if not undecided or not case.agree_alpha:
        return comparison
    group, ahead = foretell(claims, case.agree_alpha)
    return replace(comparison, held_up_by=_subject(case, group), **ahead)


def _subject(case: Case, group: int) -> str:
    if group in (FRAME, TILES):
        return "the whole picture" if group == FRAME else "a tile"
    return " + ".join(case.members(group))


def _rows(infos: Mapping[str, LightInfo]) -> dict[str, LightResult]:
    return {name: LightResult(**vars(info)) for name, info in infos.items()}


def _light_results(job: _Job, explained: Diagnosis) -> tuple[LightResult, ...]:
    names, problem, factors = job.case.cells.names, job.case.problem, explained.factors
    energies = np.abs(job.case.cells.layers.sum(axis=(1, 2, 3)))
    fractions = energies / (energies.sum() or 1.0)
    results = _rows(job.infos)
    for g, members in enumerate(problem.groups):
        for j in members:
            lit = energies[j] > 0
            results[names[j]] = replace(
                results[names[j]],
                group=_subject(job.case, g) if len(members) > 1 else None,
                energy_fraction=float(fractions[j]),
                scale_in_witness=float(factors.value[g]) if lit else math.nan,
                standard_error=float(factors.error[g]) if lit else math.nan,
                verdict=explained.verdicts[g],
                diagnosis=explained.causes[g],
            )
    if REST in names:
        said = replace(results[REST], group=REST, energy_fraction=0.0)
        for name in results.keys() - set(names):
            results[name] = replace(said, **vars(job.infos[name]))
    return tuple(results.values())


def _tile_findings(pools: Pools, off: Bools) -> list[Finding]:
    if not off.any():
        return []
    relative, x, y = pools.worst(pools.tiles.value * off)
    count = len(np.unique(np.flatnonzero(off) // 3))
    message = f"{count} of {len(pools.where)} tiles differ; the worst, at pixel ({x}, {y}) from "
    if abs(relative) > MANY_TIMES:
        message += "the upper left, where ours is black"
        return [Finding("tiles-differ", "error", "", message)]
    message += f"the upper left, by {100 * relative:+.2f} %"
    return [Finding("tiles-differ", "error", "", message, 100.0 * relative)]


def _pixels(job: _Job, mean: Floats) -> PixelCounts:
    """Return how many pixels agree and differ, each by its own t-interval; for display only.

    A single picture has no spread; its pixels stay undecided.
    """
    ours, count, known = job.film.radiance, len(job.pictures), (0, 0)
    if count > 1 and not job.has("nothing-compared"):
        squares = sum(((picture - mean) ** 2 for picture in job.pictures), np.zeros_like(mean))
        scale = np.maximum(np.abs(ours), DARK * job.case.pools.frame.scale)
        floor = (FLOAT32_ROUNDING * scale) ** 2
        error = np.sqrt(np.maximum(squares / (count * (count - 1)), floor) + job.film.variance)
        reach = critical_value(job.case.alpha, count - 1.0) * error
        size, tolerance = np.abs(mean - ours), TILE_TOLERANCES * job.case.tolerance * scale
        agree = (size + reach <= tolerance).all(axis=2)
        differ = (size - reach > tolerance).any(axis=2)
        known = int((job.compared & agree).sum()), int((job.compared & differ).sum())
    compared = int(job.compared.sum())
    excluded = int((job.film.inside & ~job.compared).sum())
    return PixelCounts(compared, *known, compared - sum(known), excluded)
