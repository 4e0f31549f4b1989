# SPDX-License-Identifier: GPL-3.0-or-later
"""The factor on each of our lights that best explains the witness, and how well it is known.

Model: witness − seen = Σ_j f_j A_j + noise, over cells of 4×4 pixels and the three channels, fitted
replicate by replicate by weighted least squares with the weights of `model_weights`. The error of a
factor is the spread of its fits, so that no noise model has to be true for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .pools import CELLS_A_TILE, Array, Cells, Estimates, Pools, block_sums, estimate

MAX_INFLATION = 400.0  # a factor 20 times noisier than alone would take 400 times the samples
TANGLED = 0.9  # partial correlation of factors, beyond which all join at once
_RIDGE = 1e-9


def model_weights(cells: Cells, pools: Pools) -> Array:
    """Return the weight of each cell sum, (r or 1, ch, cw, 3): 1 / (n (a + b·ours + c·seen)).

    A weight taken from the very samples that it weighs prefers those that came out dark and quiet.
    So a and b are two numbers for the whole picture, from the medians of the tiles' spread in its
    darker and its brighter half, and `ours` is the mean of the 16×16 tile, which hardly knows the
    noise of one cell of ours. What the camera sees directly is added as it is: a few pixels on the
    edge of an emitter may hold most of a picture's noise, since each sample meets it or misses it,
    with variance L p (1 − p) L ≤ L·seen. Its c takes a sample for as noisy, relative to its mean
    squared, as it is in the median tile.
    """
    scale, variance = pools.tile_scale, pools.tiles.witness_variance * pools.pixels
    a, b, c = 0.0, 0.0, 0.0
    if len(scale):
        bright = scale > np.median(scale)
        halves = [bright, ~bright] if bright.any() else [~bright, ~bright]
        (x1, v1), (x0, v0) = ((np.median(scale[h]), np.median(variance[h])) for h in halves)
        b = max((v1 - v0) / (x1 - x0), 0.0) if x1 > x0 else 0.0
        a = max(v0 - b * x0, 0.0)
        c = float(np.median(variance) / np.median(scale) ** 2)
    a = max(a, b * 0.01 * float(pools.frame_scale.mean()), np.finfo(float).tiny ** 0.5)
    total = cells.counts.max(axis=0)
    tile = block_sums(np.abs(cells.ours), CELLS_A_TILE)
    mean = tile / np.maximum(block_sums(total, CELLS_A_TILE), 1.0)
    rows, columns = cells.ours.shape[:2]
    spread = np.repeat(np.repeat(mean, CELLS_A_TILE, axis=0), CELLS_A_TILE, axis=1)
    seen = np.abs(cells.seen) / np.maximum(total, 1.0)
    noise = a + b * spread[:rows, :columns] + c * seen.max() * seen
    weight = 1.0 / (np.maximum(total, 1.0) * noise)
    return weight / weight.max() * (cells.counts > 0)


@dataclass(frozen=True)
class Normal:
    """Normal equations of one fit: X W Xᵀ, and what noise in our own layers adds to it.

    Attributes
    ----------
    matrix : (j, j).
    noise : (j,) its expected excess on the diagonal. Of our noise the variance of the sum of the
        layers is known; each is given the part that it has in the radiance.
    """

    matrix: Array
    noise: Array

    @property
    def scale(self) -> Array:
        """Length of each layer, (j,), 1 for black ones."""
        diagonal = np.sqrt(np.diag(self.matrix))
        return np.where(diagonal > 0, diagonal, 1.0)

    def inverse(self) -> Array:
        """Return the pseudo-inverse of the matrix less its noise, (j, j)."""
        clean = (self.matrix - np.diag(self.noise)) / np.outer(self.scale, self.scale)
        return np.linalg.pinv(clean, hermitian=True) / np.outer(self.scale, self.scale)


def normal_equations(layers: Array, weight: Array, variance: Array) -> Normal:
    """Return the normal equations of `layers` (j, p) with `weight` (p,), our `variance` (p,)."""
    size = np.abs(layers)
    total = size.sum(axis=0)
    noisy = np.divide(weight * variance, total, out=np.zeros_like(total), where=total > 0)
    return Normal((layers * weight) @ layers.T, np.asarray(size @ noisy, float))


def find_groups(layers: Array, weight: Array, variance: Array) -> list[list[int]]:
    """Return which `layers` (j, p) belong together because no fit could tell them apart.

    While a light's variance inflation (that of its factor, over what it would be if the light were
    alone) exceeds `MAX_INFLATION`, it joins those that its factor depends on most, by the partial
    correlation of the factors: one, or all of a sum that cannot be taken apart. Noise in our
    own layers makes equal ones look different: two of relative variance ε have an inflation of
    1/(2ε), so the limit falls to half of that.
    """
    groups = [[j] for j in range(len(layers))]
    while len(groups) > 1:
        columns = np.stack([layers[g].sum(axis=0) for g in groups])
        normal = normal_equations(columns, weight, variance)
        cosines = normal.matrix / np.outer(normal.scale, normal.scale)
        black = np.diag(cosines) == 0
        inverse = np.linalg.inv(cosines + np.diag(np.where(black, 1.0, _RIDGE)))
        limit = 1.0 / (1.0 / MAX_INFLATION + 4.0 * normal.noise / normal.scale**2)
        excess = np.where(black, 0.0, np.diag(inverse) / limit)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            break
        partial = np.abs(inverse[worst]) / np.sqrt(np.diag(inverse) * inverse[worst, worst])
        partial[worst] = 1.0
        limit = min(float(np.sort(partial)[-2]), TANGLED)
        joined = [g for g, p in zip(groups, partial.tolist(), strict=True) if p >= limit]
        groups = [g for g in groups if g not in joined]
        groups.append(sorted(j for group in joined for j in group))
    return sorted(groups)


def fit(layers: Array, target: Array, weights: Array, variance: Array) -> Estimates:
    """Return the factor on each of `layers` (j, p) that explains `target` (r, p).

    Parameters
    ----------
    layers : (j, p) sums over cells, channels included.
    target : (r, p) the witness's, for each replicate.
    weights : (r, p), 0 where a replicate has no data; or (1, p) where all are alike.
    variance : (p,) of the sum of our layers.

    Notes
    -----
    With N = X W Xᵀ and C the part of N that is noise in X, f = (N−C)⁻¹ X W y; without C a factor is
    too low by the relative variance of our cells. Our noise E goes through P = (N−C)⁻¹ X W, adding
    Σ P² var(E). How the noise is shared between lights is a guess, so half of what C moves a factor
    by counts as its error too.
    """
    factors: list[Array] = []
    shift, through = np.zeros(len(layers)), np.zeros(layers.shape)
    for weight, part in zip(weights, np.split(target, len(weights)), strict=True):
        normal = normal_equations(layers, weight, variance)
        inverse, weighted = normal.inverse(), layers * weight
        found = part @ weighted.T @ inverse
        factors.append(found)
        through += inverse @ weighted / len(weights)
        shift += inverse @ (normal.noise * found.mean(axis=0)) / len(weights)
    ours = through**2 @ variance + (0.5 * shift) ** 2
    return estimate(np.concatenate(factors), ours, np.ones(len(layers)))


@dataclass(frozen=True)
class Problem:
    """The lights' fit, ready to be asked again with other layers.

    Attributes
    ----------
    groups : indices into `Cells.names`.
    columns : (g, p) the groups' layers, sums over cells.
    target : (r, p) witness less directly seen emission.
    weights : (r, p) or (1, p).
    seen, variance : (p,).
    """

    groups: list[list[int]]
    columns: Array
    target: Array
    weights: Array
    seen: Array
    variance: Array

    @property
    def energy(self) -> Array:
        """Share of each group in the absolute energy of all, (g,)."""
        size = np.abs(self.columns.sum(axis=1))
        return size / size.sum() if size.sum() > 0 else size

    @cached_property
    def known(self) -> Estimates:
        """The factors of the groups."""
        return self.factors(self.columns)

    def factors(self, columns: Array) -> Estimates:
        """Return the factors of `columns` (g, p) in place of ours."""
        return fit(columns, self.target, self.weights, self.variance)

    def channel_factors(self, channel: int) -> Estimates:
        """Return the factors of the groups from one channel alone."""
        only = np.arange(self.columns.shape[1]) % 3 == channel
        return fit(self.columns, self.target, self.weights * only, self.variance)

    def channel_energy(self) -> Array:
        """Share of each group's channels in the absolute energy of all, (g, 3)."""
        groups, number = self.columns.shape
        size = np.abs(self.columns.reshape(groups, number // 3, 3).sum(axis=1))
        total = np.abs(self.columns.sum(axis=1)).sum()
        return size / total if total > 0 else size


def problem_from_cells(cells: Cells, pools: Pools) -> Problem:
    """Return the fit of all lights, those grouped that cannot be told apart."""
    weights = model_weights(cells, pools).reshape(len(cells.counts), -1)
    layers = cells.layers.reshape(len(cells.names), cells.ours.size)
    variance = cells.variance.ravel()
    groups = find_groups(layers, weights.mean(axis=0), variance)
    columns = [layers[group].sum(axis=0) for group in groups]
    return Problem(
        groups,
        np.stack(columns) if columns else layers,
        cells.residual(cells.seen).reshape(len(cells.witness), -1),
        weights,
        cells.seen.ravel(),
        variance,
    )
