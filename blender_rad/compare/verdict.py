# SPDX-License-Identifier: GPL-3.0-or-later
"""`agree`, `differ` or `undecided`: the tests, their corrections, and what more samples would do.

What is tested, all as mean differences (witness less ours) against a tolerance τ:

- the frame: each channel of the total energy, within τ;
- lights: the factor of each light or group with at least 1 % of our energy, within τ of 1, from the
  three channels together;
- light colours: the same from each channel that holds 1 % by itself; only to find them outside;
- tiles of 16×16 pixels: each channel, within 5 τ of the larger of the tile's mean and 5 % of the
  picture's. Tiles of fewer than `MIN_TILE_PIXELS` compared pixels are left to the frame.

Channels stand by themselves, so that no colour error hides in the luminance; if each channel is
within τ then so is any weighted mean of them.

Corrections. `differ` says that at least one difference is real: Holm, over all tests together, at
level α. Half of α goes to the lights, a sixth each to the frame, the colours and the tiles (Holm's
own weights), so that a light need not pay for thousands of tiles. `agree` says that all differences
are within τ: each is tested by two one-sided tests at level α, and all must pass. If any single
one were outside, its own test would have to err for `agree` to come out, which happens with at most
α; so the joint statement needs no correction (intersection and union, Berger 1982), and with one it
would only ask for noise that no one needs. Both errors are therefore at most α.

Rounds. Looking again after more samples is another chance to err: round i = 0, 1, … has
α_i = (1 − confidence) / 2^(i+1), whose sum never passes 1 − confidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import Finding, RadError
from ..film import Film
from .diagnosis import Clues, Diagnosis, diagnose
from .factors import Problem, problem_from_cells
from .metrics import compute_all
from .pools import (
    FLOAT32_ROUNDING,
    TILE,
    Array,
    Cells,
    Estimates,
    Mask,
    Pools,
    cell_sums,
    cells_from_seeds,
    pool,
    split_in_space,
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
from .statistics import holm, p_equivalent, p_outside, t_quantile

TILE_TOLERANCES = 5.0
DARK = 0.05
MIN_ENERGY = 0.01
LIGHTS_LEVEL, LEVEL = 1.0 / 2.0, 1.0 / 6.0
MIN_SUPPORTED = 0.5
MIN_TILE_PIXELS = 16
SAFETY = 1.3  # on the samples foretold: the noise itself is only estimated
Layers = Mapping[str, Mapping[str, NDArray[np.floating]]]


@dataclass(frozen=True)
class Claims:
    """Differences with tolerances; each either within, outside, or not known yet.

    Attributes
    ----------
    delta, error, our_share, df, tolerance : (n,).
    weight : (n,) for Holm.
    required : (n,) whether `agree` needs it.
    """

    delta: Array
    error: Array
    our_share: Array
    df: Array
    tolerance: Array
    weight: Array
    required: NDArray[np.bool_]


def _family(
    known: Estimates, truth: float, tolerance: Array, level: float, required: bool = True
) -> Claims:
    """Return the claims that each of `known` is `truth`; they share `level` of α equally."""
    count = len(known.value)
    return Claims(
        known.value - truth,
        known.error,
        known.our_variance / known.error**2,
        known.df,
        tolerance,
        np.full(count, level / max(count, 1)),
        np.full(count, required),
    )


def _join(families: Sequence[Claims]) -> Claims:
    return Claims(*(
        np.concatenate([getattr(family, name) for family in families])
        for name in Claims.__dataclass_fields__
    ))


def _light_claims(problem: Problem, tolerance: float) -> tuple[list[Claims], NDArray[np.int64]]:
    """Return the claims about the lights, and the group that each is about."""
    groups = np.flatnonzero(problem.energy >= MIN_ENERGY)
    same = np.full(len(groups), tolerance)
    claims, owners = [_family(problem.factors().at(groups), 1.0, same, LIGHTS_LEVEL)], [groups]
    for c, energy in enumerate(problem.channel_energy().T):
        lit = groups[energy[groups] >= MIN_ENERGY]
        known = problem.channel_factors(c).at(lit)
        claims.append(_family(known, 1.0, same[: len(lit)], LEVEL / 3.0, required=False))
        owners.append(lit)
    return claims, np.concatenate(owners)


def judge(
    film: Film,
    seeds: NDArray[np.floating],
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
        raise RadError(f"{len(seeds)} seeds", "judge", "expected at least 2: their spread is the noise")
    compared, findings = _support(film, seeds)
    return _judge(
        film, seeds, compared, findings, cells_from_seeds(film, seeds, compared),
        _Settings(tuple(lights), tolerance, confidence, round_index, may_agree=True),
        _clues(alternatives, compared, unit_scale_m, film_exposure),
    )


def judge_pictures(
    film: Film,
    pictures: NDArray[np.floating],
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
    in their mean picture. What all cells share (a common seed's error on the whole frame) does not
    show that way, so a single picture, or copies of one, never agree.
    """
    if len(pictures) < 1:
        raise RadError("no picture", "judge_pictures", "expected at least one")
    compared, findings = _support(film, pictures)
    cells = split_in_space(cells_from_seeds(film, pictures, compared))
    copies = all(np.array_equal(pictures[0], other, equal_nan=True) for other in pictures[1:])
    return _judge(
        film, pictures, compared, findings, cells,
        _Settings(tuple(lights), tolerance, confidence, 0, may_agree=not copies),
        _clues(alternatives, compared, unit_scale_m, film_exposure),
    )


