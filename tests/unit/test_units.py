# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversions: known answers, the lights' own light, inverses, what is refused; and the verb."""

import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import blender_rad
from blender_rad import cli
from blender_rad.errors import RadError
from blender_rad.lights.area import AreaLight
from blender_rad.lights.point import PointLight
from blender_rad.lights.spot import SpotLight
from blender_rad.lights.sun import SunLight
from blender_rad.lights.world import WorldLight
from blender_rad.quantities import UNITS, ev100
from blender_rad.spectra import spectrum
from blender_rad.units import EMITTERS, convert

EXACT = 1e-12  # rounding of a dozen factors


KNOWN = [
    (100, "lm lx", "point", {"distance": 1.0}, 7.957747),
    (1000, "cd lx", None, {"distance": 3.0}, 1000 / 9),  # CIE 171, case 5.2
    (10_000, "lm lx", None, {"area": 20.0}, 500.0),
    (1, "cd/m2 lm", "sphere", {"radius": 0.5}, math.pi**2),
    (1, "cd/m2 lm", "mesh", {"area": 2.0}, 4 * math.pi),
    (100, "lm cd", "spot", {"cone": math.pi / 3}, 118.794884),  # 100/(2π (1 − cos 30°))
    (10_000, "cd/m2 lx", "sky", {}, 31415.9265359),
    (1361, "W/m2 W/m2/sr", "sun", {"angle": math.radians(0.533)}, 2.002452e7),
    (60, "W J", None, {"duration": 60.0}, 3600.0),
    (3600, "J W/sr", "point", {"duration": 60.0}, 60 / (4 * math.pi)),
    (1, "fc lx", None, {}, 10.7639104),
    (1, "fl nit", None, {}, 3.4262591),
    (0, "EV100 cd/m2", None, {}, 0.125),
    (1, "µmol/s photons/s", None, {}, 6.02214076e17),
]


@pytest.mark.parametrize(("value", "units", "emitter", "shape", "expected"), KNOWN)
def test_known_answers(value, units, emitter, shape, expected):
    result = convert(value, *units.split(), emitter=emitter, shape=shape)
    assert result.value == pytest.approx(expected, rel=1e-6)
    assert "=" in result.formula
    assert result.efficacy_lm_W is None


@pytest.mark.parametrize(
    ("units", "name", "expected"),
    [
        ("W lm", "laser:555", 683.002),
        ("W photons/s", "laser:550", 2.76876e18),
        ("W umol/s", "laser:660", 5.5171),
        ("W umol/s", "laser:730", 0.0),  # the eye's red, but nothing that PPF counts
    ],
)
def test_through_a_spectrum_and_a_convention(units, name, expected):
    result = convert(1, *units.split(), light=spectrum(name))
    assert result.value == pytest.approx(expected, rel=1e-4)
    assert name in result.formula
    formula = "X_v = K X_e, K = 179 lm/W by convention"
    assert convert(1, "W", "lm", light=179.0) == (179.0, 179.0, formula)


UP = np.array([[0.0, 0.0, 1.0]])
ROOT = dict[str, Any](name="light", rgb=np.ones(3))
BALL = dict[str, Any](**ROOT, position=np.zeros(3), radius=0.1)
SPOT = dict[str, Any](light_from_world=np.eye(3), cos_half_angle=math.cos(0.5), blend=0.4)
DISC = dict[str, Any](**ROOT, center=np.zeros(3), direction=-UP[0], ellipse=True, series=False)
DISC |= dict(zip(("axis_u", "axis_v"), np.eye(3) / math.sqrt(math.pi), strict=False))


