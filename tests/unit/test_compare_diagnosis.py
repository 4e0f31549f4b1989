# SPDX-License-Identifier: GPL-3.0-or-later
"""Causes are named, innocents are cleared, and what no light explains is said to be so."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blender_rad.compare import LightInfo, judge
from blender_rad.compare.diagnosis import CAUSES, match_factor
from tests.unit.compare_simulation import H, W, Witness, film_of, layer, room

NOISE = 0.012
TYPES = {'Key': 'AREA', 'Fill': 'POINT', 'Sky': 'WORLD', 'Small': 'SPOT'}


def look(witness, *, seen=0.0, lights=None, seed=1, **clues):
    layers = room()
    film = film_of(layers)
    film = film_of(layers, radiance=film.radiance + seen, seen=film.seen + seen)
    rows = lights or [LightInfo(name, type_, 1) for name, type_ in TYPES.items()]
    seeds = Witness(witness, NOISE).seeds(np.random.default_rng(seed))
    return judge(film, seeds, lights=rows, **clues)


def names(found):
    return {light.name: light.diagnosis for light in found.lights if light.diagnosis}


@pytest.mark.parametrize(
    ('name', 'factor', 'cause'),
    [
        ('Small', 0.0, 'hidden'),
        ('Sky', 0.0, 'hidden'),
        ('Key', math.pi / 4, 'area-four-over-pi'),
        ('Key', 4 / math.pi, 'area-four-over-pi'),
        ('Sky', 4 / math.pi, 'scale'),
        ('Fill', 683.002 / 177.83, 'efficacy-cycles-ies'),
        ('Fill', 179 / 683.002, 'efficacy-radiance'),
        ('Sky', math.pi, 'pi'),
        ('Fill', 4 * math.pi, 'four-pi'),
        ('Key', 0.9, 'scale'),
    ],
)
def test_one_light_off_by_a_number_is_named_and_no_other(name, factor, cause):
    layers = room()
    found = look({**layers, name: factor * layers[name]})
    assert found.verdict == 'differ'
    assert names(found) == {name: cause}
    finding = next(f for f in found.findings if f.code == cause)
    assert finding.object == name
    light = next(light for light in found.lights if light.name == name)
    reach = 4.0 * light.standard_error
    assert finding.effect_percent == pytest.approx(100.0 * (factor - 1.0), abs=100.0 * reach)


@pytest.mark.parametrize('seed', range(3))
def test_noise_of_our_own_is_no_structure(seed):
    rng, layers, relative = np.random.default_rng(seed), room(), 0.1
    noise = {n: relative * v * rng.normal(size=(2, H, W, 1)) for n, v in layers.items()}
    film = film_of(
        {n: v + noise[n][0] for n, v in layers.items()},
        sum((relative * v) ** 2 for v in layers.values()),
        {n: drawn for n, (_, drawn) in noise.items()},
    )
    seeds = Witness({**layers, 'Key': 0.9 * layers['Key']}, NOISE).seeds(rng)
    found = judge(film, seeds, lights=[LightInfo(name, type_) for name, type_ in TYPES.items()])
    assert names(found) == {'Key': 'scale'}
    assert {f.code for f in found.findings} == {'scale', 'tiles-differ'}


def test_unit_scale_squared_on_what_falls_off():
    layers, scale = room(), 0.1
    off = {n: v * (1.0 if n == 'Sky' else scale**2) for n, v in layers.items()}
    found = look(off, unit_scale_m=scale)
    assert names(found) == dict.fromkeys(['Key', 'Fill', 'Small'], 'unit-scale')
    assert names(look(off)) == dict.fromkeys(['Key', 'Fill', 'Small'], 'scale')


def test_one_factor_on_everything_is_film_exposure():
    layers = room()
    twice = {n: 2.0 * v for n, v in layers.items()}
    found = look(twice)
    assert set(names(found).values()) == {'film-exposure'}
    assert [f.code for f in found.findings] == ['film-exposure', 'tiles-differ']
    assert 'film-exposure' in names(look(twice, film_exposure=2.0)).values()
    assert set(names(look(twice, film_exposure=1.5)).values()) == {'scale'}


def test_film_exposure_scales_what_the_camera_sees_too():
    layers = room()
    seen = np.zeros((H, W, 3))
    seen[:6, :10] = 5.0
    exposed = {**{n: 2.0 * v for n, v in layers.items()}, 'seen': 2.0 * seen}
    assert set(names(look(exposed, seen=seen)).values()) == {'film-exposure'}
    brighter = {**{n: 2.0 * v for n, v in layers.items()}, 'seen': seen}
    assert set(names(look(brighter, seen=seen)).values()) == {'scale'}


def soft_key():
    row, column = np.indices((H, W))
    square = 174.0 + (column - 20.0) ** 2 + (row - 20.0) ** 2
    return (12.0**3 / square**1.5)[..., None] * np.array([1.0, 0.9, 0.8])


def test_a_shape_that_the_caller_predicts_is_named_and_the_others_are_cleared():
    layers, soft = room(), soft_key()
    found = look({**layers, 'Key': soft}, alternatives={'Key': {'soft-falloff': soft}})
    assert names(found) == {'Key': 'soft-falloff'}
    assert [light.verdict for light in found.lights[1:3]] == ['agree', 'agree']
    expected = soft.sum() / layers['Key'].sum()
    assert found.lights[0].scale_in_witness == pytest.approx(expected, abs=2e-3)
    finding = next(f for f in found.findings if f.code == 'soft-falloff')
    assert finding.effect_percent == pytest.approx(100.0 * (expected - 1.0), abs=1e-3)


def test_a_shape_is_not_named_when_it_is_not_the_cause():
    layers, soft = room(), soft_key()
    clue = {'Key': {'soft-falloff': soft}}
    darker, hidden = {'Key': 0.9 * layers['Key']}, {'Fill': 0.0 * layers['Fill']}
    assert names(look({**layers, **darker}, alternatives=clue)) == {'Key': 'scale'}
    assert names(look({**layers, **hidden}, alternatives=clue)) == {'Fill': 'hidden'}
    assert look(layers, alternatives=clue).verdict != 'differ'


def test_an_alternative_that_only_scales_is_told_by_its_factor():
    layers = room()
    darker = {'Key': {'soft-falloff': 0.978 * layers['Key']}}
    found = look({**layers, 'Key': 0.978 * layers['Key']}, alternatives=darker)
    assert names(found) == {'Key': 'soft-falloff'}
    found = look({**layers, 'Key': 0.95 * layers['Key']}, alternatives=darker)
    assert names(found) == {'Key': 'scale'}


def test_two_causes_at_once_are_both_named():
    layers, soft = room(), soft_key()
    both = {**layers, 'Key': soft, 'Fill': 0.0 * layers['Fill']}
    found = look(both, alternatives={'Key': {'soft-falloff': soft}})
    assert names(found) == {'Key': 'soft-falloff', 'Fill': 'hidden'}


def test_light_that_none_of_ours_explains_is_found_and_accuses_no_light():
    layers = room()
    found = look({**layers, 'New': layer(60.0, 5.0, (0.02, 0.02, 0.02))})
    assert found.verdict == 'differ'
    assert 'extra-light' in {f.code for f in found.findings}
    assert names(found) == {}


def test_a_shape_that_nothing_predicts_accuses_no_light():
    found = look({**room(), 'Key': soft_key()})
    assert found.verdict == 'differ'
    assert {'extra-shadow', 'unexplained'} & {f.code for f in found.findings}
    assert names(found) == {}


def test_a_group_of_mixed_types_has_only_signatures_that_all_of_them_can_have():
    layers = {**room(), 'Twin': room()['Key']}
    rows = [*(LightInfo(name, type_) for name, type_ in TYPES.items()), LightInfo('Twin', 'SPOT')]
    for factor, cause in [(0.0, 'hidden'), (math.pi / 4, 'scale')]:
        off = {n: v * (factor if n in {'Key', 'Twin'} else 1.0) for n, v in layers.items()}
        seeds = Witness(off, NOISE).seeds(np.random.default_rng(3))
        found = judge(film_of(layers), seeds, lights=rows)
        assert names(found) == {'Key': cause, 'Twin': cause}


def test_a_factor_that_several_causes_explain_lists_them():
    found = look({**room(), 'Fill': 0.0 * room()['Fill']}, unit_scale_m=0.01)
    assert names(found) == {'Fill': 'scale'}
    message = next(f for f in found.findings if f.code == 'scale').message
    assert message.startswith("one of hidden, unit-scale;")


def codes(factor, error, type_, scale):
    return [cause.code for cause, _ in match_factor(factor, error, {type_}, scale)]


def test_factors_must_be_near_and_certain_and_hit_the_right_type():
    assert codes(math.pi / 4, 1e-3, 'AREA', 1.0) == ['area-four-over-pi']
    assert codes(math.pi / 4, 1e-3, 'SPOT', 1.0) == []
    assert codes(math.pi / 4 + 0.01, 1e-3, 'AREA', 1.0) == []
    assert codes(math.pi / 4, 0.1, 'AREA', 1.0) == []
    assert codes(3.83, 0.02, 'POINT', 1.0) == ['efficacy-cycles-ies', 'efficacy-radiance']
    assert codes(1.0, 1e-4, 'POINT', 1.0) == []  # a unit scale of 1 explains nothing


def test_every_cause_can_be_told_from_every_other():
    for cause in CAUSES:
        for value in cause.factors(0.1):
            type_ = (cause.types or 'SUN').split()[0]
            assert codes(value, 1e-4 * max(value, 1.0), type_, 0.1) == [cause.code]
