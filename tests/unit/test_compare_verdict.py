# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict: how often it errs, how often it finds, and what it does at the edges."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from blender_rad.compare import judge, judge_pictures
from blender_rad.errors import RadError
from tests.unit.compare_simulation import H, W, Witness, film_of, infos, layer, room

# The measured total energy of 160×120 pixels is known to 7e-5 with 8 seeds of 64 samples; these
# pictures are 2.5 times smaller each way, so their pixels are that much quieter.
QUIET = 0.024
ALPHA = 0.01
MORE = pytest.mark.parametrize('repeats', [40, pytest.param(600, marks=pytest.mark.nightly)])


def judged(layers, shown=None, noise=QUIET, count=8, *, seed=1, film=None, **options):
    """Judge seeds of what a witness shows, the same as ours where nothing else is said."""
    seeds = Witness(layers if shown is None else shown, noise).seeds(
        np.random.default_rng(seed), count
    )
    return judge(film or film_of(layers), seeds, lights=infos(layers), **options)


def verdicts(rng, layers, witness, repeats, **options):
    film, lights = film_of(layers), infos(layers)
    return Counter(
        judge(film, witness.seeds(rng), lights=lights, **options).verdict for _ in range(repeats)
    )


def at_most(chance, repeats):
    return chance * repeats + 3.0 * np.sqrt(chance * (1.0 - chance) * repeats)


def scaled(layers, name, factor):
    return {n: v * (factor if n == name else 1.0) for n, v in layers.items()}


def with_tile(layers, factor, row=0, column=2):
    spot = np.ones((H, W, 1))
    spot[16 * row : 16 * row + 16, 16 * column : 16 * column + 16] = factor
    return {n: v * spot for n, v in layers.items()}


@MORE
@pytest.mark.parametrize('tail', [0.0, 0.4])
def test_equal_scenes_never_differ(tail, repeats):
    rng, layers = np.random.default_rng(1), room()
    found = verdicts(rng, layers, Witness(layers, tail=tail), repeats, tolerance=1e-4)
    assert found['differ'] <= at_most(ALPHA, repeats)


@MORE
@pytest.mark.parametrize(('name', 'factor'), [('Key', 1.01), ('Fill', 0.99), ('Small', 1.01)])
def test_a_light_at_the_very_tolerance_is_mistaken_rarely(name, factor, repeats):
    rng, layers = np.random.default_rng(2), room()
    witness = Witness(scaled(layers, name, factor), QUIET, tail=0.3)
    found = verdicts(rng, layers, witness, repeats)
    assert found['differ'] <= at_most(ALPHA, repeats)
    assert found['agree'] <= at_most(ALPHA, repeats)


@MORE
@pytest.mark.parametrize('factor', [1.05, 0.95])
def test_a_tile_at_the_very_tolerance_is_mistaken_rarely(factor, repeats):
    """One dim tile: what it does to the lights' factors stays well inside their tolerance."""
    rng, layers = np.random.default_rng(3), {'Sky': room()['Sky']}
    witness = Witness(with_tile(layers, factor), 0.2, tail=0.3)
    found = verdicts(rng, layers, witness, repeats)
    assert found['differ'] <= at_most(ALPHA, repeats)
    assert found['agree'] <= at_most(ALPHA, repeats)


def decide(rng, film, witness, rounds=5):
    """Buy seeds until decided, as `check` does."""
    seeds = witness.seeds(rng)
    for index in range(rounds):
        found = judge(film, seeds, lights=infos(film.lights), round_index=index)
        if found.verdict != 'undecided':
            return found, len(seeds)
        more = int(np.ceil(len(seeds) * (min(found.needed_factor, 8.0) - 1.0)))
        seeds = np.concatenate([seeds, witness.seeds(rng, more)])
    return found, len(seeds)