@pytest.mark.parametrize(
    ("emitter", "light", "shape"),
    [
        ("sphere", PointLight(**BALL), {"distance": 0.4, "radius": 0.1}),
        ("spot", SpotLight(**BALL, **SPOT), {"radius": 0.1, "cone": 1.0, "blend": 0.4}),
        ("area", AreaLight(**DISC), {"area": 0.25}),
        ("area", AreaLight(**DISC, spread=2.0), {"area": 0.25, "spread": 2.0}),
        ("area", AreaLight(**DISC, spread=0.5), {"area": 0.25, "spread": 0.5}),
        ("sun", SunLight(**ROOT, towards=UP[0], half_angle=0.1), {"angle": 0.2}),
        ("sky", WorldLight(**ROOT), {}),
    ],
)
def test_emitters_are_the_lights_of_the_engine(emitter, light, shape, rng):
    """The same flux, intensity, radiance, and irradiance on axis, both sampled and exact."""
    if "distance" in EMITTERS[emitter][0]:
        shape = {"distance": 0.8, **shape}
    below = np.tile(-shape.get("distance", 1.0) * UP, (100_000, 1))
    sample = light.sample(below, np.tile(UP, (len(below), 1)), rng.random((len(below), 2)))
    arriving = sample.weight * np.maximum(sample.wi[:, 2], 0.0)
    exact = light.irradiance(below[:1], UP)
    radiance = float(light.intersect(below[:1], UP)[1][0])
    found = convert(radiance, "W/m2/sr", "W/m2", emitter=emitter, shape=shape).value
    if exact is not None:
        assert found == pytest.approx(float(exact[0]), rel=1e-9)
    scatter = float(arriving.std()) / math.sqrt(len(arriving))
    assert found == pytest.approx(float(arriving.mean()), rel=1e-9, abs=4.0 * scatter)
    flux, intensity = (float(x[0]) for x in (light.radiant_flux(), light.peak_radiant_intensity()))
    if math.isfinite(intensity):
        for value, to in ((intensity, "W/sr"), (radiance, "W/m2/sr")):
            got = convert(flux, "W", to, emitter=emitter, shape=shape).value
            assert got == pytest.approx(value, rel=EXACT)


lengths = st.floats(1.0, 1e3)
angles = st.floats(0.1, math.pi)
shapes = st.fixed_dictionaries(
    dict.fromkeys(("distance", "area", "duration"), lengths)
    | dict.fromkeys(("cone", "spread", "angle"), angles)
    | {"radius": st.floats(1e-3, 1e-2), "blend": st.floats(0.0, 0.9)}
)


@settings(max_examples=150, deadline=None)
@given(
    value=st.floats(1e-6, 1e6),
    units=st.lists(st.sampled_from(sorted(UNITS)), min_size=3, max_size=3),
    emitter=st.sampled_from([name for name in EMITTERS if name]),
    values=shapes,
    name=st.sampled_from(["D65", "LED-B3", "blackbody:2700", "laser:600"]),
)
def test_inverses_agree_and_the_way_does_not_matter(value, units, emitter, values, name):
    one, two, three = units
    light = spectrum(name)
    shape = {name: values[name] for name in (*EMITTERS[emitter][0], "duration")}
    assume(all(UNITS[unit].form in {"energy", *EMITTERS[emitter][1]} for unit in units))

    def via(value, *units):
        for a, b in itertools.pairwise(units):
            value = convert(value, a, b, emitter=emitter, shape=shape, light=light).value
        return value

    value = math.log2(value) if UNITS[one].stops else value
    assert via(value, one, two, one) == pytest.approx(value, rel=EXACT, abs=EXACT)
    direct = via(value, one, three)
    assert via(value, one, two, three) == pytest.approx(direct, rel=EXACT, abs=EXACT)


def test_a_camera_puts_what_it_meters_at_middle_grey():
    assert ev100(1.0, 1.0, 100.0) == 0.0
    assert ev100(16.0, 1 / 125, 100.0) == pytest.approx(14.97, abs=0.005)  # sunny 16
    assert ev100(8.0, 1 / 60, 400.0) == pytest.approx(ev100(8.0, 1 / 15, 100.0))
    ev = ev100(2.8, 1 / 50, 800.0)
    luminance = 12.5 / 100.0 * 2.8**2 * 50.0 * 100.0 / 800.0  # K N²/(t S)
    assert convert(ev, "EV100", "nit").value == pytest.approx(luminance, rel=EXACT)
    film = convert(ev, "EV100", "film-exposure", light=683.002).value
    assert luminance / 683.002 * film == pytest.approx(0.18, rel=EXACT)
    view = convert(ev, "EV100", "view-exposure", light=683.002).value
    assert 2.0**view == pytest.approx(film, rel=EXACT)
    assert convert(view, "view-exposure", "EV100", light=683.002).value == pytest.approx(ev)


