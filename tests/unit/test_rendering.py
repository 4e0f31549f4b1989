# SPDX-License-Identifier: GPL-3.0-or-later
"""The render as a statistical instrument: error bars, targets, exclusion, borders, interruption."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from blender_rad import rendering
from blender_rad.errors import RadError
from blender_rad.lights.point import PointLight
from blender_rad.rendering import CancelledError, Settings, render
from blender_rad.scene import Camera, Instance, Material, Scene, Unsupported, World
from tests.handmade import GREY, ball, moved, panel, scene, square

HAIR = Unsupported("object", "hair", "hair")
FUR = Material("fur", opaque=False, unsupported=(HAIR,))
POINT = PointLight(name="point", rgb=np.full(3, 300.0), position=np.array([2.0, -3.0, 4.0]))
AREA = panel((300.0, 200.0, 100.0), (-2.0, 1.0, 4.0), 2.0, 1.0)
SKY = World(radiance=(0.5, 0.25, 0.125))
SIZE = 48
MIDDLE = SIZE // 2, SIZE // 2


def balls(**others: object) -> Scene:
    """Balls over a floor under a point and an area light: penumbras, terminators, edges."""
    instances = [
        Instance("floor", 0, np.eye(4), (0,)),
        Instance("big", 1, moved(z=1.0), (0,), terminator_geometry_offset=0.1),
        Instance("small", 1, moved(1.5, 1.0, 0.5, 0.5), (0,), terminator_geometry_offset=0.1),
    ]
    given = {"resolution": (SIZE, SIZE), **others}
    return scene([square(), ball()], instances, [POINT, AREA], **given)


def shot(made: Scene | None = None, **settings: object) -> rendering.Film:
    return render(made or balls(), Settings(**settings))


def relative_error(film: rendering.Film, reference: rendering.Film) -> float:
    r = reference.radiance
    signal = r**2 + 0.01 * r.mean(axis=(0, 1)) ** 2
    return float(np.sqrt(np.mean((film.radiance - r) ** 2 / signal)))


@pytest.fixture(scope="module")
def reference() -> rendering.Film:
    return shot(samples=2048, seed=99)


@pytest.mark.parametrize("effort", [{"samples": 16}, {"error": 0.02}])
def test_error_bars_cover_the_truth(reference, effort):
    """±1.96 standard errors cover 95 %, adaptive or not, wherever there is any noise at all."""
    covered = []
    for seed in range(4):
        film = shot(seed=seed, **effort)
        spread = 1.96 * np.hypot(film.standard_error, reference.standard_error)
        noisy = reference.variance > 1e-9 * reference.radiance**2
        covered.append((np.abs(film.radiance - reference.radiance) <= spread)[noisy].mean())
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("effort", [{"samples": 1}, {"samples": 7}, {"error": 0.05}])
def test_the_noise_of_layers_is_a_draw_of_their_variance(effort):
    """Uneven halves of samples leave no part of the light in it; one sample tells of none."""
    film = shot(seed=3, **effort)
    drawn = sum(film.noise.values())
    if effort == {"samples": 1}:
        assert not drawn.any() and np.array_equal(film.variance, film.radiance**2)
    else:
        scale = film.radiance.max() ** 2
        np.testing.assert_allclose(drawn**2, film.variance, rtol=1e-3, atol=1e-9 * scale)
    if "samples" in effort:
        assert (film.samples == effort["samples"]).all()


@pytest.mark.parametrize("error", [0.03, 0.01])
def test_target_error_is_met(reference, error):
    film = shot(error=error)
    assert film.relative_standard_error <= error
    assert relative_error(film, reference) == pytest.approx(film.relative_standard_error, rel=0.3)
    assert film.samples.max() > film.samples.min()


def test_more_samples_are_better_than_by_chance():
    few, many = (
        relative_error(*(shot(samples=samples, seed=seed) for seed in (1, 2)))
        for samples in (8, 128)
    )
    assert many < few / np.sqrt(128 / 8) / 1.3


def test_layers_add_up_with_what_is_seen_of_their_lights(reference):
    """Also a glowing ball, a sky and a light that the camera sees."""
    total = sum(reference.lights.values()) + reference.seen
    np.testing.assert_allclose(total, reference.radiance, rtol=1e-4, atol=1e-6)
    assert list(reference.lights) == ["point", "area"]
    glow = Material("glow", albedo=(0.3, 0.3, 0.3), emission=(2.0, 1.0, 0.5))
    made = balls(materials=[GREY, glow], world=SKY)
    floor, big, _ = made.instances
    placed = replace(floor, world_from_object=moved(scale=0.3)), replace(big, materials=(1,))
    shown = replace(POINT, radius=0.3, visible_camera=True, position=np.array([2, -2, 3]))
    film = shot(replace(made, lights=(shown,), instances=placed), samples=4)
    assert list(film.shown) == ["point", "big", "World"]
    total = sum(film.lights[name] + film.shown[name] for name in film.lights)
    np.testing.assert_allclose(total, film.radiance, rtol=1e-4, atol=1e-6)


def test_a_border_is_its_part_of_the_whole_on_any_threads():
    whole = shot(samples=8, threads=1)
    part = shot(balls(border=(10, 20, 30, 44)), samples=8, threads=3)
    inside = np.zeros((SIZE, SIZE), bool)
    inside[4:28, 10:30] = True
    np.testing.assert_array_equal(part.inside, inside)
    for name in ("radiance", "alpha", "depth", "normal", "irradiance"):
        image, full = getattr(part, name), getattr(whole, name)
        np.testing.assert_array_equal(image[inside], full[inside])
        assert not image[~inside].any()


def test_clipped_things_are_not_seen_and_depth_is_in_metres():
    near = Camera("c", "orthographic", moved(z=10.0), (-2, 2, -2, 2), (0.1, 9.5))
    film = shot(balls(camera=near, unit_scale_m=0.01), samples=8)
    assert np.isinf(film.depth[0, 0])  # the floor lies 10 away
    assert film.depth[MIDDLE] == pytest.approx(0.08, abs=1e-4)


def test_unsupported_surface_is_excluded_with_what_it_may_shade():
    """Camera hits on it, and points whose light must pass it; nothing else."""
    made = balls(materials=[GREY, FUR])
    floor, big, _ = made.instances
    made = replace(made, instances=(floor, replace(big, materials=(1,))))
    film = shot(made, samples=64)
    assert film.excluded_by == {HAIR: int(film.excluded.sum())}
    assert film.excluded[MIDDLE]
    known = shot(replace(made, instances=(floor,)), samples=256)
    shaded = shot(replace(made, materials=(GREY, GREY)), samples=64)
    free = ~film.excluded
    assert 0.1 < free.mean() < 0.9
    np.testing.assert_allclose(film.radiance[free], known.radiance[free], rtol=0.05)
    differs = np.abs(shaded.radiance / known.radiance - 1).max(axis=-1) > 0.05
    assert not (differs & free).any()


@pytest.mark.parametrize(("bright", "out"), [(1.0, 1.0), (1e-4, 0.0)])
def test_what_rarely_leaks_is_excluded_by_how_much_it_may_add(bright: float, out: float) -> None:
    """A pane before 2 % of a light; before Blender 5 a closure's ray may pass one more than all."""
    pane = Instance("pane", 0, moved(-2.0, 1.0, 3.9, 0.02), (1,), visible_camera=False)
    light = replace(AREA, rgb=AREA.rgb * bright)
    made = scene(
        [square()],
        [Instance("floor", 0, np.eye(4), (0,)), pane],
        [POINT, light],
        materials=[GREY, Material("pane", transmittance=(0.5, 0.5, 0.5))],
        blender_version=(4, 5, 0),
        transparent_max_bounces=0,
    )
    for samples in (16, 256):
        assert shot(made, samples=samples).excluded.mean() == pytest.approx(out, abs=0.02)


