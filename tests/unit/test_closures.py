# SPDX-License-Identifier: GPL-3.0-or-later
"""Closures under lights of all kinds: both ways of sampling agree, and no energy is made."""

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blender_rad import closures
from blender_rad.cameras import camera_rays
from blender_rad.closures import Closures, Scattering
from blender_rad.crowds import gathered
from blender_rad.direct import DirectLight
from blender_rad.lights import SkyMap
from blender_rad.lights.point import PointLight
from blender_rad.lights.sun import SunLight
from blender_rad.rendering import Settings, render
from blender_rad.scene import Closure, Instance, Material, Scene, World
from blender_rad.textures import constant
from tests.handmade import ball, moved, panel, scene, square

ONE = np.ones(3)
SAMPLES, SIGMAS = 8_000, 5.0


def closure(kind: str, *, settings: dict[str, str] | None = None, **inputs: Any) -> Closure:
    values = {name: constant(value) for name, value in inputs.items()}
    return Closure(f"ShaderNodeBsdf{kind}", constant(1.0), values, settings or {})


def ggx(roughness: float, colour: tuple[float, float, float] = (0.9, 0.7, 0.5)) -> Closure:
    shape = {"Roughness": roughness, "Anisotropy": 0.0, "Rotation": 0.0}
    return closure("Anisotropic", settings={"distribution": "GGX"}, Color=colour, **shape)


TRANSLUCENT = closure("Translucent", Color=(0.8, 0.6, 0.4))
AREA = panel(100.0, (2.0, 0.5, 3.0), 2.0, 1.0)
SPHERE = PointLight(name="sphere", rgb=100.0 * ONE, position=np.array([3.0, -1, 3]), radius=1.0)
SUN = SunLight(name="sun", rgb=3.0 * ONE, towards=np.array([0.48, -0.36, 0.8]), half_angle=0.3)
SKY = np.full((32, 64, 3), 0.2, dtype=np.float32)
SKY[5:8, 8:12] = 40.0
LIT: dict[str, dict[str, Any]] = {
    "area": {"lights": [AREA]},
    "sphere": {"lights": [SPHERE]},
    "sun": {"lights": [SUN]},
    "sky": {"world": World(maps=(SkyMap(SKY, np.eye(3)),))},
    "uniform": {"world": World(radiance=(1.0, 1.0, 1.0))},
    "mesh": {"glow": True},
}


def tilted() -> np.ndarray:
    """A wall that leans away from the lights: the camera sees its dark side."""
    turn = moved(z=0.6)
    turn[:3, 0], turn[:3, 2] = [0.3, 0.0, 0.954], [-0.954, 0.0, 0.3]
    return turn


def made(shown: Closure, lit: str = "sky", *, flat: bool = True, **others: Any) -> Scene:
    """A floor of a closure, or that wall."""
    parts = {"lights": [], **LIT[lit], **others}
    materials = [Material("shown", closures=(shown,)), Material("glow", emission=(5.0, 4.0, 3.0))]
    instances = [Instance("shown", 0, np.eye(4) if flat else tilted(), (0,))]
    if parts.pop("glow", False):
        instances.append(Instance("glow", 1, moved(2.0, 0.5, 3.0, 0.7), (1,)))
    meshes = [square(5.0 if flat else 1.0), ball(8, 12)]
    return scene(meshes, instances, parts.pop("lights"), materials=materials, **parts)


def seen(made: Scene, rng: np.random.Generator, *, together: bool = False) -> tuple[float, float]:
    """Return the mean and standard error of what closures send up from a point."""
    light, place = DirectLight(made), np.zeros(SAMPLES, dtype=np.int64)
    assert made.camera is not None
    if together:
        light = gathered(light, made, made.camera, per_light=False)
        assert light.crowds
    rays = camera_rays(made.camera, made.resolution, np.array([[8.0, 8.0]]))
    hits = light.visibility.camera.intersect(rays.origins, rays.directions)
    surface = light.geometry.surface(hits.take(place), rays.directions[place])
    scattering = Closures(made, light.geometry).at(surface)
    nothing = np.zeros(SAMPLES)
    random = defaultdict[int, np.ndarray](lambda: rng.random((SAMPLES, 2)))
    arrivals = light.arrivals(surface, lambda *_: nothing, random.__getitem__, 0, scattering)
    total = sum(arrival.scattered for arrival in arrivals if arrival.scattered is not None)
    values = np.mean(total, axis=-1) * np.ones(SAMPLES)
    return float(values.mean()), float(values.std() / np.sqrt(SAMPLES))


