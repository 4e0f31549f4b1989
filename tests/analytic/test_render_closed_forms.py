# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures whose irradiance is known on paper, to 0.1 % and within their own errors."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.lights import Light
from blender_rad.lights.area import AreaLight
from blender_rad.lights.point import PointLight
from blender_rad.lights.sun import SunLight
from blender_rad.rendering import Settings, render
from blender_rad.scene import Camera, Instance, World
from tests.handmade import ball, camera_above, moved, scene, square

PROMISE = 1e-3  # CONTRACT: closed forms agree to 0.1 %
ONE = np.ones(3)
TINY = 1e-3  # half width [bu] of the view: the picture is one point of the receiver


def view_of(world_from_receiver: np.ndarray) -> Camera:
    """A camera that looks at the origin of a receiver along its normal, from very near."""
    camera = world_from_receiver @ moved(z=0.01)
    return Camera("view", "orthographic", camera, (-TINY, TINY, -TINY, TINY), (1e-4, 1.0))


def irradiance_at(receiver: np.ndarray, lights: list[Light], blockers=(), **others) -> float:
    """Mean irradiance that `render` finds at the origin of `receiver`; also checks its radiance."""
    meshes = [square(2 * TINY), *(mesh for mesh, _ in blockers)]
    instances = [Instance("receiver", 0, receiver, (0,))]
    instances += [Instance("blocker", k + 1, m, (0,)) for k, (_, m) in enumerate(blockers)]
    made = scene(meshes, instances, lights, view_of(receiver), resolution=(8, 8), **others)
    film = render(made, Settings(samples=512, threads=1))
    np.testing.assert_allclose(film.radiance, film.irradiance * 0.8 / np.pi, rtol=1e-9)
    return float(film.irradiance[..., 0].mean())


