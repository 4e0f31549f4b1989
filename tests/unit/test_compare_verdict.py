# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict: how often it errs, how often it finds, and what it does at the edges."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from blender_rad.compare import LightInfo, judge, judge_pictures
from blender_rad.errors import RadError
from tests.unit.compare_simulation import H, W, Witness, film_of, judged, layer, room, scaled

QUIET, LOUD = 0.024, 0.06
ALPHA = 0.01
MORE = pytest.mark.parametrize('repeats', [40, pytest.param(600, marks=pytest.mark.nightly)])


def rows(layers):
    return [LightInfo(name, 'POINT', 1) for name in layers]


def verdicts(layers, witness, repeats, judge=judge, count=8, **options):
    rng, film = np.random.default_rng(1), film_of(layers)
    seeds = (witness.seeds(rng, count) for _ in range(repeats))
    return Counter(judge(film, s, lights=rows(layers), **options).verdict for s in seeds)


def codes(found):
    return [finding.code for finding in found.findings]


def with_tile(layers, factor, row=0, column=2):
    spot = np.ones((H, W, 1))
    spot[16 * row : 16 * row + 16, 16 * column : 16 * column + 16] = factor
    return {n: v * spot for n, v in layers.items()}


ROOM, SKY = room(), {'Sky': room()['Sky']}


@MORE
@pytest.mark.parametrize(
    ('layers', 'witness', 'never', 'tolerance'),
    [
        (ROOM, Witness(ROOM), ['differ'], 1e-4),
        (ROOM, Witness(ROOM, tail=0.4), ['differ'], 1e-4),
        (ROOM, Witness(scaled(ROOM, 1.01, 'Key'), QUIET, 0.3), ['differ', 'agree'], 0.01),
        (ROOM, Witness(scaled(ROOM, 0.99, 'Fill'), QUIET, 0.3), ['differ', 'agree'], 0.01),
        (ROOM, Witness(scaled(ROOM, 1.01, 'Small'), QUIET, 0.3), ['differ', 'agree'], 0.01),
        # one dim tile: what it does to the light's factor stays well inside its tolerance
        (SKY, Witness(with_tile(SKY, 1.05), 0.2, 0.3), ['differ', 'agree'], 0.01),
        (SKY, Witness(with_tile(SKY, 0.95), 0.2, 0.3), ['differ', 'agree'], 0.01),
    ],
    ids=['equal', 'fireflies', 'Key', 'Fill', 'Small', 'bright tile', 'dark tile'],
)
def test_equal_scenes_and_those_at_the_very_tolerance(layers, witness, never, tolerance, repeats):
    found = verdicts(layers, witness, repeats, tolerance=tolerance)
    at_most = ALPHA * repeats + 3.0 * np.sqrt(ALPHA * (1.0 - ALPHA) * repeats)
    assert all(found[verdict] <= at_most for verdict in never), found


@pytest.mark.parametrize(
    ('factor', 'verdict', 'repeats', 'seeds'), [(1.02, 'differ', 15, 32), (1.0, 'agree', 10, 16)]
)
def test_buying_decides(factor, verdict, repeats, seeds):
    """Twice the tolerance on a light of over 1 % is always found, and equal scenes agree."""
    assert 0.01 < ROOM['Small'].sum() / sum(ROOM.values()).sum() < 0.02
    rng, film, witness = np.random.default_rng(4), film_of(ROOM), Witness(ROOM, QUIET)
    witness.layers, bought = scaled(ROOM, factor, 'Small'), []
    for _ in range(repeats):
        pictures, index = witness.seeds(rng), 0
        found = judge(film, pictures, lights=rows(ROOM))
        while found.verdict == 'undecided' and index < 4:
            more = int(np.ceil(len(pictures) * (min(found.needed_factor, 8.0) - 1.0)))
            pictures, index = np.concatenate([pictures, witness.seeds(rng, more)]), index + 1
            found = judge(film, pictures, lights=rows(ROOM), round_index=index)
        assert found.verdict == found.lights[3].verdict == verdict
        bought.append(len(pictures))
    assert np.median(bought) <= seeds


def test_a_tile_ten_percent_off_differs_and_the_lights_are_cleared():
    found = judged(ROOM, with_tile(ROOM, 1.10), count=16)
    assert found.verdict == 'differ'
    assert set(codes(found)) == {'tiles-differ', 'extra-light'}
    assert '(32, 0)' in found.findings[-1].message
    assert all(light.verdict != 'differ' for light in found.lights)


