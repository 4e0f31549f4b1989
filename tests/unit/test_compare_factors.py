# SPDX-License-Identifier: GPL-3.0-or-later
"""The factors of lights: unbiased, with intervals that cover, and grouped where they must be."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.compare.factors import find_groups, model_weights, problem_from_cells
from blender_rad.compare.pools import cells_from_seeds, pool
from blender_rad.compare.statistics import t_survival
from tests.unit.compare_simulation import H, W, Witness, blue_noise, film_of, layer, room


def pooled(film, seeds):
    cells = cells_from_seeds(film, seeds, np.ones((H, W), bool))
    return cells, pool(cells)


def known_factors(film, seeds):
    return problem_from_cells(*pooled(film, seeds)).known


def test_the_simulated_noise_is_blue_as_in_the_renders():
    z = blue_noise(np.random.default_rng(1), (300, H, W))
    tiles = z.reshape(300, H // 16, 16, W // 16, 16).mean(axis=(2, 4))
    assert z.var() == pytest.approx(1.0, rel=0.01)
    assert 0.3 < tiles.var() * 256 < 0.4


@pytest.mark.parametrize(
    ('tail', 'shared'),
    [(0.0, None), (0.3, None), (0.0, ''), (0.0, 'channels'), (0.0, 'channels and lights')],
)
def test_intervals_cover_and_are_centred(tail, shared):
    """Without noise of ours and with: a pixel's samples are those of all its channels; on an
    object's edge, of all lights. Then the intervals may be too wide, never too narrow.
    """
    rng, layers, repeats, relative = np.random.default_rng(2), room(), 80, 0.15
    stack, together = np.stack(list(layers.values())), 'lights' in (shared or '')
    shape = (2, 1 if together else len(stack), H, W, 1 if shared else 3)
    squares = sum(stack) ** 2 if together else np.sum(stack**2, axis=0)
    film, witness, known = film_of(layers), Witness(layers, 0.06, tail), []
    for _ in range(repeats):
        if shared is not None:
            witness.noise = 0.02
            halves = stack * (1.0 + relative * 2**0.5 * rng.normal(size=shape))
            noisy, drawn = (
                dict(zip(layers, x, strict=True))
                for x in (halves.mean(axis=0), 0.5 * (halves[0] - halves[1]))
            )
            film = film_of(noisy, relative**2 * squares, drawn)
        known.append(known_factors(film, witness.seeds(rng)))
    value, error, df = (np.array([getattr(k, a) for k in known]) for a in ('value', 'error', 'df'))
    covered = t_survival(np.abs(value - 1.0) / error, df) >= 0.025
    spread = 3.5 * np.sqrt(0.95 * 0.05 / covered.size)
    assert 0.95 - spread < covered.mean() < (0.95 + spread if shared is None else 1.01)
    z = (value.mean(axis=0) - 1.0) / (value.std(axis=0) / np.sqrt(repeats))
    assert (np.abs(z[: 4 if shared is None else 3]) < 4.0).all()


def test_weights_from_the_samples_themselves_bias_a_factor_and_ours_do_not():
    """A penumbra of 16 samples a pixel and 4 seeds: where few shadows were met, it looks quiet.

    A sample is lit with chance v; of n = 64, m are. The variance over seeds falls where m came out
    near n, so such pixels get the weight, and they are too bright: the factor comes out high.
    """
    rng, repeats, seeds = np.random.default_rng(5), 40, 4
    visible = np.linspace(0.55, 0.98, W)[:, None] * np.ones((H, 1, 3))
    film, usual, modelled = film_of({'Lamp': visible}), [], []
    for _ in range(repeats):
        lit = rng.binomial(16, visible[..., :1], (seeds, H, W, 1)) / 16.0
        renders = np.broadcast_to(lit, (seeds, H, W, 3))
        weight = 1.0 / (renders.var(axis=0, ddof=1) / seeds + 0.002**2)
        usual.append(np.sum(weight * visible * renders.mean(axis=0)) / np.sum(weight * visible**2))
        modelled.append(known_factors(film, renders).value[0])
    error = np.std(modelled) / np.sqrt(repeats)
    assert 0.01 < np.mean(usual) - 1.0 < 0.035
    assert abs(np.mean(modelled) - 1.0) < 4.0 * error < 2.5e-3


def test_weights_follow_the_noise():
    rng = np.random.default_rng(6)
    film = film_of({'Lamp': np.linspace(1.0, 5.0, W)[:, None] * np.ones((H, 1, 3))})
    noise = 0.05 * np.sqrt(film.radiance) * rng.normal(size=(16, H, W, 3))
    weights = model_weights(*pooled(film, film.radiance + noise))[0]
    tile_mean = film.radiance.reshape(H, W // 16, 16, 3).mean(axis=2).repeat(4, axis=1)[::4]
    ratio = weights * tile_mean
    assert ratio.max() / ratio.min() < 1.25
    assert weights.max() / weights.min() > 2.0


def test_a_factor_that_hinges_on_one_cell_is_not_known():
    """One sample may be far off and look quiet: by 40 % in a cell that outshines all."""
    light = np.full((H, W, 3), 1e-3)
    light[:4, :4] = 1e4
    own = np.where(light > 1.0, 1.4, 1.0) * light
    film = film_of({'Lamp': own}, np.where(light > 1.0, 0.05 * own, 0.0) ** 2)
    noise = 0.05 * np.random.default_rng(10).normal(size=(16, H, W, 3))
    known = known_factors(film, light + noise)
    assert abs(known.value[0] - 1.0) < 2.0 * known.error[0] < 4.0


A, B, C = np.random.default_rng(7).random((3, 3000))
NEAR = [layer(x, 20.0, (1.0, 1.0, 1.0)).ravel() for x in (20.0, 24.0)]


@pytest.mark.parametrize(
    ('layers', 'noise', 'groups'),
    [
        ([A, B, 0.5 * A], 0.0, [[0, 2], [1]]),
        ([A, B, 0.5 * A], 0.02, [[0, 2], [1]]),
        ([A, B, C, A + B], 0.0, [[0, 1, 3], [2]]),
        ([A, 0 * A, 0 * A], 0.0, [[0], [1], [2]]),
        (np.zeros((0, 3000)), 0.0, []),
        (NEAR, 0.0, [[0], [1]]),  # lamps that overlap strongly, but not fully
    ],
)
def test_layers_that_cannot_be_told_apart_are_a_group(layers, noise, groups):
    layers = np.stack(layers) if len(layers) else layers
    noise = noise * layers * np.random.default_rng(8).normal(size=(2, *layers.shape))
    assert find_groups(layers + noise[0], noise[1], np.ones(layers.shape[1])) == groups


def test_noise_that_grows_as_the_light_is_not_followed():
    """Two tiles beside a glowing mesh hold nearly all light, and little that is known."""
    rng = np.random.default_rng(9)
    light = np.ones((H, W, 3))
    light[:16, :32] = 100.0
    near = light > 1.0
    noise, own = np.where(near, 0.5 * light, 0.05), np.where(near, 0.2 * light, 0.0)
    drawn = own * rng.normal(size=light.shape)
    film = film_of({'Lamp': light + own * rng.normal(size=light.shape)}, own**2, {'Lamp': drawn})
    known = known_factors(film, light + noise * rng.normal(size=(16, H, W, 3)))
    best = 0.05 / np.sqrt(16 * np.count_nonzero(~near))
    assert abs(known.value[0] - 1.0) < 4.0 * known.error[0] < 8.0 * best
