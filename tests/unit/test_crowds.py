# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights, a few of which are chosen at each point, are those lights."""

from dataclasses import replace

import numpy as np
import pytest

from blender_rad import crowds
from blender_rad.direct import DirectLight
from blender_rad.film import REST
from blender_rad.lights import Light
from blender_rad.lights.area import AreaLight
from blender_rad.lights.point import PointLight
from blender_rad.lights.spot import SpotLight
from blender_rad.lights.sun import SunLight
from blender_rad.rendering import Settings, render
from blender_rad.scene import Instance, Linking, Scene
from tests.handmade import GREY, ball, moved, scene, square

KINDS = (PointLight, SpotLight, AreaLight)


def hall(count: int) -> Scene:
    """A floor and a ball under lights of all kinds, one of which is bright, and a sun."""
    rng = np.random.default_rng(4)
    examples = [light for kind in KINDS for light in kind.examples() if light.rgb.min() > 0.0]
    lights: list[Light] = []
    for k in range(count):
        place = rng.uniform((-4, -4, 0.5), (4, 4, 3))
        field = "center" if isinstance(examples[k % len(examples)], AreaLight) else "position"
        rgb = rng.uniform(0.2, 1.0, 3) * (40.0 if k == 5 else 1.0)
        moved_to = {field: place, "name": f"light {k}", "rgb": rgb}
        lights.append(replace(examples[k % len(examples)], **moved_to))
    lights.append(replace(SunLight.examples()[0], name="sun", rgb=np.full(3, 0.02)))
    instances = [Instance("floor", 0, np.eye(4), (0,)), Instance("ball", 1, moved(z=1.0), (0,))]
    return scene([square(), ball()], instances, lights, materials=[GREY], resolution=(16, 16))


def test_what_is_chosen_adds_up_to_all() -> None:
    """Over many choices, on a floor, against the closed forms of all lights."""
    made = hall(60)
    up = np.array([[0.0, 0.0, 1.0]])
    known = [light.irradiance(0.1 * up, up) is not None for light in made.lights]
    made = replace(made, lights=tuple(np.array(made.lights)[known]))
    light = DirectLight(made)
    (crowd,) = crowds.gathered(light, made, made.camera, per_light=False).crowds
    rng = np.random.default_rng(1)
    count, times = 200, 600
    points = np.concatenate([rng.uniform(-4, 4, (count, 2)), np.zeros((count, 1))], axis=1)
    normals = np.repeat(up, count, axis=0)
    several = [
        e.light for e in light.emitters if np.isfinite(e.light.peak_radiant_intensity()).all()
    ]
    rgb = np.array([one.rgb for one in several])
    sent = np.array([np.nan_to_num(one.irradiance(points, normals)) for one in several])
    sent, total = sent[[np.abs(rgb - own).sum(axis=1).argmin() for own in crowd.rgb]], rgb.T @ sent
    plain, found = np.empty((2, times, count, 3))
    for k in range(times):
        chosen, chance, foreseen, whole = crowd.pick(points, normals, rng.random(count))
        light_of = (sent[chosen, np.arange(count)] / chance)[..., None] * crowd.rgb[chosen]
        plain[k] = light_of.mean(axis=0)
        found[k] = whole + (light_of - foreseen[..., None] * crowd.hue[chosen]).mean(axis=0)
    for each in (plain, found):
        z = (each.mean(axis=0) - total.T) / (each.std(axis=0, ddof=1) / times**0.5)
        assert np.abs(z).max() < 4.5
        assert 0.8 < z.std() < 1.2
        assert each.mean() == pytest.approx(total.mean(), rel=0.006)


def test_layers_are_those_of_the_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some of the lights are linked: to the floor, which alone shadows them."""
    settings, floor = Settings(samples=64), np.array([True, False, False])
    linked = {f"light {k}": Linking(floor, floor) for k in range(0, 60, 3)}
    made = replace(hall(60), linking=linked)
    gathered = render(made, settings)
    monkeypatch.setattr(crowds, "FEW", 1000)
    alone = render(made, settings)
    off = (gathered.radiance - alone.radiance).sum(axis=(0, 1))
    variance = (gathered.variance + alone.variance).sum(axis=(0, 1))
    assert (np.abs(off) < 4.0 * np.sqrt(variance)).all()
    total = {name: layer.sum() for name, layer in alone.lights.items()}
    whole = sum(total.values())
    assert REST in gathered.lights
    assert {name for name in total if total[name] > 0.01 * whole} <= gathered.lights.keys()
    summed = sum(layer.astype(float) for layer in gathered.lights.values())
    np.testing.assert_allclose(summed, gathered.radiance, rtol=1e-5)
    rest = sum(total[name] for name in total.keys() - gathered.lights.keys())
    assert gathered.lights[REST].sum() == pytest.approx(rest, abs=0.005 * float(whole))
