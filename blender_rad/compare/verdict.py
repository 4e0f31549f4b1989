# SPDX-License-Identifier: GPL-3.0-or-later
"""`agree`, `differ` or `undecided`: from pictures to a `Comparison`. The tests are in `claims`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import Finding, RadError
from ..film import Film
from .claims import FRAME, TILE_TOLERANCES, TILES, Claims, claims_of, foretell
from .diagnosis import Case, Clues, Diagnosis, diagnose
from .factors import Problem, problem_from_cells
from .metrics import compute_all
from .pools import (
    DARK,
    FLOAT32_ROUNDING,
    Array,
    Cells,
    Mask,
    Picture,
    Pools,
    cell_sums,
    cells_from_seeds,
    frame_means,
    pool,
    split_in_space,
    worst_tile,
)
from .result import (
    AGREE,
    DIFFER,
    EXCLUDED,
    UNDECIDED,
    Comparison,
    LightInfo,
    LightResult,
    PixelCounts,
    Verdict,
)
from .statistics import critical_value

MIN_SUPPORTED = 0.5
SHARED_ERRORS = 10.0  # ratio of variances; blue noise alone keeps it below 1 on average
Layers = Mapping[str, Mapping[str, Picture]]


def judge(
    film: Film,
    seeds: Picture,
    *,
    lights: Sequence[LightInfo],
    tolerance: float = 0.01,
    confidence: float = 0.99,
    round_index: int = 0,
    alternatives: Layers | None = None,
    unit_scale_m: float = 1.0,
    film_exposure: float | None = None,
) -> Comparison:
    """Return the verdict of independent witness renders on our film.

    Parameters
    ----------
    film : ours; its layers by light are what the witness's light is shared out to.
    seeds : (s, h, w, 3) radiance [W/(m² sr)], s ≥ 2, equal samples each.
    lights : rows of the light table, in the order of the result.
    tolerance : relative, of energies and lights; tiles have five times that.
    confidence : false alarms, and false agreements, each at most 1 − confidence over all rounds.
    round_index : how often this comparison has been judged before with fewer samples.
    alternatives : for a light's name, by code of a cause, the (h, w, 3) layer that it would have.
    unit_scale_m : of the file, for the diagnosis.
    film_exposure : of the witness's file if it was not set to 1, for the diagnosis.

    Raises
    ------
    RadError
        For fewer than two seeds, or pictures of another size than ours.
    """
    if len(seeds) < 2:
        raise RadError(f"{len(seeds)} seeds", "judge", "expected at least 2: they show the noise")
    seeds, compared, findings = _support(film, seeds)
    return _judge(_Job(
        film, seeds, compared, findings, cells_from_seeds(film, seeds, compared), lights, tolerance,
        alpha=(1.0 - confidence) / 2.0 ** (round_index + 1), may_agree=True,
        clues=_clues(alternatives, compared, unit_scale_m, film_exposure),
    ))


def judge_pictures(
    film: Film,
    pictures: Picture,
    *,
    lights: Sequence[LightInfo],
    tolerance: float = 0.01,
    confidence: float = 0.99,
    alternatives: Layers | None = None,
    unit_scale_m: float = 1.0,
    film_exposure: float | None = None,
) -> Comparison:
    """Return the verdict of existing pictures (k, h, w, 3) of the same view, k ≥ 1.

    Nothing is known of their seeds. Their noise is estimated from how parts of each tile disagree
    in their mean picture. What all parts share (pixels that sample alike) does not show so: a
    single picture, or copies of one, never agree, and where pictures as a whole disagree with one
    another more than their parts do, their spread is the noise, as with seeds.
    """
    if len(pictures) < 1:
        raise RadError("no picture", "judge_pictures", "expected at least one")
    pictures, compared, findings = _support(film, pictures)
    whole = cells_from_seeds(film, pictures, compared)
    parts = split_in_space(whole)
    copies = all(np.array_equal(pictures[0], other) for other in pictures[1:])
    cells = parts if copies or not _share_errors(whole, parts) else whole
    return _judge(_Job(
        film, pictures, compared, findings, cells, lights, tolerance,
        alpha=1.0 - confidence, may_agree=not copies,
        clues=_clues(alternatives, compared, unit_scale_m, film_exposure),
    ))


@dataclass(frozen=True)
class _Job:
    """A comparison to be made; `alpha` is that of this round."""

    film: Film
    pictures: Picture
    compared: Mask
    findings: list[Finding]
    cells: Cells
    lights: Sequence[LightInfo]
    tolerance: float
    alpha: float
    may_agree: bool
    clues: Clues

    def has(self, code: str) -> bool:
        return any(finding.code == code for finding in self.findings)

    @property
    def infos(self) -> dict[str, LightInfo]:
        """The rows of the table, with one for each layer that the caller did not list."""
        given = {info.name: info for info in self.lights}
        return {**{name: LightInfo(name, "") for name in self.cells.names}, **given}


def _share_errors(whole: Cells, parts: Cells) -> bool:
    """Return whether the frame's mean varies more over pictures than their parts let expect."""
    over_pictures, over_parts = (
        np.var(frame_means(cells), axis=0, ddof=1) / len(cells.witness) for cells in (whole, parts)
    )
    return bool((over_pictures > SHARED_ERRORS * over_parts).any())