REFUSED = [
    (1, "lm lx", {"emitter": "point"}, "needs: distance, --distance"),
    (1, "lm cd/m2", {"emitter": "area"}, "needs: area, --area"),
    (1, "lm cd", {}, r"solid angle\), --emitter"),
    (1, "lm lx", {}, "emitter .* and distance"),
    (1, "W lm", {}, "needs: spectrum.*--efficacy will do"),
    (1, "W J", {}, "needs: duration"),
    (1, "W lx", {"emitter": "point"}, "needs: spectrum and distance"),
    (1, "lx cd", {"emitter": "sun"}, "sun has no luminous intensity"),
    (1, "lm cd", {"emitter": "point", "shape": {"cone": 1.0}}, "point has no cone"),
    (1, "lm cd", {"emitter": "lamp"}, "unknown emitter 'lamp'.*sky"),
    (1, "lm candle", {}, "unknown unit 'candle'.*talbot"),
    (1, "cd lx", {"shape": {"distance": 0.0}}, "no distance .*, --distance"),
    (1, "cd lx", {"shape": {"distance": math.nan}}, "expected more than 0"),
    (1, "cd lx", {"emitter": "spot", "shape": dict(distance=1, radius=0.9, cone=0.5)}, "too near"),
    (-1, "lm cd", {}, "no amount of light"),
    (math.nan, "EV100 nit", {}, "no amount of light"),
    (1, "lm W", {"light": 0.0}, "no finite number"),
]


@pytest.mark.parametrize(("value", "units", "given", "words"), REFUSED)
def test_refusals_name_what_is_wrong(value, units, given, words):
    with pytest.raises(RadError, match=words):
        convert(value, *units.split(), **given)


# The verb


def test_the_document(capsys):
    line = "convert 100 W --to lx --emitter spot --cone 60 --blend 0 --distance 2 --json"
    assert cli.run([*line.split(), "--spectrum", "LED-B3", "--limits", "400,700"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["value"] == pytest.approx(100 * 326.3 / 0.8418 / 4, rel=1e-3)
    assert (document["unit"], document["quantity"]) == ("lx", "illuminance")
    assert document["from"] == {"value": 100.0, "unit": "W", "quantity": "radiant_flux"}
    assert document["efficacy_lm_W"] == pytest.approx(326.3, rel=1e-3)
    assert "400–700 nm" in document["formula"]
    light = document["spectrum"]
    assert (light["name"], light["limits_nm"]) == ("LED-B3", [400.0, 700.0])
    assert light["correlated_colour_temperature_K"] == pytest.approx(4103, rel=2e-3)
    assert blender_rad.convert(
        100, "W", to="lx", emitter="spot", cone=60, blend=0, distance=2, spectrum="LED-B3",
        limits=(400, 700),
    ) == document  # fmt: skip


@pytest.mark.parametrize(
    ("line", "start"),
    [
        ("1 W --to lm --efficacy photopic", "683.002 lm luminous flux"),
        ("f/8,1/125,ISO100 EV100 --to nit", "1000 nit"),
        ("solar-constant W/m2 --to W --emitter sun --area 1", "1361 W"),
        ("3 cd/m² --to nit", "3 nit"),
    ],
)
def test_people_get_a_line_and_its_formula(line, start, capsys):
    assert cli.run(["convert", *line.split()]) == 0
    first, formula = capsys.readouterr().out.splitlines()
    assert first.startswith(start)
    assert "=" in formula


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("nan lm --to cd", "'nan' is not allowed, VALUE"),
        ("f/8,1/0,ISO100 EV100 --to nit", "VALUE"),
        ("solar-constant lx --to W/m2", "UNIT, expected W/m2"),
        ("1 lm --to lx --emitter point --distance 0", "--distance, expected a number above 0"),
        ("1 lm --to cd --emitter spot --cone 181", "--cone, expected degrees above 0, up to 180"),
        ("1 W --to lm --spectrum D65 --efficacy 179", "exclude each other"),
        ("1 W --to lm --limits 400,700", "expected --spectrum as well"),
    ],
)
def test_bad_input_is_one_line(line, words, capsys):
    assert cli.run(["convert", *line.split()]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("blender-rad: error: ")
    assert words in err
