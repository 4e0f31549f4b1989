# SPDX-License-Identifier: GPL-3.0-or-later
"""What `agree` and `differ` claim, how it is tested, and how many samples would settle it.

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

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np

from ..arrays import Bools, Floats, Ints
from .factors import Problem
from .pools import MAX_DF, Estimates, Pools
from .result import MIN_ENERGY, Verdict
from .statistics import critical_value, holm, p_equivalent, p_outside, t_quantile

TILE_TOLERANCES = 5.0
LIGHTS_LEVEL, LEVEL = 1.0 / 2.0, 1.0 / 6.0
HINT = 0.05  # chance that noise alone makes any claim look clearly outside
SAFETY = 1.3  # on the samples foretold: the noise itself is only estimated
FRAME, TILES = -1, -2


@dataclass(frozen=True)
class Claims(Estimates):
    """Differences with tolerances; each either within, outside, or not known yet; all (n,)."""

    tolerance: Floats
    weight: Floats  # for Holm
    required: Bools  # whether `agree` needs it
    group: Ints  # of lights that it is about, `FRAME` or `TILES`

    def p_outside(self) -> Floats:
        return p_outside(self.value, self.error, self.df, self.tolerance)

    def outside(self, alpha: float) -> Bools:
        """Return which differences are significantly beyond their tolerance, by Holm, (n,)."""
        return holm(self.p_outside(), alpha, self.weight)

    def within(self, alpha: float) -> Bools:
        """Return which differences are shown to be within their tolerance, (n,); none for 0."""
        return p_equivalent(self.value, self.error, self.df, self.tolerance) < alpha

    def verdict(self, outside: Bools, within: Bools) -> Verdict:
        """Return what follows from which are outside and which within."""
        if outside.any():
            return "differ"
        return "agree" if within[self.required].all() else "undecided"

    def verdicts(self, count: int, outside: Bools, within: Bools) -> list[Verdict]:
        """Return what follows for each of `count` groups of lights."""
        verdicts: list[Verdict] = ["undecided"] * count
        for g in np.unique(self.group[self.group >= 0]):
            mine = self.group == g
            verdicts[g] = self.at(mine).verdict(outside[mine], within[mine])
        return verdicts


def _family(
    known: Estimates,
    truth: float,
    tolerance: float,
    level: float,
    group: int | Ints,
    *,
    required: bool = True,
) -> Claims:
    """Return the claims that `known` are all `truth`; they share `level` of α equally."""
    count = len(known.value)
    return Claims(
        **vars(replace(known, value=known.value - truth)),
        tolerance=tolerance * known.scale,
        weight=np.full(count, level / max(count, 1)),
        required=np.full(count, required),
        group=np.broadcast_to(np.asarray(group, np.int64), count),
    )


def claims_of_lights(problem: Problem, known: Estimates, tolerance: float) -> Claims:
    """Return the claims that the factors `known` of the groups that count are 1."""
    groups = np.flatnonzero(problem.energy >= MIN_ENERGY)
    return _family(known.at(groups), 1.0, tolerance, LIGHTS_LEVEL, groups)


def _of_colours(problem: Problem, tolerance: float) -> Iterable[Claims]:
    for c, energy in enumerate(problem.channel_energy().T):
        lit = np.flatnonzero((energy >= MIN_ENERGY) & (problem.energy >= MIN_ENERGY))
        known = problem.channel_factors(problem.columns, c).at(lit)
        yield _family(known, 1.0, tolerance, LEVEL / 3.0, lit, required=False)


def claims_of(pools: Pools, problem: Problem, tolerance: float) -> Claims:
    """Return everything that is claimed of a witness."""
    families = [
        _family(pools.frame, 0.0, tolerance, LEVEL, FRAME),
        claims_of_lights(problem, problem.known, tolerance),
        *_of_colours(problem, tolerance),
        _family(pools.tiles, 0.0, TILE_TOLERANCES * tolerance, LEVEL, TILES),
    ]
    columns = ([getattr(each, field.name) for each in families] for field in fields(Claims))
    return Claims(*map(np.concatenate, columns))


def foretell(claims: Claims, alpha: float) -> tuple[int, dict[str, float]]:
    """Return the group that holds the verdict up, and `Comparison`'s numbers of what would help.

    Noise falls as 1/√n: a claim needs (t σ / gap)², where the gap is the distance from its
    difference to the tolerance. A difference that is itself noise says nothing about the gap, which
    is then the tolerance; and no round asks for more than the noise of its own gap justifies. One
    claim that looks clearly outside will do; otherwise all open ones must come in, which no
    luck makes possible before t σ is below the tolerance.
    """
    open_ = claims.required & ~claims.within(alpha)
    alpha = 0.5 * alpha  # of the next round
    size, limit, noise = np.abs(claims.value), claims.tolerance, claims.error
    t = critical_value(alpha, float(claims.df[open_].min()))
    gap = np.maximum(np.abs(size - limit), np.minimum(limit, noise))
    needed = SAFETY * (t * noise / gap) ** 2
    least = (critical_value(alpha, MAX_DF) * noise / limit) ** 2
    clear = claims.p_outside() <= HINT * claims.weight
    if clear.any():
        t_differ = t_quantile(alpha * claims.weight[clear], claims.df[clear])
        needed[clear] *= (t_differ / t) ** 2
        least[clear] = 0.0
        chosen = np.flatnonzero(clear)[np.argmin(needed[clear])]
    else:
        chosen = np.flatnonzero(open_)[np.argmax(needed[open_])]
    return int(claims.group[chosen]), {
        "needed_factor": max(float(needed[chosen]), 1.25),
        "least_factor": float(least[chosen]),
        "our_noise_share": float(claims.our_variance[chosen] / noise[chosen] ** 2),
        "held_up_error": float(noise[chosen] / limit[chosen]),
    }