def test_unknown_light_and_world_exclude_what_they_reach():
    mystery = PointLight(name="mystery", rgb=np.ones(3), position=np.array([4.0, 0.0, 1.0]))
    film = shot(balls(unknown_lights=(mystery,)), samples=16)
    assert film.excluded_by == {Unsupported("light", "mystery", "emission"): film.excluded.sum()}
    assert 0.5 < film.excluded.mean() < 1.0  # behind the balls it is dark
    sky = Unsupported("world", "World", "TexSky")
    film = shot(balls(world=World(known=False, unsupported=(sky,))), samples=16)
    assert film.excluded.all()


def test_nothing_to_see_and_nothing_to_light():
    film = shot(scene([], [], []), error=0.01)
    assert not film.radiance.any() and film.relative_standard_error == 0.0
    assert not shot(replace(balls(), lights=()), error=0.01).radiance.any()
    with pytest.raises(RadError, match="no camera"):
        shot(replace(balls(), camera=None))


def test_cancel_stops_it():
    cancel, shares = threading.Event(), []

    def progress(share: float) -> None:
        shares.append(share)
        cancel.set()

    with pytest.raises(CancelledError):
        render(balls(), Settings(samples=4096), progress=progress, cancel=cancel)
    assert len(shares) < 10


def test_time_limit_gives_the_picture_so_far():
    film = shot(samples=1 << 16, time_limit=0.3)
    assert rendering.STREAMS <= film.samples.min() <= film.samples.max() < 1 << 16
    with pytest.raises(RadError, match="at most 65536"):
        shot(samples=(1 << 16) + 1)
