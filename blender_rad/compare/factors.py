# SPDX-License-Identifier: GPL-3.0-or-later
"""The factor on each of our lights that best explains the witness, and how well it is known.

Model: witness − seen = Σ_j f_j A_j + noise, over cells of 4×4 pixels and the three channels, fitted
replicate by replicate by weighted least squares with the weights of `model_weights`. The error of a
factor is the spread of its fits, so that no noise model has to be true for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Floats
from .pools import CELLS_A_TILE, Cells, Estimates, Pools, block_sums, estimate, spread_out
from .result import MIN_ENERGY

MAX_INFLATION = 400.0  # a factor 20 times noisier than alone would take 400 times the samples
TANGLED = 0.9  # partial correlation of factors, beyond which all join at once
HOT = 3.0  # far enough for our own noise not to be taken for it
HINGE = 0.1  # share of a fit that a single cell may have
_RIDGE = 1e-9


def model_weights(cells: Cells, pools: Pools) -> Floats:
    """Return the weight of each cell sum, (r or 1, ch, cw, 3): 1 over n times its noise.

    A weight taken from the very samples that it weighs prefers those that came out dark and quiet.
    So the variance is a + b·x + e·max(x − x₁, 0)², x the mean of ours in the 16×16 tile; the rest
    are numbers of the whole picture, from the noise v of witness and ours in its tiles: a and b
    from the medians of its darker and its brighter half, whose x is x₁, and e from the median of
    what they leave of v in the tiles that hold the brighter half of the light: beside glowing
    meshes the noise grows as the light itself.

    What the camera sees directly is added as it is: a few pixels on the edge of an emitter may hold
    most of a picture's noise, since each sample meets it or misses it, with variance
    L p (1 − p) L ≤ L·seen. So may the hot spots of lights that almost touch surfaces: c times the
    square of what exceeds `HOT` times the tile's mean is added too. Here c takes a sample for as
    noisy, relative to its mean squared, as it is in the median tile.
    """
    order = np.argsort(-pools.tiles.scale, kind="stable")
    x, v = pools.tiles.scale[order], (pools.tiles.error**2 * pools.pixels)[order]
    a, b, c, e, x1 = 0.0, 0.0, 0.0, 0.0, 0.0
    if len(x):
        half = max(len(x) // 2, 1)
        x1, v1, x0, v0 = (
            float(np.median(part)) for part in (x[:half], v[:half], x[-half:], v[-half:])
        )
        slope = max((v1 - v0) / (x1 - x0), 0.0) if x1 > x0 else 0.0
        b = min(slope, v0 / x0)
        a = v0 - b * x0
        c = float(np.median(v) / np.median(x) ** 2)
        most = (np.cumsum(x) - x < 0.5 * x.sum()) & (x > x1)
        rest = np.maximum(v - a - b * x, 0.0)[most] / (x[most] - x1) ** 2
        e = float(np.median(rest)) if len(rest) else 0.0
    a = max(a, b * 0.01 * float(pools.frame.scale.mean()), np.finfo(float).tiny ** 0.5)
    total = cells.counts.max(axis=0)
    number, ours = np.maximum(total, 1.0), np.abs(cells.ours)
    mean = block_sums(ours, CELLS_A_TILE) / np.maximum(block_sums(total, CELLS_A_TILE), 1.0)
    spread = spread_out(mean, ours.shape)
    seen = np.abs(cells.seen) / number
    hot = np.maximum(ours / number - HOT * spread, 0.0)
    noise = (
        a + b * spread + e * np.maximum(spread - x1, 0.0) ** 2 + c * (seen.max() * seen + hot**2)
    )
    weight = 1.0 / (number * noise)
    return weight / weight.max() * (cells.counts > 0)


def _inverse(matrix: Floats) -> Floats:
    """Return the pseudo-inverse of a symmetric matrix (j, j), its rows and columns scaled to 1."""
    scale = _lengths(matrix)
    return np.linalg.pinv(matrix / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)


def _lengths(matrix: Floats) -> Floats:
    """Return the roots of the diagonal (j,), 1 for those of black layers."""
    diagonal = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    return np.where(diagonal > 0, diagonal, 1.0)


def find_groups(layers: Floats, noise: Floats, weight: Floats) -> list[list[int]]:
    """Return which `layers` (j, p) belong together because no fit could tell them apart.

    While a light's variance inflation (that of its factor, over what it would be if the light were
    alone) exceeds `MAX_INFLATION`, it joins those that its factor depends on most, by the partial
    correlation of the factors: one, or all of a sum that cannot be taken apart. Noise in our
    own layers makes equal ones look different: two of relative variance ε have an inflation of
    1/(2ε), so the limit falls to half of that.
    """
    groups = [[j] for j in range(len(layers))]
    while len(groups) > 1:
        columns, drawn = (np.stack([x[g].sum(axis=0) for g in groups]) for x in (layers, noise))
        matrix = (columns * weight) @ columns.T
        scale = _lengths(matrix)
        cosines = matrix / np.outer(scale, scale)
        black = np.diag(cosines) == 0
        inverse = np.linalg.inv(cosines + np.diag(np.where(black, 1.0, _RIDGE)))
        limit = 1.0 / (1.0 / MAX_INFLATION + 4.0 * (drawn**2 @ weight) / scale**2)
        excess = np.where(black, 0.0, np.diag(inverse) / limit)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            break
        partial = np.abs(inverse[worst]) / np.sqrt(np.diag(inverse) * inverse[worst, worst])
        partial[worst] = 1.0
        nearest = min(float(np.sort(partial)[-2]), TANGLED)
        joined = [g for g, p in zip(groups, partial.tolist(), strict=True) if p >= nearest]
        groups = [g for g in groups if g not in joined]
        groups.append(sorted(j for group in joined for j in group))
    return sorted(groups)


def fit(
    layers: Floats, noise: Floats, target: Floats, weights: Floats, variance: Floats
) -> Estimates:
    """Return the factor on each of `layers` (j, p) that explains `target` (r, p).

    `layers` (j, p) are sums over cells, channels running fastest, `noise` is a draw of theirs.
    `weights` (r, p) are 0 where a replicate has no data; or (1, p) where all are alike. `variance`
    (p,) is of the sum of our layers.

    f = (X W Xᵀ − D W Dᵀ)⁻¹ X W y with the draws D of the noise in X: what noise adds to X W Xᵀ on
    average is taken off, also where lights share it (edges of objects); else a factor would be too
    low by the relative variance of our cells. Our noise goes through P = (…)⁻¹ X W. The channels
    of a cell share it, since their samples do: the error is at most Σ_cells (Σ_rgb |P| σ)².

    Of few samples σ may be far from true, which tells where all hinges on one cell. Where a cell's
    leverage h = Σ_j X_j P_j exceeds `HINGE`, what it moves the factors by is added to their error,
    up to 1: Σ_rgb P r/(1 − h), r the residual, so that r/(1 − h) is that of a fit without the cell.
    """
    factors: list[Floats] = []
    through = np.zeros(layers.shape)
    for weight, part in zip(weights, np.split(target, len(weights)), strict=True):
        weighted = layers * weight
        solve = _inverse(weighted @ layers.T - (noise * weight) @ noise.T) @ weighted
        factors.append(part @ solve.T)
        through += solve / len(weights)
    found = np.concatenate(factors)
    there = np.broadcast_to(weights > 0.0, target.shape)
    rest = np.sum(target * there, axis=0) / np.maximum(there.sum(axis=0), 1)
    rest -= found.mean(axis=0) @ layers
    cells = len(layers), layers.shape[1] // 3, 3
    leverage = (layers * through).reshape(cells).sum(axis=(0, 2))
    moved = (through * rest).reshape(cells).sum(axis=2) / np.maximum(1.0 - leverage, _RIDGE)
    drawn = np.sqrt(through**2 * variance).reshape(cells).sum(axis=2)
    moved = np.where(leverage > HINGE, np.minimum(np.abs(moved), 1.0), 0.0)
    ours = np.sum(drawn**2 + moved**2, axis=1)
    return estimate(found, ours, np.ones(len(layers)))


@dataclass(frozen=True)
class Problem:
    """The lights' fit, ready to be asked again with other layers."""

    groups: list[list[int]]  # of indices into `Cells.names`
    columns: Floats  # (g, p) the groups' layers, sums over cells
    noise: Floats  # (g, p) a draw of their noise
    target: Floats  # (r, p) witness less directly seen emission
    weights: Floats  # (r, p) or (1, p)
    seen: Floats  # (p,)
    variance: Floats  # (p,)

    def joined(self, bearable: float) -> Problem:
        """Return it with groups joined until each that is judged has an error that is `bearable`.

        One that has not joins the one that its factor depends on most.
        """
        if len(self.groups) < 2:
            return self
        error = np.where(self.energy >= MIN_ENERGY, self.known.error, 0.0)
        worst = int(np.argmax(error))
        if error[worst] <= bearable:
            return self
        inverse = _inverse((self.columns * self.weights.mean(axis=0)) @ self.columns.T)
        partial = np.abs(inverse[worst]) / np.sqrt(np.maximum(np.diag(inverse), 1e-300))
        partial[worst] = -1.0
        pair = sorted((worst, int(np.argmax(partial))))
        columns, noise = (
            np.vstack([np.delete(x, pair, axis=0), x[pair].sum(axis=0)])
            for x in (self.columns, self.noise)
        )
        groups = [group for g, group in enumerate(self.groups) if g not in pair]
        groups.append(sorted(self.groups[pair[0]] + self.groups[pair[1]]))
        return replace(self, groups=groups, columns=columns, noise=noise).joined(bearable)

    @property
    def energy(self) -> Floats:
        """Share of each group in the absolute energy of all, (g,)."""
        return np.abs(self.columns.sum(axis=1)) / self._total

    def channel_energy(self) -> Floats:
        """Share of each group's channels in the absolute energy of all, (g, 3)."""
        return np.abs([self.columns[:, c::3].sum(axis=1) for c in range(3)]).T / self._total

    @property
    def _total(self) -> float:
        return float(np.abs(self.columns.sum(axis=1)).sum()) or 1.0

    @cached_property
    def known(self) -> Estimates:
        """The factors of the groups."""
        return self.factors(self.columns)

    def factors(self, columns: Floats, part: Floats | float = 1.0) -> Estimates:
        """Return the factors of `columns` (g, p) in place of ours, from a `part` (p,) alone."""
        return fit(columns, self.noise, self.target, self.weights * part, self.variance)

    def channel_factors(self, columns: Floats, channel: int) -> Estimates:
        """Return the factors of `columns` (g, p) from one channel alone."""
        return self.factors(columns, np.arange(columns.shape[1]) % 3 == channel)


def problem_from_cells(cells: Cells, pools: Pools) -> Problem:
    """Return the fit of all lights, those grouped that cannot be told apart."""
    weights = model_weights(cells, pools).reshape(len(cells.counts), -1)
    layers, noise = (x.reshape(len(x), cells.ours.size) for x in (cells.layers, cells.noise))
    groups = find_groups(layers, noise, weights.mean(axis=0))
    columns, drawn = (
        np.array([x[group].sum(axis=0) for group in groups]).reshape(-1, cells.ours.size)
        for x in (layers, noise)
    )
    target = cells.residual(cells.seen).reshape(len(cells.witness), -1)
    seen, variance = cells.seen.ravel(), cells.variance.ravel()
    return Problem(groups, columns, drawn, target, weights, seen, variance)