def test_twice_the_tolerance_on_a_light_of_over_one_percent_is_found():
    rng, layers, repeats = np.random.default_rng(4), room(), 25
    film = film_of(layers)
    witness = Witness(scaled(layers, 'Small', 1.02), QUIET)
    assert 0.01 < layers['Small'].sum() / film.radiance.sum() < 0.02
    found = [decide(rng, film, witness) for _ in range(repeats)]
    assert all(comparison.verdict == 'differ' for comparison, _ in found)
    assert all(comparison.lights[3].verdict == 'differ' for comparison, _ in found)
    assert np.median([count for _, count in found]) <= 32


def test_equal_scenes_agree_in_the_usual_case():
    rng, layers = np.random.default_rng(5), room()
    found = [decide(rng, film_of(layers), Witness(layers, QUIET)) for _ in range(15)]
    assert all(comparison.verdict == 'agree' for comparison, _ in found)
    assert np.median([count for _, count in found]) <= 16


def test_a_tile_ten_percent_off_differs_and_the_lights_are_cleared():
    found = judged(room(), with_tile(room(), 1.10), count=16)
    assert found.verdict == 'differ'
    assert {f.code for f in found.findings} == {'tiles-differ', 'extra-light'}
    assert '(32, 0)' in found.findings[-1].message
    assert all(light.verdict != 'differ' for light in found.lights)


def test_a_shift_of_colour_alone_differs():
    layers = room()
    weights = np.array([0.2126390, 0.7151687, 0.0721923])
    shift = np.array([1.03, 1.0, 1.0])
    shift[1] = 1.0 - 0.03 * weights[0] * 1.0 / (weights[1] * 0.9)
    other = {**layers, 'Key': layers['Key'] * shift}
    assert (other['Key'] @ weights).sum() == pytest.approx((layers['Key'] @ weights).sum())
    found = judged(layers, other)
    assert found.verdict == 'differ'
    assert found.lights[0].diagnosis == 'colour'
    assert [light.verdict for light in found.lights[1:3]] == ['agree', 'agree']


def test_coincident_lights_are_one_group_with_one_factor():
    twins = {**room(), 'Twin': 0.5 * room()['Key']}
    found = judged(twins, scaled(twins, 'Twin', 1.3))
    key, twin = found.lights[0], found.lights[-1]
    assert key.group == twin.group == 'Key + Twin'
    assert key.scale_in_witness == twin.scale_in_witness == pytest.approx(1.1, abs=2e-3)
    assert key.energy_fraction == pytest.approx(2.0 * twin.energy_fraction)
    assert [light.group for light in found.lights[1:4]] == [None] * 3
    assert found.verdict == twin.verdict == 'differ'


def test_a_light_a_hundred_times_brighter_does_not_drown_the_others():
    found = judged(scaled(room(), 'Key', 100.0), noise=0.002)
    assert found.verdict == 'agree'
    assert found.lights[3].energy_fraction < 0.01
    assert found.lights[3].verdict == 'undecided'
    assert sum(light.energy_fraction for light in found.lights) == pytest.approx(1.0)


