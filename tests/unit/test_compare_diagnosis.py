# SPDX-License-Identifier: GPL-3.0-or-later
"""Causes are named, innocents are cleared, and what no light explains is said to be so."""

import math

import numpy as np
import pytest

from blender_rad.compare.diagnosis import CAUSES, match_factor
from tests.unit.compare_simulation import H, W, film_of, judged, layer, room, scaled

NOISE = 0.012
TYPES = {'Key': 'AREA', 'Fill': 'POINT', 'Sky': 'WORLD', 'Small': 'SPOT'}
ROOM = room()


def soft_key():
    row, column = np.indices((H, W))
    square = 174.0 + (column - 20.0) ** 2 + (row - 20.0) ** 2
    return (12.0**3 / square**1.5)[..., None] * np.array([1.0, 0.9, 0.8])


SOFT = soft_key()
CLUE = {'Key': {'soft-falloff': SOFT}}
DIMMED = {'Key': {'soft-falloff': 0.978 * ROOM['Key']}}
LOCAL = [light for light in ROOM if light != 'Sky']


def look(witness, *, seen=0.0, **clues):
    film = film_of(ROOM)
    film = film_of(ROOM, radiance=film.radiance + seen, seen=film.seen + seen)
    return judged(ROOM, {**ROOM, **witness}, NOISE, film=film, types=TYPES, **clues)


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
    found = look({name: factor * ROOM[name]})
    assert found.verdict == 'differ'
    assert names(found) == {name: cause}
    finding = next(f for f in found.findings if f.code == cause)
    (error,) = [light.standard_error for light in found.lights if light.name == name]
    assert finding.object == name
    assert finding.effect_percent == pytest.approx(100.0 * (factor - 1.0), abs=400.0 * error)


@pytest.mark.parametrize('seed', range(3))
def test_noise_of_our_own_is_no_structure(seed):
    rng = np.random.default_rng(seed)
    noise = {n: 0.1 * v * rng.normal(size=(2, H, W, 1)) for n, v in ROOM.items()}
    film = film_of(
        {n: v + noise[n][0] for n, v in ROOM.items()},
        sum((0.1 * v) ** 2 for v in ROOM.values()),
        {n: drawn for n, (_, drawn) in noise.items()},
    )
    found = judged(ROOM, scaled(ROOM, 0.9, 'Key'), NOISE, film=film, types=TYPES, seed=seed + 9)
    assert names(found) == {'Key': 'scale'}
    assert {f.code for f in found.findings} == {'scale', 'tiles-differ'}


TWICE, BRIGHT = scaled(ROOM, 2.0), np.pad(np.full((6, 10, 3), 5.0), ((0, 42), (0, 54), (0, 0)))


@pytest.mark.parametrize(
    ('witness', 'clues', 'named'),
    [
        (scaled(ROOM, 0.01, *LOCAL), {'unit_scale_m': 0.1}, dict.fromkeys(LOCAL, 'unit-scale')),
        (scaled(ROOM, 0.01, *LOCAL), {}, dict.fromkeys(LOCAL, 'scale')),
        (TWICE, {}, 'film-exposure'),
        (TWICE, {'film_exposure': 2.0}, 'film-exposure'),
        (TWICE, {'film_exposure': 1.5}, 'scale'),
        # what the camera sees of lights is exposed as well
        (TWICE | {'seen': 2.0 * BRIGHT}, {'seen': BRIGHT}, 'film-exposure'),
        (TWICE | {'seen': BRIGHT}, {'seen': BRIGHT}, 'scale'),
        # a shape that the caller predicts, where it is the cause and where it is not
        ({'Key': SOFT}, {'alternatives': CLUE}, {'Key': 'soft-falloff'}),
        ({'Key': 0.9 * ROOM['Key']}, {'alternatives': CLUE}, {'Key': 'scale'}),
        ({'Fill': 0.0 * ROOM['Fill']}, {'alternatives': CLUE}, {'Fill': 'hidden'}),
        ({}, {'alternatives': CLUE}, {}),
        # one that only scales is told by its factor
        ({'Key': 0.978 * ROOM['Key']}, {'alternatives': DIMMED}, {'Key': 'soft-falloff'}),
        ({'Key': 0.95 * ROOM['Key']}, {'alternatives': DIMMED}, {'Key': 'scale'}),
        (
            {'Key': SOFT, 'Fill': 0.0 * ROOM['Fill']},
            {'alternatives': CLUE},
            {'Key': 'soft-falloff', 'Fill': 'hidden'},
        ),
    ],
)
def test_causes_are_told_apart(witness, clues, named):
    found = look(witness, **clues)
    expected = named if isinstance(named, dict) else dict.fromkeys(names(found), named)
    assert names(found) == expected
    assert (found.verdict == 'differ') == bool(named) == bool(names(found))
    if named == 'film-exposure':
        assert [f.code for f in found.findings] == ['film-exposure', 'tiles-differ']


def test_a_shape_has_the_energy_that_it_predicts_and_the_others_are_cleared():
    found = look({'Key': SOFT}, alternatives=CLUE)
    assert [light.verdict for light in found.lights[1:3]] == ['agree', 'agree']
    expected = SOFT.sum() / ROOM['Key'].sum()
    assert found.lights[0].scale_in_witness == pytest.approx(expected, abs=2e-3)
    finding = next(f for f in found.findings if f.code == 'soft-falloff')
    assert finding.effect_percent == pytest.approx(100.0 * (expected - 1.0), abs=1e-3)


@pytest.mark.parametrize(
    ('witness', 'codes'),
    [
        ({'New': layer(60.0, 5.0, (0.02, 0.02, 0.02))}, {'extra-light'}),
        ({'Key': SOFT}, {'extra-shadow', 'unexplained'}),
    ],
)
def test_what_nothing_predicts_accuses_no_light(witness, codes):
    found = look(witness)
    assert found.verdict == 'differ' and names(found) == {}
    assert codes & {f.code for f in found.findings}


@pytest.mark.parametrize(('factor', 'cause'), [(0.0, 'hidden'), (math.pi / 4, 'scale')])
def test_a_group_of_mixed_types_has_only_signatures_that_all_of_them_can_have(factor, cause):
    layers = {**ROOM, 'Twin': ROOM['Key']}
    off, types = scaled(layers, factor, 'Key', 'Twin'), {**TYPES, 'Twin': 'SPOT'}
    found = judged(layers, off, NOISE, types=types, seed=3)
    assert names(found) == {'Key': cause, 'Twin': cause}


def test_a_factor_that_several_causes_explain_lists_them():
    found = look({'Fill': 0.0 * ROOM['Fill']}, unit_scale_m=0.01)
    assert names(found) == {'Fill': 'scale'}
    message = next(f for f in found.findings if f.code == 'scale').message
    assert message.startswith("one of hidden, unit-scale;")


def test_factors_must_be_near_and_certain_and_hit_the_right_type():
    def codes(factor, error, type_, scale=1.0):
        return [cause.code for cause, _ in match_factor(factor, error, {type_}, scale)]

    assert codes(math.pi / 4 + 0.01, 1e-3, 'AREA') == []
    assert codes(math.pi / 4, 0.1, 'AREA') == []
    assert codes(3.83, 0.02, 'POINT') == ['efficacy-cycles-ies', 'efficacy-radiance']
    assert codes(1.0, 1e-4, 'POINT') == []  # a unit scale of 1 explains nothing
    for cause in CAUSES:
        for value in cause.factors(0.1):
            type_ = (cause.types or 'SUN').split()[0]
            assert codes(value, 1e-4 * max(value, 1.0), type_, 0.1) == [cause.code]
