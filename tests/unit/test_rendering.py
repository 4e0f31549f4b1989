# SPDX-License-Identifier: GPL-3.0-or-later
"""The render as a statistical instrument: error bars, targets, exclusion, borders, interruption."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from blender_rad import rendering
from blender_rad.errors import RadError
from blender_rad.lights.area import AreaLight
from blender_rad.lights.point import PointLight
from blender_rad.rendering import CancelledError, Settings, render
from blender_rad.scene import Camera, Instance, Material, Scene, Unsupported, World
from tests.handmade import GREY, ball, camera_above, moved, scene, square

ONE = np.ones(3)
HAIR = Unsupported("object", "hair", "hair")


def balls(**others: object) -> Scene:
    """Balls over a floor under a point and an area light: penumbras, terminators, edges."""
    lights = [
        PointLight(name="point", rgb=300.0 * ONE, position=np.array([2.0, -3.0, 4.0])),
        AreaLight(
            name="area",
            rgb=np.array([300.0, 200.0, 100.0]),
            center=np.array([-2.0, 1.0, 4.0]),
            axis_u=np.array([2.0, 0.0, 0.0]),
            axis_v=np.array([0.0, -1.0, 0.0]),
            direction=np.array([0.0, 0.0, -1.0]),
        ),
    ]
    instances = [
        Instance("floor", 0, np.eye(4), (0,)),
        Instance("big", 1, moved(z=1.0), (0,), terminator_geometry_offset=0.1),
        Instance("small", 1, moved(1.5, 1.0, 0.5, 0.5), (0,), terminator_geometry_offset=0.1),
    ]
    return scene([square(), ball()], instances, lights, resolution=(48, 48), **others)


def relative_error(film: rendering.Film, reference: rendering.Film) -> float:
    r = reference.radiance
    signal = r**2 + 0.01 * r.mean(axis=(0, 1)) ** 2
    return float(np.sqrt(np.mean((film.radiance - r) ** 2 / signal)))


@pytest.fixture(scope="module")
def reference() -> rendering.Film:
    return render(balls(), Settings(samples=2048, seed=99))


@pytest.mark.parametrize("effort", [{"samples": 16}, {"error": 0.02}])
def test_error_bars_cover_the_truth(reference: rendering.Film, effort: dict[str, float]) -> None:
    """±1.96 standard errors cover 95 %, adaptive or not, wherever there is any noise at all."""
    covered = []
    for seed in range(4):
        film = render(balls(), Settings(seed=seed, **effort))
        spread = 1.96 * np.hypot(film.standard_error, reference.standard_error)
        noisy = reference.variance > 1e-9 * reference.radiance**2
        covered.append((np.abs(film.radiance - reference.radiance) <= spread)[noisy].mean())
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("effort", [{"samples": 1}, {"samples": 7}, {"error": 0.05}])
def test_the_noise_of_layers_is_a_draw_of_their_variance(effort: dict[str, float]) -> None:
    """Uneven halves of samples leave no part of the light in it; one sample tells of none."""
    film = render(balls(), Settings(seed=3, **effort))
    drawn = sum(film.noise.values())
    if effort == {"samples": 1}:
        assert not drawn.any()
    else:
        scale = film.radiance.max() ** 2
        np.testing.assert_allclose(drawn**2, film.variance, rtol=1e-3, atol=1e-9 * scale)


@pytest.mark.parametrize("error", [0.03, 0.01])
def test_target_error_is_met(reference: rendering.Film, error: float) -> None:
    film = render(balls(), Settings(error=error))
    assert film.relative_standard_error <= error
    assert relative_error(film, reference) == pytest.approx(film.relative_standard_error, rel=0.3)
    assert film.samples.max() > film.samples.min()


def test_more_samples_are_better_than_by_chance(reference: rendering.Film) -> None:
    def error(samples: int) -> float:
        films = [render(balls(), Settings(samples=samples, seed=seed)) for seed in range(3)]
        return float(np.mean([relative_error(film, reference) for film in films]))

    assert error(128) < error(8) / np.sqrt(128 / 8) / 1.3


def test_layers_add_up(reference: rendering.Film) -> None:
    total = sum(reference.lights.values()) + reference.seen
    np.testing.assert_allclose(total, reference.radiance, rtol=1e-4, atol=1e-6)
    assert list(reference.lights) == ["point", "area"]


def test_what_is_seen_of_a_light_is_in_its_layer() -> None:
    """A glowing ball, a sky and a light that the camera sees: the layers add up to the picture."""
    glow = Material("glow", albedo=(0.3, 0.3, 0.3), emission=(2.0, 1.0, 0.5))
    made = balls(materials=[GREY, glow], world=World(radiance=(0.5, 0.25, 0.125)))
    floor, big, _ = made.instances
    shown = replace(made.lights[0], radius=0.3, visible_camera=True, position=np.array([2, -2, 3]))
    made = replace(
        made,
        lights=(shown,),
        instances=(
            replace(floor, world_from_object=moved(scale=0.3)),
            replace(big, materials=(1,)),
        ),
    )
    film = render(made, Settings(samples=4))
    assert list(film.shown) == ["point", "big", "World"]
    total = sum(film.lights[name] + film.shown[name] for name in film.lights)
    np.testing.assert_allclose(total, film.radiance, rtol=1e-4, atol=1e-6)


def test_samples_are_as_asked() -> None:
    for samples in (1, 12, 16):
        film = render(balls(), Settings(samples=samples))
        assert np.unique(film.samples).tolist() == [samples]
        unknown = np.array_equal(film.variance, film.radiance**2)
        assert unknown == (samples == 1)


def test_result_does_not_depend_on_threads() -> None:
    one, two = (render(balls(), Settings(samples=8, threads=n)) for n in (1, 3))
    np.testing.assert_array_equal(one.radiance, two.radiance)


def test_outside_the_border_is_zero() -> None:
    whole = render(balls(), Settings(samples=8))
    part = render(balls(border=(10, 20, 30, 44)), Settings(samples=8))
    np.testing.assert_array_equal(part.inside[4:28, 10:30], True)
    assert part.inside.sum() == 20 * 24
    for name in ("radiance", "alpha", "depth", "normal", "irradiance"):
        image, full = getattr(part, name), getattr(whole, name)
        np.testing.assert_allclose(image[part.inside], full[part.inside])
        assert not image[~part.inside].any()


def test_background_shows_or_is_transparent() -> None:
    wide = camera_above(half_width=20.0)
    world = World(radiance=(0.5, 0.25, 0.125))
    opaque = render(replace(balls(world=world), camera=wide), Settings(samples=8))
    np.testing.assert_allclose(opaque.radiance[0, 0], world.radiance)
    assert opaque.alpha[0, 0] == 1.0
    assert np.isinf(opaque.depth[0, 0])
    clear = render(
        replace(balls(world=world), camera=wide, film_transparent=True), Settings(samples=8)
    )
    assert not clear.radiance[0, 0].any()
    assert clear.alpha[0, 0] == 0.0
    assert clear.alpha[24, 24] == 1.0


def test_clipped_and_hidden_things_are_not_seen() -> None:
    near = Camera("c", "orthographic", moved(z=10.0), (-2, 2, -2, 2), (0.1, 9.5))
    film = render(replace(balls(), camera=near), Settings(samples=8))
    assert np.isinf(film.depth[0, 0])  # the floor lies 10 away
    assert film.depth[24, 24] == pytest.approx(8.0, abs=0.01)
    made = balls()
    hidden = tuple(replace(i, visible_camera=i.name == "floor") for i in made.instances)
    film = render(replace(made, instances=hidden), Settings(samples=8))
    np.testing.assert_allclose(film.depth, 10.0, rtol=1e-6)
    assert film.radiance[24, 24].max() < film.radiance[0, 0].max()  # the shadow stays


def test_depth_is_in_metres() -> None:
    film = render(balls(unit_scale_m=0.01), Settings(samples=8))
    assert film.depth[0, 0] == pytest.approx(0.1)


def test_unsupported_surface_is_excluded_with_what_it_may_shade() -> None:
    """Camera hits on it, and points whose light must pass it; nothing else."""
    made = balls(materials=[GREY, Material("fur", opaque=False, unsupported=(HAIR,))])
    floor, big, _ = made.instances
    made = replace(made, instances=(floor, replace(big, materials=(1,))))
    film = render(made, Settings(samples=64))
    assert film.excluded_by == {HAIR: int(film.excluded.sum())}
    assert film.excluded[24, 24]
    known = render(replace(made, instances=(floor,)), Settings(samples=256))
    shaded = render(replace(made, materials=(GREY, GREY)), Settings(samples=64))
    free = ~film.excluded
    assert 0.1 < free.mean() < 0.9
    np.testing.assert_allclose(film.radiance[free], known.radiance[free], rtol=0.05)
    differs = np.abs(shaded.radiance / known.radiance - 1).max(axis=-1) > 0.05
    assert not (differs & free).any()


def test_unknown_light_and_world_exclude_what_they_reach() -> None:
    mystery = PointLight(name="mystery", rgb=np.ones(3), position=np.array([4.0, 0.0, 1.0]))
    made = balls(unknown_lights=(mystery,))
    film = render(made, Settings(samples=16))
    assert film.excluded_by == {Unsupported("light", "mystery", "emission"): film.excluded.sum()}
    assert 0.5 < film.excluded.mean() < 1.0  # behind the balls it is dark
    sky = Unsupported("world", "World", "TexSky")
    film = render(balls(world=World(known=False, unsupported=(sky,))), Settings(samples=16))
    assert film.excluded.all()


def test_no_camera_is_an_error() -> None:
    with pytest.raises(RadError, match="no camera"):
        render(replace(balls(), camera=None))


def test_nothing_to_see_and_nothing_to_light() -> None:
    film = render(scene([], [], []), Settings(error=0.01))
    assert not film.radiance.any()
    assert film.relative_standard_error == 0.0
    dark = render(replace(balls(), lights=()), Settings(error=0.01))
    assert not dark.radiance.any()


def test_cancel_stops_it() -> None:
    cancel = threading.Event()
    shares: list[float] = []

    def progress(share: float) -> None:
        shares.append(share)
        cancel.set()

    with pytest.raises(CancelledError):
        render(balls(), Settings(samples=4096), progress=progress, cancel=cancel)
    assert len(shares) < 10


def test_time_limit_gives_the_picture_so_far() -> None:
    film = render(balls(), Settings(samples=1 << 16, time_limit=0.3))
    assert film.samples.min() >= rendering.STREAMS
    assert film.samples.max() < 1 << 16
    with pytest.raises(RadError, match="at most 65536"):
        render(balls(), Settings(samples=(1 << 16) + 1))
