# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes whose light is known on paper, to 0.1 %: in pictures, on meters, within their own errors.

Among them the direct cases of CIE 171:2006, sections 5.2 to 5.4, 5.6 and 5.7, with numbers derived
here.
"""

import itertools

import numpy as np
import pytest

from blender_rad.lights import Light
from blender_rad.lights.point import PointLight
from blender_rad.lights.sun import SunLight
from blender_rad.meters import LuxMeter, grid
from blender_rad.rendering import Settings, render
from blender_rad.scene import Camera, Instance, Scene, World
from tests import handmade
from tests.handmade import moved, scene, square

PROMISE = 1e-3  # CONTRACT: closed forms agree to 0.1 %
ONE = np.ones(3)
TINY = 1e-3  # half width [bu] of a picture of one point
UP, WEST = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
ORIGIN = np.zeros((1, 3))


def facing(towards, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """The matrix of a square at `at` whose normal points along `towards`."""
    z = np.array(towards) / np.linalg.norm(towards)
    x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.stack([x, np.cross(z, x), z, at], axis=1)
    return matrix


FLOOR, WALL, TILTED = (facing(n) for n in ((0, 0, 1), (0, 1, 0), (0, np.sin(1.0), np.cos(1.0))))


def built(lights: list[Light], squares=(), **others) -> Scene:
    """A scene of lights and of grey squares, each (half width, matrix)."""
    meshes = [square(half) for half, _ in squares]
    placed = [Instance(f"b{k}", k, m, (0,)) for k, (_, m) in enumerate(squares)]
    return scene(meshes, placed, lights, **others)


def lux(made: Scene, points=ORIGIN, normals=UP, **options) -> np.ndarray:
    """What meters read [lx], at 1 lm/W: W/m² of white light; checks that errors hold."""
    meter = LuxMeter(made, efficacy=1.0, threads=1, **options)
    read = meter.read(np.asarray(points, float), np.broadcast_to(normals, np.shape(points)))
    assert not read.unreached.any()
    np.testing.assert_allclose(read.illuminance, read.irradiance @ made.luminance_weights)
    return read.illuminance


def pictured(made: Scene) -> float:
    """What a picture shows to arrive; also checks its radiance."""
    film = render(made, Settings(samples=512, threads=1))
    np.testing.assert_allclose(film.radiance, film.irradiance * 0.8 / np.pi, rtol=1e-9)
    return float(film.irradiance[..., 0].mean())


def lamp(intensity: float, z: float = 2.0, **others) -> PointLight:
    """A point light of so many W/sr."""
    place = np.array([0.0, 0.0, z])
    return PointLight(name="lamp", rgb=4 * np.pi * intensity * ONE, position=place, **others)


def panel(radiance: float, width: float, depth: float, z: float = 2.0, at=(0, 0), **others):
    return handmade.panel(np.pi * width * depth * radiance, (*at, z), width, depth, **others)


def sun(half_angle: float) -> SunLight:
    towards = np.array([0.0, 0.6, 0.8])
    return SunLight(name="sun", rgb=3.0 * ONE, towards=towards, half_angle=half_angle)


def quadrature(half_width: float, half_depth: float, z: float, points, normal, *, at=(0, 0)):
    """E/L of a downward rectangle by the midpoint rule: ∫ cosθ cosθ' / d² dA, (points,)."""
    n = 200
    x = (np.arange(n) + 0.5) / n * 2 - 1
    source = np.meshgrid(at[0] + x * half_width, at[1] + x * half_depth, [z])
    area = 4 * half_width * half_depth / n**2
    to = np.stack(source, -1).reshape(-1, 3)[None] - np.asarray(points)[:, None]
    d2 = np.sum(to**2, axis=2)
    cosines = np.maximum(to @ np.asarray(normal), 0.0) * np.maximum(to[..., 2], 0.0)
    return np.sum(cosines / d2**2, axis=1) * area


def rectangle(half_width: float, half_depth: float, normal=(0, 0, 1), at=(0, 0)) -> float:
    return float(quadrature(half_width, half_depth, 2.0, ORIGIN, normal, at=at)[0])


SKY = {"world": World(radiance=(2.0, 2.0, 2.0))}
BOARD = (5.0, moved(x=5.0, z=1.0))  # ends on the lights' middle line
# Receiver, what lights it, what stands about, what arrives.
KNOWN = {
    "tilted": (TILTED, lamp(10.0), [], 10 / 4 * np.cos(1.0)),
    "sphere": (FLOOR, lamp(10.0, radius=0.7), [], 10 / 4),
    "soft falloff": (FLOOR, lamp(10.0, radius=0.3, soft_falloff=True), [], 10 / 4.09),
    "rectangle": (FLOOR, panel(5.0, 1.0, 0.6), [], 5 * rectangle(0.5, 0.3)),
    "rectangle on a wall": (
        WALL, panel(5.0, 1.0, 0.8, at=(0.5, 0.4)), [],
        5 * rectangle(0.5, 0.4, (0, 1, 0), at=(0.5, 0.4)),
    ),
    "disc": (FLOOR, panel(5.0, 1.2, 1.2, ellipse=True), [], 20 * 0.36 / 4.36),
    "wide sun": (FLOOR, sun(0.1), [], 3 * 0.8),
    "half of the sky": (FLOOR, SKY, [(1e4, facing((0, 1, 0), at=(0, -0.01, 0)))], np.pi),
    "half of a panel": (FLOOR, panel(5.0, 1.0, 1.0), [BOARD], 2.5 * rectangle(0.5, 0.5)),
    "no shadow": (FLOOR, lamp(10.0, cast_shadow=False), [(5.0, moved(z=1.0))], 10 / 4),
    "under a board": (FLOOR, panel(5.0, 1.0, 1.0), [(9.0, moved(z=0.5))], 0.0),
}  # fmt: skip