def test_a_shift_of_colour_alone_differs():
    weights = np.array([0.2126390, 0.7151687, 0.0721923])
    shift = np.array([1.03, 1.0 - 0.03 * weights[0] / (weights[1] * 0.9), 1.0])
    other = {**ROOM, 'Key': ROOM['Key'] * shift}
    assert (other['Key'] @ weights).sum() == pytest.approx((ROOM['Key'] @ weights).sum())
    found = judged(ROOM, other)
    assert (found.verdict, found.lights[0].diagnosis) == ('differ', 'colour')
    assert [light.verdict for light in found.lights[1:3]] == ['agree', 'agree']


def test_coincident_lights_are_one_group_with_one_factor():
    twins = {**ROOM, 'Twin': 0.5 * ROOM['Key']}
    found = judged(twins, scaled(twins, 1.3, 'Twin'))
    key, twin = found.lights[0], found.lights[-1]
    assert key.scale_in_witness == twin.scale_in_witness == pytest.approx(1.1, abs=2e-3)
    assert [light.group for light in found.lights] == ['Key + Twin', *[None] * 3, 'Key + Twin']
    assert found.verdict == twin.verdict == 'differ'


def test_an_excluded_half_is_left_out_and_more_than_half_is_undecided():
    wrong, out = SKY['Sky'].copy(), np.zeros((H, W), bool)
    wrong[:, : W // 2 - 3] *= 3.0
    out[:, : W // 2 - 3] = True
    found = judged(SKY, {'Sky': wrong}, 0.01, film=film_of(SKY, excluded=out))
    assert found.verdict == 'agree'
    assert (found.pixels.excluded, found.pixels.compared) == (out.sum(), (~out).sum())
    out[:, : W // 2 + 3] = True
    found = judged(SKY, {'Sky': wrong}, 0.01, film=film_of(SKY, excluded=out))
    assert (found.verdict, codes(found)) == ('undecided', ['coverage-low'])
    assert found.needed_factor is None


@pytest.mark.parametrize(
    'film',
    [
        film_of(SKY, excluded=np.ones((H, W), bool)),
        film_of(scaled(SKY, 0.0)),
        film_of(scaled(SKY, 0.0), lights={}),
    ],
    ids=['all excluded', 'all black', 'no lights'],
)
def test_nothing_to_compare_is_undecided(film):
    found = judge(film, np.stack([film.radiance] * 3), lights=rows(['Sky', 'Off']))
    assert (found.verdict, codes(found)) == ('undecided', ['nothing-compared'])
    assert [light.name for light in found.lights][:2] == ['Sky', 'Off']
    assert json.loads(json.dumps(found.to_json()))['lights'][1]['scale_in_witness'] is None


def test_lights_of_shadow_alone_black_ones_and_negative_ones_are_judged_or_left():
    dark = -0.3 * layer(40.0, 10.0, (1.0, 1.0, 1.0))
    odd = {**ROOM, 'Dark': dark, 'Black': 0 * dark}
    found = judged(odd, noise=0.01)
    dark, black = found.lights[-2:]
    assert found.verdict == dark.verdict == 'agree'
    assert dark.scale_in_witness == pytest.approx(1.0, abs=5e-3)
    assert np.isnan(black.scale_in_witness)
    assert judged(odd, scaled(odd, 1.1, 'Dark'), 0.01).lights[-2].verdict == 'differ'


def test_two_seeds_decide_little_and_later_rounds_ask_for_more_evidence():
    found = verdicts(ROOM, Witness(ROOM, LOUD), 30, count=2)
    assert found['differ'] == 0 and found['undecided'] > 20
    early, late = (verdicts(ROOM, Witness(ROOM, QUIET), 12, round_index=k) for k in (0, 9))
    assert early['agree'] > late['agree']


def test_seeds_without_noise_are_certain_only_to_rounding():
    film, lights = film_of(ROOM), rows(ROOM)
    same = np.stack([film.radiance] * 4)
    found = judge(film, same, lights=lights)
    assert found.verdict == 'agree'
    assert all(light.standard_error >= 1e-5 for light in found.lights)
    assert (found.pixels.agree, found.pixels.undecided) == (H * W, 0)
    rounded = judge(film, same * (1.0 + 2e-6), lights=lights, tolerance=1e-6)
    assert rounded.verdict == 'undecided'
    off = judge(film, same * 1.06, lights=lights)
    assert (off.verdict, off.pixels.differ) == ('differ', H * W)


@pytest.mark.parametrize(('columns', 'expected'), [(5, 'agree'), (6, 'differ')])
def test_partly_covered_tiles_are_pooled_and_slivers_are_left_to_the_frame(columns, expected):
    """Of 15 pixels of a tile, and of 18."""
    other, out = SKY['Sky'].copy(), np.zeros((H, W), bool)
    other[:3, :4] *= 1.5
    out[:16, :16] = True
    out[:3, :columns] = False
    found = judged(SKY, {'Sky': other}, 0.01, film=film_of(SKY, excluded=out), tolerance=0.02)
    assert found.verdict == expected


def test_pixels_that_are_not_finite_are_left_out_with_a_finding():
    seeds = Witness(ROOM, 0.01).seeds(np.random.default_rng(16))
    seeds[3, 5, 7, 1], seeds[2, 9, 9, 0] = np.nan, np.inf
    found = judge(film_of(ROOM), seeds, lights=rows(ROOM))
    assert (found.verdict, codes(found), found.pixels.excluded) == ('agree', ['not-finite'], 2)


@pytest.mark.parametrize(
    ('judge', 'shape', 'said'),
    [
        (judge, (1, H, W, 3), "at least 2"),
        (judge, (2, 4, 4, 3), r"shape \(4, 4, 3\)"),
        (judge_pictures, (0, H, W, 3), "at least 1"),
    ],
)
def test_wrong_input_is_said_in_one_line(judge, shape, said):
    with pytest.raises(RadError, match=said):
        judge(film_of(ROOM), np.zeros(shape), lights=rows(ROOM))


@pytest.mark.parametrize('count', [1, 4])
def test_pictures_that_exist_are_judged_by_their_own_noise(count):
    repeats = 20
    seen = verdicts(ROOM, Witness(ROOM, 0.005, 0.2), repeats, judge_pictures, count)
    assert seen['differ'] == 0
    assert seen['agree'] == 0 if count == 1 else seen['agree'] > repeats // 2
    off = Witness(scaled(ROOM, 1.05, 'Key'), 0.02).seeds(np.random.default_rng(18), count)
    found = judge_pictures(film_of(ROOM), off, lights=rows(ROOM))
    key = found.lights[0]
    assert (found.verdict, key.diagnosis) == ('differ', 'scale')
    assert key.scale_in_witness == pytest.approx(1.05, abs=0.01)


def test_copies_of_one_picture_are_one_picture():
    pictures = np.repeat(Witness(ROOM, 0.001).seeds(np.random.default_rng(19), 1), 5, axis=0)
    found = judge_pictures(film_of(ROOM), pictures, lights=rows(ROOM))
    assert (found.verdict, found.needed_factor) == ('undecided', None)


def test_pictures_whose_pixels_err_together_are_no_better_than_seeds():
    class Together(Witness):
        def seeds(self, rng, count):
            return super().seeds(rng, count) * (1.0 + 0.01 * rng.normal(size=(count, 1, 1, 1)))

    assert verdicts(ROOM, Together(ROOM, 0.005), 10, judge_pictures, 4) == {'undecided': 10}


def test_pictures_smaller_than_a_tile_are_judged_by_frame_and_lights():
    layers = {'All': sum(ROOM.values())[18:21, 18:21]}
    seeds = layers['All'] * (1.0 + 1e-3 * np.random.default_rng(21).normal(size=(8, 3, 3, 1)))
    assert judge(film_of(layers), seeds, lights=rows(layers)).verdict == 'agree'
    found = judge(film_of(layers), 0.5 * seeds, lights=rows(layers))
    assert (found.verdict, found.lights[0].diagnosis) == ('differ', 'scale')


def test_a_picture_of_directly_seen_light_alone_is_judged_by_frame_and_tiles():
    film = replace(film_of(SKY), lights={}, seen=SKY['Sky'])
    assert judged({}, SKY, 0.01, film=film).verdict == 'agree'
    found = judged({}, scaled(SKY, 1.1), 0.01, film=film)
    assert found.verdict == 'differ' and 'tiles-differ' in codes(found)


def test_lights_that_the_budget_cannot_tell_apart_are_judged_together():
    alone, grouped = (judged(ROOM, noise=0.15, budget=budget) for budget in (100.0, 1.0))
    assert (alone.verdict, grouped.verdict) == ('undecided', 'agree')
    assert not any(light.group for light in alone.lights)
    assert any(light.group for light in grouped.lights)