def _clues(
    alternatives: Layers | None, compared: Mask, unit_scale_m: float, film_exposure: float | None
) -> Clues:
    flat = {
        light: {code: cell_sums(layer, compared).ravel() for code, layer in layers.items()}
        for light, layers in (alternatives or {}).items()
    }
    return Clues(flat, unit_scale_m, film_exposure)


def _support(film: Film, seeds: Picture) -> tuple[Picture, Mask, list[Finding]]:
    """Return the pictures, finite throughout, which pixels can be compared, and findings."""
    if seeds.shape[1:] != film.radiance.shape:
        expected = f"expected ours, {film.radiance.shape}"
        raise RadError(f"pictures of shape {seeds.shape[1:]}", "witness", expected)
    finite = np.isfinite(seeds).all(axis=(0, 3)) & np.isfinite(film.radiance).all(axis=2)
    compared = film.inside & ~film.excluded & finite
    lit = film.inside & ((film.radiance != 0).any(axis=2) | (seeds != 0).any(axis=(0, 3)))
    findings: list[Finding] = []
    broken = int((film.inside & ~finite).sum())
    if broken:
        seeds = np.where(finite[..., None], seeds, 0.0)
        findings.append(Finding(
            "not-finite", "warning", "", f"{broken} pixels are not finite and are left out"
        ))
    if not (lit & compared).any():
        findings.append(Finding("nothing-compared", "warning", "", "no lit pixel can be compared"))
    elif (fraction := (lit & compared).sum() / lit.sum()) < MIN_SUPPORTED:
        findings.append(Finding(
            "coverage-low", "warning", "",
            f"only {100 * fraction:.1f} % of the lit pixels can be compared, 50 % are needed",
        ))
    return seeds, compared, findings


def _judge(job: _Job) -> Comparison:
    mean = job.pictures.mean(axis=0, dtype=float)
    metrics = compute_all(job.film.radiance[job.compared], mean[job.compared])
    if job.has("nothing-compared"):
        classes = np.where(job.compared, UNDECIDED, EXCLUDED).astype(np.uint8)
        rows = tuple(_row(info) for info in job.infos.values())
        counts, findings = _count(classes, job), tuple(job.findings)
        return Comparison("undecided", counts, metrics, rows, findings, None, 0.0, classes)
    pools = pool(job.cells)
    problem = problem_from_cells(job.cells, pools)
    claims = claims_of(pools, problem, job.tolerance)
    outside, within = claims.outside(job.alpha), claims.within(job.alpha) & job.may_agree
    verdict = _verdict(claims, outside, within)
    if job.has("coverage-low"):
        verdict = "undecided"
    verdicts = _verdicts_of_groups(len(problem.groups), claims, outside, within)
    explained = Diagnosis(problem.known, verdicts, [None] * len(verdicts), [])
    if verdict == "differ":
        explained = _explain(job, pools, problem, verdicts)
        job.findings.extend(explained.findings)
        job.findings.extend(_tile_findings(pools, outside[claims.group == TILES]))
    classes = _classify(job, mean, pools)
    comparison = Comparison(
        verdict,
        _count(classes, job),
        metrics,
        _light_results(job, problem, explained),
        tuple(job.findings),
        None,
        0.0,
        classes,
    )
    if verdict != "undecided" or not job.may_agree or job.has("coverage-low"):
        return comparison
    ahead = foretell(claims, job.alpha)
    return replace(
        comparison,
        needed_factor=ahead.factor,
        our_noise_share=ahead.our_share,
        least_factor=ahead.least,
        held_up_by=_subject(job.cells, problem, ahead.group),
        held_up_error=ahead.error,
    )


