# SPDX-License-Identifier: GPL-3.0-or-later
"""The factors of lights: unbiased, with intervals that cover, and grouped where they must be."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.compare.factors import find_groups, fit, model_weights, problem_from_cells
from blender_rad.compare.pools import cells_from_seeds, pool
from blender_rad.compare.statistics import t_survival
from tests.unit.compare_simulation import H, W, Witness, blue_noise, film_of, layer, room

EVERY = np.ones((H, W), bool)


def problem(film, seeds):
    cells = cells_from_seeds(film, seeds, EVERY)
    return problem_from_cells(cells, pool(cells))


def binomial_bounds(count, chance, sigmas=3.5):
    spread = sigmas * np.sqrt(chance * (1.0 - chance) / count)
    return chance - spread, chance + spread


def test_the_simulated_noise_is_blue_as_in_the_renders():
    z = blue_noise(np.random.default_rng(1), (300, H, W))
    tiles = z.reshape(300, H // 16, 16, W // 16, 16).mean(axis=(2, 4))
    assert z.var() == pytest.approx(1.0, rel=0.01)
    assert 0.3 < tiles.var() * 256 < 0.4


@pytest.mark.parametrize('tail', [0.0, 0.3])
def test_intervals_of_the_factors_cover_and_are_centred(tail):
    rng, layers, repeats = np.random.default_rng(2), room(), 100
    film, witness = film_of(layers), Witness(layers, tail=tail)
    known = [problem(film, witness.seeds(rng)).known for _ in range(repeats)]
    value = np.array([k.value for k in known])
    error = np.array([k.error for k in known])
    covered = t_survival(np.abs(value - 1.0) / error, 7.0) >= 0.025
    low, high = binomial_bounds(covered.size, 0.95)
    assert low < covered.mean() < high
    z = (value.mean(axis=0) - 1.0) / (value.std(axis=0) / np.sqrt(repeats))
    assert (np.abs(z) < 4.0).all()


@pytest.mark.parametrize('shared', ['nothing', 'by channels', 'by channels and lights'])
def test_intervals_cover_with_noise_of_our_own_and_its_bias_is_removed(shared):
    """The samples of a pixel are those of all its channels; on an object's edge, of all lights."""
    rng, layers, repeats, relative = np.random.default_rng(3), room(), 80, 0.15
    stack, together = np.stack(list(layers.values())), 'lights' in shared
    shape = (2, 1 if together else len(stack), H, W, 3 if shared == 'nothing' else 1)
    squares = sum(stack) ** 2 if together else np.sum(stack**2, axis=0)
    covered, values = [], []
    for _ in range(repeats):
        halves = stack * (1.0 + relative * 2**0.5 * rng.normal(size=shape))
        noisy, drawn = (
            dict(zip(layers, x, strict=True))
            for x in (halves.mean(axis=0), 0.5 * (halves[0] - halves[1]))
        )
        film = film_of(noisy, relative**2 * squares, drawn)
        known = problem(film, Witness(layers, 0.02).seeds(rng)).known
        covered.append(t_survival(np.abs(known.value - 1.0) / known.error, known.df) >= 0.025)
        values.append(known.value)
    low, _ = binomial_bounds(np.size(covered), 0.95)
    assert np.mean(covered) > low
    values = np.array(values)
    z = (values.mean(axis=0) - 1.0) / (values.std(axis=0) / np.sqrt(repeats))
    assert (np.abs(z[:3]) < 4.0).all()