@pytest.mark.parametrize("lit", LIT)
@pytest.mark.parametrize(("shown", "flat"), [(TRANSLUCENT, False), (ggx(0.4), True)])
def test_lights_and_closures_are_sampled_to_the_same_end(
    lit: str,
    shown: Closure,
    flat: bool,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both together, and each alone."""
    built = made(shown, lit, flat=flat)
    both = seen(built, rng)
    monkeypatch.setattr(closures, "trusted", lambda own, _: np.ones_like(own))
    with monkeypatch.context() as without:
        without.setattr(Scattering, "met", lambda *_: None)
        first = seen(built, rng)
    monkeypatch.setattr(Scattering, "lit", lambda self, *_, **__: 0.0 * self._wi)
    second = seen(built, rng)
    assert both[0] > 0.0
    alone = lit in {"sky", "uniform"} and not flat  # samples of a sky need not go below
    for mean, error in (second,) if alone else (first, second):
        assert abs(mean - both[0]) < SIGMAS * np.hypot(error, both[1])
    assert both[1] < 1.1 * max(first[1], second[1])


@pytest.mark.parametrize("roughness", [0.2, 0.5])
def test_many_lights_are_found_as_each_is(roughness: float, rng: np.random.Generator) -> None:
    """Gathered and one by one; some of them are points, which no ray finds."""
    places = rng.uniform((1.0, -2.0, 2.0), (4.0, 2.0, 3.0), (20, 3))
    balls = [
        replace(SPHERE, name=f"{k}", position=p, radius=0.2 * (k % 3)) for k, p in enumerate(places)
    ]
    panels = [replace(AREA, name=f"panel {k}", center=p - 0.5) for k, p in enumerate(places[:8])]
    built = made(ggx(roughness), lights=[*balls, *panels], world=World())
    (one, error), (all_, spread) = (seen(built, rng, together=k) for k in (False, True))
    assert abs(all_ - one) < SIGMAS * np.hypot(error, spread)
    assert spread < 8.0 * error


@pytest.mark.parametrize(("shown", "albedo"), [(TRANSLUCENT, (0.8, 0.6, 0.4)), (ggx(0.0), None)])
def test_a_furnace_shows_the_albedo(shown: Closure, albedo: tuple[float, ...] | None) -> None:
    """On a plane that hides nothing from either side; a sharp mirror of its colour."""
    film = render(made(shown, "uniform"), Settings(samples=64))
    expected = np.array(albedo or (0.9, 0.7, 0.5))
    np.testing.assert_allclose(film.radiance.mean(axis=(0, 1)), expected, rtol=2e-3)
    np.testing.assert_allclose(film.lights["World"], film.radiance, rtol=1e-5)
    assert np.abs(film.radiance - expected).max() < 6.0 * film.standard_error.max() + 1e-9


def test_lobes_see_what_lights_their_kind() -> None:
    """Diffuse and glossy lobes of one surface under one light each add up to both under both."""
    mixed = Material("mixed", albedo=(0.5, 0.5, 0.5), closures=(TRANSLUCENT, ggx(0.4)))

    def shown(*reaches: str) -> np.ndarray:
        light = replace(SPHERE, reaches=reaches)
        built = replace(made(ggx(0.4), lights=[light], world=World()), materials=(mixed,))
        return render(built, Settings(samples=32)).radiance

    both, glossy, diffuse = shown("diffuse", "glossy"), shown("glossy"), shown("diffuse")
    assert not shown("transmission").any()
    assert min(glossy.mean(), diffuse.mean()) > 0.1 * both.mean()
    np.testing.assert_allclose(glossy + diffuse, both, rtol=0.1)
    np.testing.assert_allclose((glossy + diffuse).mean(), both.mean(), rtol=5e-3)
