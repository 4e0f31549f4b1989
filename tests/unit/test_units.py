# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversions: known answers, the lights' own light, inverses, and what is refused."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blender_rad.errors import RadError
from blender_rad.lights._base import Array, Light
from blender_rad.lights.area import AreaLight
from blender_rad.lights.point import PointLight
from blender_rad.lights.spot import SpotLight
from blender_rad.lights.sun import SunLight
from blender_rad.lights.world import WorldLight
from blender_rad.spectra import spectrum
from blender_rad.units import EMITTERS, UNITS, convert, ev100

EXACT = 1e-12  # rounding of a dozen factors
ROOM = {"distance": 3.0, "area": 0.25, "radius": 0.1, "cone": 1.0, "blend": 0.4, "spread": 2.0}
ROOM |= {"angle": 0.0093, "duration": 60.0}


def shape_of(emitter: str, values: dict[str, float]) -> dict[str, float]:
    """Return those of `values` that the emitter takes."""
    return {name: values[name] for name in (*EMITTERS[emitter][0], "duration")}


@pytest.mark.parametrize(
    ("value", "units", "emitter", "shape", "expected"),
    [
        (100, "lm lx", "point", {"distance": 1.0}, 7.957747),
        (100, "lm lx", "area", {"distance": 1.0}, 31.830989),
        (1000, "cd lx", None, {"distance": 3.0}, 1000 / 9),  # CIE 171, case 5.2
        (10_000, "lm lx", None, {"area": 20.0}, 500.0),
        (1, "cd/m2 lm", "sphere", {"radius": 0.5}, math.pi**2),
        (1, "cd/m2 lm", "area", {"area": 2.0}, 2 * math.pi),
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
    ],
)
def test_known_answers(
    value: float, units: str, emitter: str | None, shape: dict[str, float], expected: float
) -> None:
    result = convert(value, *units.split(), emitter=emitter, shape=shape)
    assert result.value == pytest.approx(expected, rel=1e-6)
    assert "=" in result.formula
    assert result.efficacy_lm_W is None


def test_through_a_spectrum_or_a_convention() -> None:
    green, plant = spectrum("laser:550"), spectrum("laser:660")
    assert convert(1, "W", "lm", light=179.0) == (
        179.0,
        179.0,
        "X_v = K X_e, K = 179 lm/W by convention",
    )
    assert convert(1, "W", "photons/s", light=green).value == pytest.approx(2.77e18, rel=1e-3)
    assert convert(1, "W", "umol/s", light=plant).value == pytest.approx(5.517, rel=1e-3)
    assert convert(1, "W", "umol/s", light=spectrum("laser:730")).value == 0.0
    assert convert(1, "W/m2", "lx", light=spectrum("laser:1064")).value == 0.0
    assert "D65, 380–780 nm" in convert(1, "lx", "umol/m2/s", light=spectrum("D65")).formula


UP = np.array([[0.0, 0.0, 1.0]])
ROOT = dict[str, Any](name="light", rgb=np.ones(3))
ORIGIN: Array = np.zeros(3)


def plate(area: float, spread: float) -> AreaLight:
    diameter = 2.0 * math.sqrt(area / math.pi)
    axes = diameter * np.eye(3)
    return AreaLight(
        **ROOT, center=ORIGIN, axis_u=axes[0], axis_v=axes[1], direction=-UP[0], ellipse=True,
        spread=spread, series=False,
    )  # fmt: skip


LIGHTS: dict[str, Light] = {
    "sphere": PointLight(**ROOT, position=ORIGIN, radius=0.1),
    "spot": SpotLight(
        **ROOT, position=ORIGIN, radius=0.1, light_from_world=np.eye(3),
        cos_half_angle=math.cos(0.5), blend=0.4,
    ),
    "area": plate(0.25, 2.0),
    "sun": SunLight(**ROOT, towards=UP[0], half_angle=0.5 * 0.0093),
    "sky": WorldLight(**ROOT),
}  # fmt: skip


@pytest.mark.parametrize("emitter", LIGHTS)
def test_emitters_are_the_lights_of_the_engine(emitter: str, rng: np.random.Generator) -> None:
    """Their flux, intensity and radiance, and what is sampled to arrive, give the same ratios."""
    light, shape = LIGHTS[emitter], shape_of(emitter, ROOM)
    below = np.tile(ORIGIN - 3.0 * UP, (200_000, 1))
    normals = np.broadcast_to(UP, below.shape)
    sample = light.sample(below, normals, rng.random((len(below), 2)))
    arriving = sample.weight * np.maximum(sample.wi[:, 2], 0.0)
    scatter = float(arriving.std() / math.sqrt(len(arriving)))
    radiance = float(light.intersect(below[:1], UP)[1][0])

    found = convert(radiance, "W/m2/sr", "W/m2", emitter=emitter, shape=shape).value
    assert found == pytest.approx(float(arriving.mean()), rel=1e-9, abs=4.0 * scatter)
    intensity = float(light.peak_radiant_intensity()[0])
    if math.isfinite(intensity):
        flux = float(light.radiant_flux()[0])
        assert convert(flux, "W", "W/sr", emitter=emitter, shape=shape).value == pytest.approx(
            intensity, rel=EXACT
        )
        assert convert(intensity, "W/sr", "W/m2/sr", emitter=emitter, shape=shape).value == (
            pytest.approx(radiance, rel=EXACT)
        )