def test_noise_in_our_layers_would_pull_one_factor_down_by_its_relative_variance():
    rng = np.random.default_rng(4)
    truth = 1.0 + rng.random((1, 60000))
    halves = truth + 0.2 * 2**0.5 * rng.normal(size=(2, *truth.shape))
    ours, drawn = halves.mean(axis=0), 0.5 * (halves[0] - halves[1])
    target, weights = np.repeat(truth, 2, axis=0), np.ones((1, truth.shape[1]))
    naive = float(fit(ours, 0 * ours, target, weights, np.zeros(truth.shape[1])).value[0])
    known = fit(ours, drawn, target, weights, np.full(truth.shape[1], 0.04))
    expected = 0.04 / np.mean(ours**2)
    assert 1.0 - naive == pytest.approx(expected, rel=0.1)
    assert abs(known.value[0] - 1.0) < 0.1 * expected + 3.0 * 0.2 / np.sqrt(60000)


def test_weights_from_the_samples_themselves_bias_a_factor_and_ours_do_not():
    """A penumbra of 16 samples a pixel and 4 seeds: where few shadows were met, it looks quiet.

    A sample is lit with chance v; of n = 64, m are. The variance over seeds falls where m came out
    near n, so such pixels get the weight, and they are too bright: the factor comes out high.
    """
    rng, repeats, seeds = np.random.default_rng(5), 60, 4
    visible = np.linspace(0.55, 0.98, W)[:, None] * np.ones((H, 1, 3))
    film = film_of({'Lamp': visible})
    usual, modelled = [], []
    for _ in range(repeats):
        lit = rng.binomial(16, visible[..., :1], (seeds, H, W, 1)) / 16.0
        renders = np.broadcast_to(lit, (seeds, H, W, 3))
        weight = 1.0 / (renders.var(axis=0, ddof=1) / seeds + 0.002**2)
        usual.append(np.sum(weight * visible * renders.mean(axis=0)) / np.sum(weight * visible**2))
        modelled.append(problem(film, renders).known.value[0])
    error = np.std(modelled) / np.sqrt(repeats)
    assert 0.01 < np.mean(usual) - 1.0 < 0.035
    assert abs(np.mean(modelled) - 1.0) < 4.0 * error
    assert error < 5e-4


def test_weights_follow_the_noise():
    rng = np.random.default_rng(6)
    film = film_of({'Lamp': np.linspace(1.0, 5.0, W)[:, None] * np.ones((H, 1, 3))})
    stack = np.sqrt(film.radiance)
    seeds = film.radiance + 0.05 * stack * rng.normal(size=(16, H, W, 3))
    cells = cells_from_seeds(film, seeds, EVERY)
    weights = model_weights(cells, pool(cells))[0]
    tile_mean = film.radiance.reshape(H, W // 16, 16, 3).mean(axis=2).repeat(4, axis=1)[::4]
    ratio = weights * tile_mean
    assert ratio.max() / ratio.min() < 1.25
    assert weights.max() / weights.min() > 2.0


def test_equal_layers_form_a_group_noise_or_not():
    rng, w = np.random.default_rng(7), np.ones(3000)
    a, b = rng.random((2, 3000))
    exact = np.stack([a, b, 0.5 * a])
    assert find_groups(exact, 0 * exact, w) == [[0, 2], [1]]
    noise = 0.02 * exact * rng.normal(size=(2, *exact.shape))
    assert find_groups(exact + noise[0], noise[1], w) == [[0, 2], [1]]


def test_layers_that_add_up_to_another_form_a_group_and_black_ones_do_not():
    rng, w = np.random.default_rng(8), np.ones(3000)
    a, b, c = rng.random((3, 3000))
    for layers, groups in [
        (np.stack([a, b, c, a + b]), [[0, 1, 3], [2]]),
        (np.stack([a, 0 * a, 0 * a]), [[0], [1], [2]]),
        (np.zeros((0, 3000)), []),
    ]:
        assert find_groups(layers, 0 * layers, w) == groups


def test_lamps_that_overlap_strongly_but_not_fully_stay_apart():
    layers = np.stack([layer(x, 20.0, (1.0, 1.0, 1.0)).ravel() for x in (20.0, 24.0)])
    assert find_groups(layers, 0 * layers, np.ones(layers.shape[1])) == [[0], [1]]