@pytest.mark.parametrize("case", KNOWN)
def test_what_arrives(case):
    receiver, light, squares, expected = KNOWN[case]
    lights, others = ([], light) if isinstance(light, dict) else ([light], {})
    lens = (-TINY, TINY, -TINY, TINY), (1e-4, 1.0)
    camera = Camera("view", "orthographic", receiver @ moved(z=0.01), *lens)
    options = {"camera": camera, "resolution": (8, 8), **others}
    made = built(lights, [(2 * TINY, receiver), *squares], **options)
    assert pictured(made) == pytest.approx(expected, rel=PROMISE)
    read = lux(made, ORIGIN, receiver[:3, 2])
    assert read == pytest.approx(expected, rel=PROMISE, abs=1e-9)


def test_cie_171_5_2_point_and_lambertian_source():
    """1000 cd, 3 m over 4 × 4 m: E = I h/d³, and I₀ h²/d⁴ for a small Lambertian source."""
    cells = grid(np.array([-2.0, -2.0, 0.0]), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), 0.5)
    d = np.linalg.norm(cells.points - (0, 0, 3), axis=1)
    assert lux(built([lamp(1000.0, 3.0)])) == pytest.approx(111.1111, rel=1e-6)
    np.testing.assert_allclose(lux(built([lamp(1000.0, 3.0)]), cells.points), 3000 / d**3)
    small = panel(1000.0 / 1e-4, 0.01, 0.01, 3.0)
    np.testing.assert_allclose(lux(built([small]), cells.points), 9000 / d**4, rtol=PROMISE)


def test_cie_171_5_3_area_source_on_floor_and_walls():
    """1 × 1 m of 1000 cd/m² in the ceiling of a room of 4 × 4 × 3 m."""
    made = built([panel(1000.0, 1.0, 1.0, 3.0)])
    floor = [(x, 0.3, 0.0) for x in (0.0, 0.5, 1.0, 1.9)]
    wall = [(-2.0, y, z) for y, z in ((0.0, 0.5), (1.0, 1.5), (1.9, 2.7))]
    for points, normal in ((floor, UP), (wall, WEST)):
        expected = 1000.0 * quadrature(0.5, 0.5, 3.0, points, normal[0])
        np.testing.assert_allclose(lux(made, points, normal), expected, rtol=PROMISE)


def test_cie_171_5_4_all_the_flux_arrives_in_a_closed_room():
    """Σ E A = Φ over the six faces of a black room of 4 × 4 × 3 m, a 10 000 lm lamp at 1.5 m."""
    made = built([lamp(10_000 / (4 * np.pi), 1.5)])
    corner, edges, flux = np.array([-2.0, -2.0, 0.0]), np.diag([4.0, 4.0, 3.0]), 0.0
    for axis, side in itertools.product(range(3), (0, 1)):
        cells = grid(corner + side * edges[axis], *np.delete(edges, axis, axis=0), 0.1)
        flux += 0.01 * lux(made, cells.points, (1 - 2 * side) * np.eye(3)[axis]).sum()
    assert flux == pytest.approx(10_000, rel=PROMISE)


def test_cie_171_5_6_and_5_7_an_opening_without_and_with_an_obstruction():
    """A uniform emitter behind a hole of 2 × 2 m; then a board that hides one half of it."""
    wide = 50.0
    around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    roof = [(wide, moved(x * (wide + 1), y * (wide + 1), 3.0)) for x, y in around]
    behind = panel(2.0, 3.2, 3.2, 3.5)  # no larger than is seen through the hole
    points = [(0.0, 0.0, 0.0), (1.5, 0.5, 0.0)]
    expected = 2.0 * quadrature(1.0, 1.0, 3.0, points, UP[0])
    read = lux(built([behind], roof), points, error=3e-4)
    np.testing.assert_allclose(read, expected, rtol=PROMISE)
    half = [*roof, (wide, moved(wide, 0.0, 2.999))]
    assert lux(built([behind], half), error=3e-4)[0] == pytest.approx(expected[0] / 2, rel=PROMISE)


def test_error_bars_hold_in_half_shadow():
    """A board hides a share of a panel that differs from meter to meter: 95 % within 1.96 errors.

    The truth is the same panel, cut where the board's edge is seen from the meter.
    """
    board = (50.0, moved(x=50.0, z=1.0))  # covers x > 0 at half the panel's height
    points = np.stack([np.linspace(-0.45, 0.45, 400), *np.zeros((2, 400))], axis=1)
    made = built([panel(1.0, 1.0, 1.0)], [board])
    read = LuxMeter(made, efficacy=1.0, error=0.02).read(points, np.broadcast_to(UP, points.shape))
    truth = []
    for x in points[:, 0]:  # what is seen of the panel: from -0.5 to -x
        part = panel(1.0, 0.5 - x, 1.0)
        truth.append(part.rgb[0] * part.irradiance(np.array([[0.25 + 1.5 * x, 0.0, 0.0]]), UP)[0])
    z = (read.illuminance - truth) / read.standard_error
    assert 0.91 < np.mean(np.abs(z) < 1.96) < 0.99  # 4 standard errors of 95 % in 400
    assert abs(z.mean()) < 4 / np.sqrt(400)