def _subject(cells: Cells, problem: Problem, group: int) -> str:
    if group in (FRAME, TILES):
        return "the whole picture" if group == FRAME else "a tile"
    return " + ".join(cells.names[j] for j in problem.groups[group])


def _verdict(claims: Claims, outside: Mask, within: Mask) -> Verdict:
    if outside.any():
        return "differ"
    return "agree" if within[claims.required].all() else "undecided"


def _verdicts_of_groups(
    count: int, claims: Claims, outside: Mask, within: Mask
) -> list[Verdict]:
    verdicts: list[Verdict] = ["undecided"] * count
    for g in np.unique(claims.group[claims.group >= 0]):
        mine = claims.group == g
        about = replace(claims, required=claims.required & mine)
        verdicts[g] = _verdict(about, outside & mine, within)
    return verdicts


def _explain(job: _Job, pools: Pools, problem: Problem, verdicts: list[Verdict]) -> Diagnosis:
    types = {name: info.type for name, info in job.infos.items()}
    explained = diagnose(
        Case(problem, job.cells, pools, types, verdicts, job.clues, job.tolerance, job.alpha)
    )
    if job.may_agree:
        return explained
    spoken = [v if v == "differ" else "undecided" for v in explained.verdicts]
    return replace(explained, verdicts=spoken)


def _row(info: LightInfo) -> LightResult:
    nan = math.nan
    return LightResult(info.name, info.type, info.count, None, 0.0, nan, nan, "undecided")


def _light_results(
    job: _Job, problem: Problem, explained: Diagnosis
) -> tuple[LightResult, ...]:
    names = job.cells.names
    energies = np.abs(job.cells.layers.sum(axis=(1, 2, 3)))
    fractions = energies / energies.sum() if energies.sum() > 0 else energies
    results = {name: _row(info) for name, info in job.infos.items()}
    for g, members in enumerate(problem.groups):
        group = " + ".join(names[j] for j in members) if len(members) > 1 else None
        for j in members:
            name, lit = names[j], bool(energies[j] > 0)
            results[name] = replace(
                results[name],
                group=group,
                energy_fraction=float(fractions[j]),
                scale_in_witness=float(explained.factors.value[g]) if lit else math.nan,
                standard_error=float(explained.factors.error[g]) if lit else math.nan,
                verdict=explained.verdicts[g],
                diagnosis=explained.causes[g],
            )
    return tuple(results.values())


def _tile_findings(pools: Pools, off: Mask) -> list[Finding]:
    if not off.any():
        return []
    relative, x, y = worst_tile(pools, pools.tiles.value * off)
    count = len(np.unique(np.flatnonzero(off) // 3))
    message = (f"{count} of {len(pools.where)} tiles differ; the worst, at pixel ({x}, {y}) from "
               f"the upper left, by {100 * relative:+.2f} %")
    return [Finding("tiles-differ", "error", "", message, 100.0 * relative)]


def _classify(job: _Job, mean: Array, pools: Pools) -> NDArray[np.uint8]:
    """Return the class of each pixel, (h, w), by its own t-interval; for display only.

    A single picture has no spread; its pixels stay undecided.
    """
    classes = np.where(job.compared, UNDECIDED, EXCLUDED).astype(np.uint8)
    ours, count = job.film.radiance, len(job.pictures)
    if count < 2:
        return classes
    squares = sum(((picture - mean) ** 2 for picture in job.pictures), np.zeros_like(mean))
    scale = np.maximum(np.abs(ours), DARK * pools.frame_scale)
    floor = (FLOAT32_ROUNDING * scale) ** 2
    error = np.sqrt(np.maximum(squares / (count * (count - 1)), floor) + job.film.variance)
    reach = critical_value(job.alpha, count - 1.0) * error
    size, tolerance = np.abs(mean - ours), TILE_TOLERANCES * job.tolerance * scale
    classes[job.compared & (size + reach <= tolerance).all(axis=2)] = AGREE
    classes[job.compared & (size - reach > tolerance).any(axis=2)] = DIFFER
    return classes


def _count(classes: NDArray[np.uint8], job: _Job) -> PixelCounts:
    agree, differ, undecided = (int((classes == k).sum()) for k in (AGREE, DIFFER, UNDECIDED))
    excluded = int((job.film.inside & ~job.compared).sum())
    return PixelCounts(int(job.compared.sum()), agree, differ, undecided, excluded)