@dataclass(frozen=True)
class _Settings:
    lights: tuple[LightInfo, ...]
    tolerance: float
    confidence: float
    round_index: int
    may_agree: bool

    @property
    def alpha(self) -> float:
        return (1.0 - self.confidence) / 2.0 ** (self.round_index + 1)


def _clues(
    alternatives: Layers | None, compared: Mask, unit_scale_m: float, film_exposure: float | None
) -> Clues:
    flat = {
        light: {code: cell_sums(layer, compared).ravel() for code, layer in layers.items()}
        for light, layers in (alternatives or {}).items()
    }
    return Clues(flat, unit_scale_m, film_exposure)


def _support(film: Film, seeds: NDArray[np.floating]) -> tuple[Mask, list[Finding]]:
    """Return which pixels can be compared, (h, w), and findings if they are too few."""
    if seeds.shape[1:] != film.radiance.shape:
        raise RadError(
            f"pictures of shape {seeds.shape[1:]}", "witness", f"expected ours, {film.radiance.shape}"
        )
    finite = np.isfinite(seeds).all(axis=(0, 3)) & np.isfinite(film.radiance).all(axis=2)
    compared = film.inside & ~film.excluded & finite
    lit = film.inside & ((film.radiance != 0).any(axis=2) | (seeds != 0).any(axis=(0, 3)))
    findings: list[Finding] = []
    broken = int((film.inside & ~finite).sum())
    if broken:
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
    return compared, findings


def _judge(
    film: Film,
    pictures: NDArray[np.floating],
    compared: Mask,
    findings: list[Finding],
    cells: Cells,
    settings: _Settings,
    clues: Clues,
) -> Comparison:
    mean = pictures.mean(axis=0, dtype=float)
    metrics = compute_all(film.radiance[compared], mean[compared])
    if any(f.code == "nothing-compared" for f in findings):
        return _nothing(film, compared, metrics, findings, settings)
    pools = pool(cells, cells.residual(cells.ours), dark=DARK, min_pixels=MIN_TILE_PIXELS)
    problem = problem_from_cells(cells, pools)
    tau = settings.tolerance
    frame = _family(pools.frame, 0.0, tau * pools.frame_scale, LEVEL)
    tiles = _family(pools.tiles, 0.0, TILE_TOLERANCES * tau * pools.tile_scale, LEVEL)
    about_lights, owner = _light_claims(problem, tau)
    claims = _join([frame, *about_lights, tiles])
    p_out = p_outside(claims.delta, claims.error, claims.df, claims.tolerance)
    outside = holm(p_out, settings.alpha, claims.weight)
    within = p_equivalent(claims.delta, claims.error, claims.df, claims.tolerance) <= settings.alpha
    enough = not any(f.code == "coverage-low" for f in findings)
    agree = settings.may_agree and bool(within[claims.required].all())
    verdict: Verdict = "differ" if outside.any() else "agree" if agree else "undecided"
    if not enough:
        verdict = "undecided"
    of_lights = slice(len(frame.delta), len(frame.delta) + len(owner))
    group_verdicts = _group_verdicts(
        len(problem.groups), owner, outside[of_lights],
        within[of_lights] & settings.may_agree, claims.required[of_lights],
    )
    infos = {info.name: info for info in settings.lights}
    infos = {name: infos.get(name, LightInfo(name, "")) for name in (*infos, *cells.names)}
    diagnosis = None
    if verdict == "differ":
        flat = cells.layers.reshape(len(cells.names), -1)
        diagnosis = diagnose(problem, cells.names, flat, infos, group_verdicts, clues)
        off = outside[of_lights.stop:]
        findings = [*findings, *diagnosis.findings,
                    *_tile_findings(pools, off), *_unexplained(cells, problem, diagnosis, settings)]
    classes = _classify(film, mean, pictures, compared, pools, settings)
    factor, share = None, 0.0
    if verdict == "undecided" and settings.may_agree and enough:
        factor, share = _foretell(claims, claims.required & ~within, settings)
    return Comparison(
        verdict, _count(classes, film, compared), metrics,
        _light_results(infos, cells, problem, group_verdicts, diagnosis), tuple(findings),
        factor, share, classes,
    )