def facing(towards: tuple[float, float, float], at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """The matrix of a receiver at `at` whose normal points along `towards`."""
    z = np.array(towards) / np.linalg.norm(towards)
    x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, np.cross(z, x), z, at
    return matrix


FLOOR = facing((0.0, 0.0, 1.0))
WALL = facing((0.0, 1.0, 0.0))


def ceiling_light(width: float = 1.0, depth: float = 1.0, ellipse: bool = False, **at) -> AreaLight:
    """An area light of 100 W that shines down."""
    return AreaLight(
        name="area",
        rgb=100.0 * ONE,
        center=np.array([at.get("x", 0.0), at.get("y", 0.0), at.get("z", 2.0)]),
        axis_u=np.array([width, 0.0, 0.0]),
        axis_v=np.array([0.0, -depth, 0.0]),
        direction=np.array([0.0, 0.0, -1.0]),
        ellipse=ellipse,
    )


def corner_factor_parallel(a: float, b: float, h: float) -> float:
    """Configuration factor of a rectangle a × b, one corner h over the receiver (textbook)."""
    a, b = a / h, b / h
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return float((a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi))


def corner_factor_perpendicular(width: float, depth: float, height: float) -> float:
    """Configuration factor of a rectangle perpendicular to the receiver (textbook).

    The receiver lies at distance `depth` in front of the lower corner of a rectangle `width` wide
    and `height` high, its normal parallel to the rectangle and along its height.
    """
    slant = np.hypot(depth, height)
    flat = np.arctan(width / depth)
    return float((flat - depth / slant * np.arctan(width / slant)) / (2 * np.pi))


def test_point_light_falls_with_the_square_of_distance() -> None:
    light = PointLight(name="p", rgb=10.0 * ONE, position=np.array([0.0, 0.0, 2.0]))
    assert irradiance_at(FLOOR, [light]) == pytest.approx(10 / (4 * np.pi * 4), rel=1e-6)


def test_tilted_receiver_gets_the_cosine() -> None:
    light = PointLight(name="p", rgb=10.0 * ONE, position=np.array([0.0, 0.0, 2.0]))
    tilted = facing((0.0, np.sin(1.0), np.cos(1.0)))
    expected = 10 / (16 * np.pi) * np.cos(1.0)
    assert irradiance_at(tilted, [light]) == pytest.approx(expected, rel=1e-6)


def test_sphere_light_sends_what_its_centre_would() -> None:
    light = PointLight(name="p", rgb=10.0 * ONE, position=np.array([0.0, 0.0, 2.0]), radius=0.7)
    assert irradiance_at(FLOOR, [light]) == pytest.approx(10 / (16 * np.pi), rel=PROMISE)


def test_soft_falloff_is_a_disc_that_faces_the_receiver() -> None:
    light = PointLight(
        name="p", rgb=10.0 * ONE, position=np.array([0.0, 0.0, 2.0]), radius=0.3, soft_falloff=True
    )
    expected = 10 / (4 * np.pi * (4 + 0.09))
    assert irradiance_at(FLOOR, [light]) == pytest.approx(expected, rel=PROMISE)


def test_rectangle_on_the_floor() -> None:
    light = ceiling_light(1.0, 0.6)
    factor = 4 * corner_factor_parallel(0.5, 0.3, 2.0)
    expected = 100 / (np.pi * 0.6) * np.pi * factor
    assert irradiance_at(FLOOR, [light]) == pytest.approx(expected, rel=PROMISE)


def test_rectangle_on_a_wall() -> None:
    # 1 wide (x from 0 to 1), reaching from the wall's plane 0.8 into the room, 2 above the point.
    light = ceiling_light(1.0, 0.8, x=0.5, y=0.4)
    factor = corner_factor_perpendicular(1.0, 2.0, 0.8)
    expected = 100 / (np.pi * 0.8) * np.pi * factor
    assert irradiance_at(WALL, [light]) == pytest.approx(expected, rel=PROMISE)


def test_disc_over_the_axis() -> None:
    light = ceiling_light(1.2, 1.2, ellipse=True)
    radiance = 100 / (np.pi * np.pi * 0.36)
    expected = np.pi * radiance * 0.36 / (0.36 + 4)
    assert irradiance_at(FLOOR, [light]) == pytest.approx(expected, rel=PROMISE)


def test_sun_by_the_cosine_of_its_height() -> None:
    towards = np.array([0.0, 0.6, 0.8])
    for half_angle in (0.0, np.radians(5.0)):
        light = SunLight(name="s", rgb=3.0 * ONE, towards=towards, half_angle=half_angle)
        assert irradiance_at(FLOOR, [light]) == pytest.approx(3 * 0.8, rel=PROMISE)


def test_uniform_sky_half_blocked() -> None:
    """A wide wall from the floor up leaves half of the sky: E = πL/2."""
    wall = (square(1e4), facing((0.0, 1.0, 0.0), at=(0.0, -0.01, 0.0)))
    sky = World(radiance=(2.0, 2.0, 2.0))
    assert irradiance_at(FLOOR, [], [wall], world=sky) == pytest.approx(np.pi, rel=PROMISE)


def test_area_light_half_hidden_by_a_board() -> None:
    """A board that ends on the light's middle line hides one half of it."""
    light = ceiling_light(1.0, 1.0)
    board = (square(5.0), moved(x=5.0, z=1.0))
    expected = 100 / np.pi * np.pi * 2 * corner_factor_parallel(0.5, 0.5, 2.0)
    assert irradiance_at(FLOOR, [light], [board]) == pytest.approx(expected, rel=PROMISE)


def test_board_throws_no_shadow_when_the_light_has_none() -> None:
    light = PointLight(
        name="p", rgb=10.0 * ONE, position=np.array([0.0, 0.0, 2.0]), cast_shadow=False
    )
    board = (square(5.0), moved(z=1.0))
    assert irradiance_at(FLOOR, [light], [board]) == pytest.approx(10 / (16 * np.pi), rel=1e-6)


def test_furnace() -> None:
    """A convex body of albedo 1 under a uniform sky cannot be told from the sky."""
    from blender_rad.scene import Material

    made = scene(
        [ball(16, 32, smooth=False)],
        [Instance("ball", 0, np.eye(4), (0,))],
        [],
        camera_above(10.0, 2.0),
        [Material("white", albedo=(1.0, 1.0, 1.0))],
        world=World(radiance=(1.0, 1.0, 1.0)),
    )
    film = render(made, Settings(samples=64))
    np.testing.assert_allclose(film.radiance, 1.0, rtol=1e-6)
