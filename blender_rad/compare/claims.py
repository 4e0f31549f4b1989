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

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .factors import Problem
from .pools import MAX_DF, Array, Estimates, Mask, Pools
from .result import MIN_ENERGY
from .statistics import critical_value, holm, p_equivalent, p_outside, t_quantile

TILE_TOLERANCES = 5.0
LIGHTS_LEVEL, LEVEL = 1.0 / 2.0, 1.0 / 6.0
HINT = 0.05  # chance that noise alone makes any claim look clearly outside
SAFETY = 1.3  # on the samples foretold: the noise itself is only estimated
FRAME, TILES = -1, -2


@dataclass(frozen=True)
class Claims:
    """Differences with tolerances; each either within, outside, or not known yet.

    Attributes
    ----------
    delta, error, our_share, df, tolerance : (n,).
    weight : (n,) for Holm.
    required : (n,) whether `agree` needs it.
    group : (n,) the group of lights that it is about, `FRAME` or `TILES`.
    """

    delta: Array
    error: Array
    our_share: Array
    df: Array
    tolerance: Array
    weight: Array
    required: Mask
    group: NDArray[np.int64]

    def outside(self, alpha: float) -> Mask:
        """Return which differences are significantly beyond their tolerance, by Holm, (n,)."""
        return holm(p_outside(self.delta, self.error, self.df, self.tolerance), alpha, self.weight)

    def within(self, alpha: float) -> Mask:
        """Return which differences are shown to be within their tolerance, (n,)."""
        return p_equivalent(self.delta, self.error, self.df, self.tolerance) <= alpha


def _family(
    known: Estimates, truth: float, tolerance: Array, level: float, group: int | NDArray[np.int64]
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
        np.ones(count, bool),
        np.broadcast_to(np.asarray(group, np.int64), count),
    )


def _about_lights(problem: Problem, tolerance: float) -> list[Claims]:
    groups = np.flatnonzero(problem.energy >= MIN_ENERGY)
    limit = np.full(len(groups), tolerance)
    claims = [_family(problem.known.at(groups), 1.0, limit, LIGHTS_LEVEL, groups)]
    for c, energy in enumerate(problem.channel_energy().T):
        lit = groups[energy[groups] >= MIN_ENERGY]
        limit = np.full(len(lit), tolerance)
        colour = _family(problem.channel_factors(c).at(lit), 1.0, limit, LEVEL / 3.0, lit)
        claims.append(replace(colour, required=np.zeros(len(lit), bool)))
    return claims


def claims_of(pools: Pools, problem: Problem, tolerance: float) -> Claims:
    """Return everything that is claimed of a witness."""
    tiles = TILE_TOLERANCES * tolerance * pools.tile_scale
    families = [
        _family(pools.frame, 0.0, tolerance * pools.frame_scale, LEVEL, FRAME),
        *_about_lights(problem, tolerance),
        _family(pools.tiles, 0.0, tiles, LEVEL, TILES),
    ]
    return Claims(*(
        np.concatenate([getattr(family, field.name) for family in families])
        for field in fields(Claims)
    ))


class Forecast(NamedTuple):
    """What would settle an open comparison.

    Attributes
    ----------
    factor : how many times the samples would probably decide the next round.
    least : how many times they must be at least, even if there were no difference at all.
    our_share : part of the variance that is ours.
    error : of the claim that holds the verdict up, relative to its tolerance.
    group : of that claim.
    """

    factor: float
    least: float
    our_share: float
    error: float
    group: int


def foretell(claims: Claims, alpha: float) -> Forecast:
    """Return how many times the samples would decide the next round, and whose they should be.

    Noise falls as 1/√n: a claim needs (t σ / gap)², where the gap is the distance from its
    difference to the tolerance. A difference that is itself noise says nothing about the gap, which
    is then the tolerance; and no round asks for more than the noise of its own gap justifies. One
    claim that looks clearly outside will do; otherwise all open ones must come in, which no
    luck makes possible before t σ is below the tolerance.
    """
    open_ = claims.required & ~claims.within(alpha)
    alpha = 0.5 * alpha  # of the next round
    size, df = np.abs(claims.delta), float(claims.df[open_].min())
    gap = np.maximum(np.abs(size - claims.tolerance), np.minimum(claims.tolerance, claims.error))
    t = critical_value(alpha, df)
    needed = SAFETY * (t * claims.error / gap) ** 2
    error = claims.error / claims.tolerance
    least = (critical_value(alpha, MAX_DF) * error) ** 2
    p = p_outside(claims.delta, claims.error, claims.df, claims.tolerance)
    clear = p <= HINT * claims.weight
    if clear.any():
        t_differ = t_quantile(alpha * claims.weight[clear], claims.df[clear])
        needed[clear] *= (t_differ / t) ** 2
        least[clear] = 0.0
        chosen = np.flatnonzero(clear)[np.argmin(needed[clear])]
    else:
        chosen = np.flatnonzero(open_)[np.argmax(needed[open_])]
    return Forecast(
        max(float(needed[chosen]), 1.25),
        float(least[chosen]),
        float(claims.our_share[chosen]),
        float(error[chosen]),
        int(claims.group[chosen]),
    )