def _nothing(
    film: Film, compared: Mask, metrics: dict[str, float], findings: list[Finding],
    settings: _Settings,
) -> Comparison:
    nan = float("nan")
    lights = tuple(
        LightResult(info.name, info.type, info.count, None, 0.0, nan, nan, "undecided")
        for info in settings.lights
    )
    classes = np.where(compared, UNDECIDED, EXCLUDED).astype(np.uint8)
    return Comparison(
        "undecided", _count(classes, film, compared), metrics, lights, tuple(findings),
        None, 0.0, classes,
    )


def _group_verdicts(
    count: int, owner: NDArray[np.int64], outside: Mask, within: Mask, required: Mask
) -> list[Verdict]:
    verdicts: list[Verdict] = ["undecided"] * count
    for g in np.unique(owner):
        mine = owner == g
        if outside[mine].any():
            verdicts[g] = "differ"
        elif within[mine & required].all():
            verdicts[g] = "agree"
    return verdicts


def _light_results(
    infos: Mapping[str, LightInfo], cells: Cells, problem: Problem, verdicts: list[Verdict],
    diagnosis: Diagnosis | None,
) -> tuple[LightResult, ...]:
    factors = problem.factors()
    energies = np.abs(cells.layers.sum(axis=(1, 2, 3)))
    fractions = energies / energies.sum() if energies.sum() > 0 else energies
    nan = float("nan")
    results = {
        name: LightResult(name, info.type, info.count, None, 0.0, nan, nan, "undecided")
        for name, info in infos.items()
    }
    for g, members in enumerate(problem.groups):
        group = " + ".join(cells.names[j] for j in members) if len(members) > 1 else None
        for j in members:
            name = cells.names[j]
            lit = bool(energies[j] > 0)
            results[name] = replace(
                results[name],
                group=group,
                energy_fraction=float(fractions[j]),
                scale_in_witness=float(factors.value[g]) if lit else nan,
                standard_error=float(factors.error[g]) if lit else nan,
                verdict=verdicts[g],
                diagnosis=diagnosis.causes[g] if diagnosis else None,
            )
    return tuple(results.values())