def test_an_excluded_half_is_left_out_and_more_than_half_is_undecided():
    layers, wrong = ({'Sky': room()['Sky']} for _ in range(2))
    wrong['Sky'][:, : W // 2 - 3] *= 3.0
    out = np.zeros((H, W), bool)
    out[:, : W // 2 - 3] = True
    found = judged(layers, wrong, 0.01, film=film_of(layers, excluded=out))
    assert found.verdict == 'agree'
    assert (found.pixels.excluded, found.pixels.compared) == (out.sum(), (~out).sum())
    out[:, : W // 2 + 3] = True
    found = judged(layers, wrong, 0.01, film=film_of(layers, excluded=out))
    assert found.verdict == 'undecided'
    assert [f.code for f in found.findings] == ['coverage-low']
    assert found.needed_factor is None


@pytest.mark.parametrize('what', ['all excluded', 'all black', 'no lights'])
def test_nothing_to_compare_is_undecided(what):
    layers = {} if what == 'no lights' else {'Sky': room()['Sky'] * (what != 'all black')}
    film = film_of(layers or {'Sky': np.zeros((H, W, 3))})
    if what == 'no lights':
        film = replace(film, lights={})
    if what == 'all excluded':
        film = replace(film, excluded=np.ones((H, W), bool))
    found = judge(film, np.stack([film.radiance] * 3), lights=infos({'Sky': 0, 'Off': 0}))
    assert found.verdict == 'undecided'
    assert [f.code for f in found.findings] == ['nothing-compared']
    assert [light.name for light in found.lights][:2] == ['Sky', 'Off']
    assert json.loads(json.dumps(found.to_json()))['lights'][1]['scale_in_witness'] is None


def test_lights_of_shadow_alone_black_ones_and_negative_ones_are_judged_or_left():
    dark = -0.3 * layer(40.0, 10.0, (1.0, 1.0, 1.0))
    odd = {**room(), 'Dark': dark, 'Black': 0 * dark}
    found = judged(odd, noise=0.01)
    assert found.verdict == 'agree'
    dark, black = found.lights[-2:]
    assert dark.verdict == 'agree'
    assert dark.scale_in_witness == pytest.approx(1.0, abs=5e-3)
    assert np.isnan(black.scale_in_witness)
    assert judged(odd, scaled(odd, 'Dark', 1.1), 0.01).lights[-2].verdict == 'differ'


def test_two_seeds_decide_little_but_never_crash():
    found = Counter(judged(room(), noise=0.06, count=2, seed=seed).verdict for seed in range(30))
    assert found['differ'] == 0
    assert found['undecided'] > 20


def test_seeds_without_noise_are_certain_only_to_rounding():
    layers = room()
    film = film_of(layers)
    same = np.stack([film.radiance] * 4)
    found = judge(film, same, lights=infos(layers))
    assert found.verdict == 'agree'
    assert all(light.standard_error >= 1e-5 for light in found.lights)
    assert (found.pixels.agree, found.pixels.undecided) == (H * W, 0)
    rounded = judge(film, same * (1.0 + 2e-6), lights=infos(layers), tolerance=1e-6)
    assert rounded.verdict == 'undecided'
    off = judge(film, same * 1.06, lights=infos(layers))
    assert off.verdict == 'differ'
    assert off.pixels.differ == H * W


def test_noise_of_our_own_counts_and_is_named_as_what_to_buy():
    rng, layers = np.random.default_rng(13), {'Sky': room()['Sky']}
    relative = 2.0
    mean, drawn = layers['Sky'] * relative * rng.normal(size=(2, H, W, 3))
    film = film_of({'Sky': layers['Sky'] + mean}, (relative * layers['Sky']) ** 2, {'Sky': drawn})
    found = judged(layers, noise=0.01, film=film)
    assert found.verdict == 'undecided'
    assert found.our_noise_share > 0.9
    assert found.needed_factor > 1.25


def test_later_rounds_ask_for_more_evidence():
    early, late = (
        [judged(room(), seed=seed, round_index=index).verdict for seed in range(12)]
        for index in (0, 9)
    )
    assert early.count('agree') > late.count('agree')


def test_partly_covered_tiles_are_pooled_and_slivers_are_left_to_the_frame():
    layers, other = ({'Sky': room()['Sky']} for _ in range(2))
    other['Sky'][:3, :4] *= 1.5
    for rows, columns, expected in [(3, 5, 'agree'), (3, 6, 'differ')]:
        out = np.zeros((H, W), bool)
        out[:16, :16] = True
        out[:rows, :columns] = False
        film = film_of(layers, excluded=out)
        assert judged(layers, other, 0.01, film=film, tolerance=0.02).verdict == expected


def test_pixels_that_are_not_finite_are_left_out_with_a_finding():
    rng, layers = np.random.default_rng(16), room()
    seeds = Witness(layers, 0.01).seeds(rng)
    seeds[3, 5, 7, 1] = np.nan
    seeds[2, 9, 9, 0] = np.inf
    found = judge(film_of(layers), seeds, lights=infos(layers))
    assert found.verdict == 'agree'
    assert [f.code for f in found.findings] == ['not-finite']
    assert found.pixels.excluded == 2


def test_wrong_input_is_said_in_one_line():
    layers = room()
    with pytest.raises(RadError, match="at least 2"):
        judge(film_of(layers), np.zeros((1, H, W, 3)), lights=infos(layers))
    with pytest.raises(RadError, match=r"shape \(4, 4, 3\)"):
        judge(film_of(layers), np.zeros((2, 4, 4, 3)), lights=infos(layers))
    with pytest.raises(RadError, match="at least 1"):
        judge_pictures(film_of(layers), np.zeros((0, H, W, 3)), lights=infos(layers))


@pytest.mark.parametrize('count', [1, 4])
def test_pictures_that_exist_are_judged_by_their_own_noise(count):
    rng, layers, repeats = np.random.default_rng(18), room(), 25
    film = film_of(layers)
    seen = Counter()
    for _ in range(repeats):
        pictures = Witness(layers, 0.005, tail=0.2).seeds(rng, count)
        seen[judge_pictures(film, pictures, lights=infos(layers)).verdict] += 1
    assert seen['differ'] == 0
    assert seen['agree'] == 0 if count == 1 else seen['agree'] > repeats // 2
    off = Witness(scaled(layers, 'Key', 1.05), 0.02).seeds(rng, count)
    found = judge_pictures(film, off, lights=infos(layers))
    assert found.verdict == 'differ'
    assert found.lights[0].scale_in_witness == pytest.approx(1.05, abs=0.01)
    assert found.lights[0].diagnosis == 'scale'


def test_copies_of_one_picture_are_one_picture():
    rng, layers = np.random.default_rng(19), room()
    pictures = np.repeat(Witness(layers, 0.001).seeds(rng, 1), 5, axis=0)
    found = judge_pictures(film_of(layers), pictures, lights=infos(layers))
    assert found.verdict == 'undecided'
    assert found.needed_factor is None


def test_pictures_whose_pixels_err_together_are_no_better_than_seeds():
    rng, layers = np.random.default_rng(20), room()
    seen = Counter()
    for _ in range(15):
        shared = 1.0 + 0.01 * rng.normal(size=(4, 1, 1, 1))
        pictures = Witness(layers, 0.005).seeds(rng, 4) * shared
        seen[judge_pictures(film_of(layers), pictures, lights=infos(layers)).verdict] += 1
    assert seen == {'undecided': 15}


def test_pictures_smaller_than_a_tile_are_judged_by_frame_and_lights():
    layers = {'All': sum(room().values())[18:21, 18:21]}
    seeds = layers['All'] * (1.0 + 1e-3 * np.random.default_rng(21).normal(size=(8, 3, 3, 1)))
    assert judge(film_of(layers), seeds, lights=infos(layers)).verdict == 'agree'
    found = judge(film_of(layers), 0.5 * seeds, lights=infos(layers))
    assert found.verdict == 'differ'
    assert found.lights[0].diagnosis == 'scale'


def test_a_picture_of_directly_seen_light_alone_is_judged_by_frame_and_tiles():
    layers = {'Sky': room()['Sky']}
    film = replace(film_of(layers), lights={}, seen=layers['Sky'])
    assert judged({}, layers, 0.01, film=film).verdict == 'agree'
    found = judged({}, scaled(layers, 'Sky', 1.1), 0.01, film=film)
    assert found.verdict == 'differ'
    assert 'tiles-differ' in {f.code for f in found.findings}


def test_lights_that_the_budget_cannot_tell_apart_are_judged_together():
    alone, grouped = (judged(room(), noise=0.15, budget=budget) for budget in (100.0, 1.0))
    assert (alone.verdict, grouped.verdict) == ('undecided', 'agree')
    assert not any(light.group for light in alone.lights)
    assert any(light.group for light in grouped.lights)