def test_a_disc_without_spread_is_exact() -> None:
    exact = plate(0.25, math.pi).irradiance(ORIGIN - 0.4 * UP, UP)
    assert exact is not None
    shape = {"area": 0.25, "distance": 0.4}
    found = convert(1, "W", "W/m2", emitter="area", shape=shape).value
    assert found == pytest.approx(float(exact[0]), rel=1e-10)


lengths = st.floats(1e-3, 1e3)
shapes = st.fixed_dictionaries(
    {
        "distance": st.floats(1.0, 1e3),
        "radius": st.floats(1e-3, 1e-2),
        "area": lengths,
        "duration": lengths,
        "cone": st.floats(0.1, math.pi),
        "blend": st.floats(0.0, 0.9),
        "spread": st.floats(0.1, math.pi),
        "angle": st.floats(1e-3, math.pi),
    }
)


@settings(max_examples=300, deadline=None)
@given(
    value=st.floats(1e-6, 1e6),
    units=st.lists(st.sampled_from(sorted(UNITS)), min_size=3, max_size=3),
    emitter=st.sampled_from([name for name in EMITTERS if name]),
    values=shapes,
    name=st.sampled_from(["D65", "LED-B3", "blackbody:2700", "laser:600"]),
)
def test_inverses_agree_and_the_way_does_not_matter(
    value: float, units: list[str], emitter: str, values: dict[str, float], name: str
) -> None:
    one, two, three = units
    light, shape = spectrum(name), shape_of(emitter, values)
    has = {"energy", *EMITTERS[emitter][1]}
    assume(all(UNITS[unit].form in has for unit in units))
    assume("flux" in has or not {"energy"} & {UNITS[unit].form for unit in units})

    def via(value: float, *units: str) -> float:
        for a, b in itertools.pairwise(units):
            value = convert(value, a, b, emitter=emitter, shape=shape, light=light).value
        return value

    value = math.log2(value) if UNITS[one].stops else value
    assert via(value, one, two, one) == pytest.approx(value, rel=EXACT, abs=EXACT)
    assert via(value, one, two, three) == pytest.approx(
        via(value, one, three), rel=EXACT, abs=EXACT
    )


def test_a_camera_puts_what_it_meters_at_middle_grey() -> None:
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


@pytest.mark.parametrize(
    ("value", "units", "given", "words"),
    [
        (1, "lm lx", {"emitter": "point"}, "needs: distance, --distance"),
        (1, "lm cd/m2", {"emitter": "area"}, "needs: area, --area"),
        (1, "lm cd/m2", {"emitter": "point"}, "needs: radius, --radius"),
        (1, "lm cd", {}, r"solid angle\), --emitter"),
        (1, "lm cd", {"emitter": "spot"}, r"solid angle\), --cone"),
        (1, "lx nit", {"emitter": "sun"}, r"solid angle\), --angle"),
        (1, "lm lx", {}, "emitter .* and distance"),
        (1, "W lm", {}, "needs: spectrum"),
        (1, "W photons/s", {"light": 683.0}, "needs: spectrum"),
        (1, "lm umol/s", {"light": 683.0}, "needs: spectrum"),
        (1, "W J", {}, "needs: duration"),
        (1, "W lx", {"emitter": "point"}, "needs: spectrum and distance"),
        (1, "lx cd", {"emitter": "sun"}, "sun has no luminous_intensity"),
        (1, "lm cd", {"emitter": "point", "shape": {"cone": 1.0}}, "point has no cone"),
        (1, "lm cd", {"emitter": "lamp"}, "unknown emitter 'lamp'.*sky"),
        (1, "lm candle", {}, "unknown unit 'candle'.*talbot"),
        (1, "cd lx", {"shape": {"distance": 0.0}}, "no distance .*, --distance"),
        (1, "cd lx", {"shape": {"distance": math.nan}}, "expected more than 0"),
        (1, "cd lx", {"emitter": "sphere", "shape": {"distance": 1, "radius": 2}}, "too near"),
        (1, "cd lx", {"emitter": "spot", "shape": {"distance": 1, "radius": 0.9, "cone": 0.5}},
         "too near"),
        (-1, "lm cd", {}, "no amount of light"),
        (math.nan, "EV100 nit", {}, "no amount of light"),
        (math.inf, "lm cd", {}, "no amount of light"),
        (0, "nit EV100", {}, "no finite number"),
        (5000, "EV100 nit", {}, "no finite number"),
        (0, "film-exposure W/m2/sr", {}, "no finite number"),
        (1, "lm W", {"light": 0.0}, "no finite number"),
        (1e308, "fc lx", {}, "no finite number"),
    ],
)  # fmt: skip
def test_refusals_name_what_is_wrong(
    value: float, units: str, given: dict[str, Any], words: str
) -> None:
    with pytest.raises(RadError, match=words):
        convert(value, *units.split(), **given)