def _worst_tile(pools: Pools, off: Mask) -> tuple[float, int, int]:
    """Return the relative difference of the worst tile of `off`, and its first pixel (x, y)."""
    relative = np.where(off, np.abs(pools.tiles.value) / np.maximum(pools.tile_scale, 1e-300), -1.0)
    worst = int(np.argmax(relative))
    row, column = pools.where[worst // 3] * TILE
    sign = np.sign(pools.tiles.value[worst])
    return float(sign * relative[worst]), int(column), int(row)


def _tile_findings(pools: Pools, off: Mask) -> list[Finding]:
    if not off.any():
        return []
    relative, x, y = _worst_tile(pools, off)
    count = len(np.unique(np.flatnonzero(off) // 3))
    message = (f"{count} of {len(pools.where)} tiles differ; the worst, at pixel ({x}, {y}) from "
               f"the upper left, by {100 * relative:+.2f} %")
    return [Finding("tiles-differ", "error", "", message, 100.0 * relative)]


def _unexplained(
    cells: Cells, problem: Problem, diagnosis: Diagnosis, settings: _Settings
) -> list[Finding]:
    """Return a finding where the witness has light, or lacks it, that no factors account for."""
    best = problem.factors(diagnosis.columns).value @ diagnosis.columns
    if "film-exposure" in {finding.code for finding in diagnosis.findings}:
        return []
    left = cells.residual(cells.seen + best.reshape(cells.seen.shape))
    pools = pool(cells, left, dark=DARK, min_pixels=MIN_TILE_PIXELS)
    tolerance = TILE_TOLERANCES * settings.tolerance * pools.tile_scale
    p = p_outside(pools.tiles.value, pools.tiles.error, pools.tiles.df, tolerance)
    off = holm(p, settings.alpha)
    if not off.any():
        return []
    relative, x, y = _worst_tile(pools, off)
    effect = 100.0 * float(pools.frame.value.sum() / pools.frame_scale.sum())
    code, what = (("extra-light", "has light that none of ours explains") if relative > 0
                  else ("extra-shadow", "lacks light that no light of ours as a whole explains"))
    return [Finding(
        code, "error", "", f"the witness {what}, most at pixel ({x}, {y}): {100 * relative:+.2f} %",
        effect,
    )]


def _classify(
    film: Film, mean: Array, pictures: NDArray[np.floating], compared: Mask, pools: Pools,
    settings: _Settings,
) -> NDArray[np.uint8]:
    """Return the class of each pixel, (h, w), by its own t-interval; for display only.

    A single picture has no spread; its pixels stay undecided.
    """
    classes = np.where(compared, UNDECIDED, EXCLUDED).astype(np.uint8)
    count = len(pictures)
    if count < 2:
        return classes
    variance = sum((picture - mean) ** 2 for picture in pictures) / (count * (count - 1.0))
    scale = np.maximum(np.abs(film.radiance), DARK * pools.frame_scale)
    error = np.sqrt(np.maximum(variance, (FLOAT32_ROUNDING * scale) ** 2) + film.variance)
    reach = float(t_quantile(1.0 - settings.confidence, count - 1.0)) * error
    size, tolerance = np.abs(mean - film.radiance), TILE_TOLERANCES * settings.tolerance * scale
    classes[compared & (size + reach <= tolerance).all(axis=2)] = AGREE
    classes[compared & (size - reach > tolerance).any(axis=2)] = DIFFER
    return classes


def _count(classes: NDArray[np.uint8], film: Film, compared: Mask) -> PixelCounts:
    return PixelCounts(
        int(compared.sum()),
        *(int((classes == kind).sum()) for kind in (AGREE, DIFFER, UNDECIDED)),
        int((film.inside & ~compared).sum()),
    )


def _foretell(claims: Claims, open_: Mask, settings: _Settings) -> tuple[float, float]:
    """Return how many times the samples would decide the next round, and our share of the noise.

    Noise falls as 1/√n: a claim needs (t σ / gap)², where the gap is the distance from its
    difference to the tolerance. A difference that is itself noise says nothing about the gap, which
    is then the tolerance; and no round asks for more than the noise of its own gap justifies. One
    claim that looks clearly outside will do; otherwise all open ones must come in.
    """
    alpha = 0.5 * settings.alpha
    size, df = np.abs(claims.delta), float(claims.df[open_].min())
    gap = np.maximum(np.abs(size - claims.tolerance), np.minimum(claims.tolerance, claims.error))
    t = float(t_quantile(alpha, df))
    needed = SAFETY * (t * claims.error / gap) ** 2
    clear = size - claims.tolerance > 2.0 * claims.error
    if clear.any():
        t_differ = t_quantile(alpha * claims.weight[clear], claims.df[clear])
        needed[clear] *= (t_differ / t) ** 2
        chosen = np.flatnonzero(clear)[np.argmin(needed[clear])]
    else:
        chosen = np.flatnonzero(open_)[np.argmax(needed[open_])]
    return max(float(needed[chosen]), 1.25), float(claims.our_share[chosen])
