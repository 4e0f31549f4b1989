# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiances from textbooks, and brute-force quadrature of ∫ L cos θ dω where books end.

Expected values are written out here from the equations, with nothing of the package in them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from blender_rad.lights import LIGHTS, Light, LightRecord, light_from_record
from blender_rad.lights._emission import blackbody_rgb
from blender_rad.lights.area import AreaLight
from blender_rad.lights.mesh import MeshLight
from blender_rad.lights.point import PointLight
from blender_rad.lights.spot import SpotLight
from blender_rad.lights.sun import SunLight
from blender_rad.lights.world import WorldLight
from tests.handmade import ball, moved

EXACT = 1e-12
BRUTE = 1e-6
FACETS = 0.01  # a ball of 4032 triangles, seen from 512 points
WHITE = np.ones(3)
UP, DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
ORIGIN = np.zeros(3)


def lit(kind: str, matrix: Any = None, unit: float = 1.0, model: Any = "cycles", **given) -> Light:
    """Return the light of a record, 2 bu above the origin where nothing else is said."""
    place = moved(z=2.0) if matrix is None else np.asarray(matrix, dtype=float)
    light = light_from_record(LightRecord("Light", kind, given, place, unit, (4, 5, 0)), model)
    assert light is not None
    return light


def irradiance(light: Light, place: Any, normal: Any) -> float:
    n = np.asarray(normal, dtype=float)
    exact = light.irradiance(np.array([place], dtype=float), (n / np.linalg.norm(n))[None])
    assert exact is not None
    return float(light.rgb[0] * exact[0])


def point(power: float, *at: float, **fields: Any) -> PointLight:
    return PointLight(name="p", rgb=power * WHITE, position=np.array(at), **fields)


def rectangle(a: float, b: float, h: float, **fields: Any) -> AreaLight:
    """Return a rectangle a by b at height h that shines down, with L = 1/(πA)."""
    axes = {"axis_u": np.array([a, 0.0, 0.0]), "axis_v": np.array([0.0, b, 0.0])}
    return AreaLight(name="a", rgb=WHITE, center=h * UP, direction=DOWN, **axes, **fields)


def mesh(triangles: Any, rgb: float = 1.0) -> MeshLight:
    return MeshLight(name="m", rgb=rgb * WHITE, triangles=np.asarray(triangles, dtype=float))


def emitting_box() -> MeshLight:
    c = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh([c[list(t)] for a, b, d, e in quads for t in ((a, b, d), (a, d, e))])


SPOT = {"energy": 1.0, "shadow_soft_size": 0.0}
Known = tuple[str, Light, Any, Any, float]


def points_and_spots() -> Iterator[Known]:
    lamp = point(10.0, 0.0, 0.0, 3.0)
    yield "inverse square", lamp, (4, 0, 0), UP, 30.0 / (4.0 * np.pi * 5.0**3)
    yield "from behind", lamp, (0, 0, 4), UP, 0.0
    for model, distance_squared in (("physical", 4.0), ("cycles", 4.09)):
        # r = 0.3, d = 2: a soft disc reads d²/(d²+r²) = 0.97800 of the sphere, as Cycles shows.
        soft = lit('POINT', model=model, energy=1.0, shadow_soft_size=0.3)
        yield f"falloff of {model}", soft, ORIGIN, UP, 1.0 / (4.0 * np.pi * distance_squared)
    for normal in (UP, (1, -2, 0.3)):  # πL
        inside = point(8.0, 0.0, 0.0, 0.0, radius=2.0)
        yield "inside a sphere", inside, (0.5, 0.3, -1), normal, 8.0 / (4.0 * np.pi * 4.0)
    a = np.pi / 6.0  # asin(r/d), its centre in the receiver's plane: E/L = a - sin a cos a
    expected = (a - np.sin(a) * np.cos(a)) / (4.0 * np.pi**2)
    yield "half below the horizon", point(1.0, 2.0, 0.0, 0.0, radius=1.0), ORIGIN, UP, expected
    cos = 0.75 * np.cos(0.6) + 0.25  # midway on the ramp of a blend of 0.5 the smoothstep is ½
    spot = lit('SPOT', spot_size=1.2, spot_blend=0.5, **SPOT)
    place = (2.0 * np.tan(np.arccos(cos)), 0, 0)
    yield "mid ramp", spot, place, UP, 0.5 / (4.0 * np.pi * 4.0) * cos**3
    # A scaled cone's tangents along x and y are its own, times scale over the scale along z.
    stretched = moved(z=1.0) @ np.diag([2.0, 1.0, 0.5, 1.0])
    spot = lit('SPOT', stretched, spot_size=np.pi / 3, spot_blend=0, **SPOT)
    for edge in np.tan(np.pi / 6.0) * np.array([[4.0, 0, 0], [0, 2.0, 0]]):
        yield "outside of an elliptic cone", spot, 1.001 * edge, UP, 0.0
        place, d = 0.999 * edge, np.hypot(1.0, 0.999 * np.linalg.norm(edge))
        yield "inside of an elliptic cone", spot, place, UP, 1.0 / (4.0 * np.pi * d**3)
    spot = SpotLight(
        name="s", rgb=WHITE, position=np.array([0, 0, 2.0]), radius=0.1, blend=0.2,
        light_from_world=np.eye(3), cos_half_angle=np.cos(0.5),
    )  # fmt: skip
    yield "all of a ball in the cone", spot, ORIGIN, UP, 1.0 / (16.0 * np.pi)
    yield "a ball beside the cone", spot, (2.0, 0, 0), UP, 0.0
    yield "a ball on the cone's edge", spot, (2.0 * np.tan(0.5), 0, 0), UP, np.nan


def areas() -> Iterator[Known]:
    def corner_factors(x: float, y: float) -> Any:
        """Below a corner at height 1, parallel and perpendicular (Howell, B-3 and B-4)."""
        p, q = np.sqrt(1.0 + x * x), np.sqrt(1.0 + y * y)
        parallel = x / p * np.arctan(y / p) + y / q * np.arctan(x / q)
        return np.array([parallel, np.arctan(y) - np.arctan(y / p) / p]) / (2.0 * np.pi)

    for a, b, h in ((1.0, 1.0, 3.0), (2.0, 0.3, 0.5), (1e-4, 1e-4, 1.0)):
        light, corner = rectangle(a, b, h), (-a / 2.0, -b / 2.0, 0.0)
        parallel, across = corner_factors(a / h, b / h) / (a * b)
        yield "rectangle over floor", light, corner, UP, parallel
        yield "rectangle over wall", light, corner, (1, 0, 0), across
        yield "behind a rectangle", light, (0, 0, 2.0 * h), DOWN, 0.0
    r, h = 0.7, 1.1
    light = rectangle(2.0 * r, 2.0 * r, h, ellipse=True)
    for x in (0.0, 0.3, 0.9, 3.0):  # F = ½[1 - (x²+h²-r²)/√((x²+h²+r²)²-4x²r²)]
        q = x * x + h * h
        factor = 0.5 * (1.0 - (q - r * r) / np.sqrt((q + r * r) ** 2 - 4.0 * x * x * r * r))
        yield "disc", light, (x, 0, 0), UP, factor / (np.pi * r * r)
    beam = rectangle(2.0, 1.0, 5.0, spread=0.0)
    yield "tilted in a parallel beam", beam, (0.9, 0.4, 0), (1, 0, 1), 0.5 / np.sqrt(2.0)
    yield "beside a parallel beam", beam, (1.1, 0.4, 0), UP, 0.0
    yield "behind a parallel beam", beam, (0.9, 0.4, 6.0), DOWN, 0.0
    stated = {"normalize": False, "energy": 3.0}  # P/π is radiance: no unit scale, in either model
    square = {"shape": 'SQUARE', "size": 2.0, "spread": np.pi}
    ball = {"shadow_soft_size": 9.0, "use_soft_falloff": False}
    for model in ("physical", "cycles"):
        light = lit('AREA', None, 0.01, model=model, **stated, **square)
        yield "a stated radiance", light, ORIGIN, UP, 12.0 * corner_factors(0.5, 0.5)[0]
        light = lit('POINT', None, 0.01, model=model, **stated, **ball)
        yield "inside a stated radiance", light, ORIGIN, UP, 3.0


def far_and_wide() -> Iterator[Known]:
    here = np.eye(4)
    for angle in (0.0, 0.01, 1.0, np.pi):
        light = lit('SUN', here, energy=3.0, angle=angle)
        yield "a sun's energy", light, ORIGIN, UP, 3.0
        if angle < np.pi / 3:
            yield "a low sun", light, ORIGIN, (np.sqrt(3.0), 0, 1), 1.5
    stated = lit('SUN', here, energy=3.0, angle=1.0, normalize=False)
    yield "a sun's radiance", stated, ORIGIN, UP, 3.0 * np.pi * np.sin(0.5) ** 2
    sky = SunLight(name="s", rgb=WHITE, towards=np.array([0, 0, 1.0]), half_angle=np.pi / 2)
    for tilt in (0.0, 0.5, np.pi / 2, 2.5):
        tilted = np.sin(tilt), 0, np.cos(tilt)
        yield "half a sky", sky, ORIGIN, tilted, 0.5 * (1.0 + np.cos(tilt))
    yield "a world", WorldLight(name="World", rgb=0.5 * WHITE), ORIGIN, (1, 2, 3), 0.5 * np.pi
    for normal in (UP, (1, 2, -3)):
        yield "in a box that glows", emitting_box(), (0.3, -0.5, 0.2), normal, np.pi


KNOWN = [*points_and_spots(), *areas(), *far_and_wide()]


@pytest.mark.parametrize(("name", "light", "place", "normal", "expected"), KNOWN)
def test_irradiance(name, light, place, normal, expected):
    found = irradiance(light, place, normal)
    assert found == pytest.approx(expected, rel=EXACT, abs=1e-12, nan_ok=True), name


@pytest.mark.parametrize("spread", [0.05, 0.0999, 0.101, 1.0, 3.0])
@pytest.mark.parametrize("series", [True, False])
def test_spread_flux_by_quadrature(spread, series):
    light, width = rectangle(1.0, 1.0, 1.0, spread=spread, series=series), 0.5 * spread / 20000
    theta = (np.arange(20000) + 0.5) * width
    towards = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=1)
    _, radiance = light.intersect(UP - 1e-3 * towards, towards)
    flux = 2.0 * np.pi * np.sum(radiance * np.sin(theta) * np.cos(theta)) * width
    assert light.radiant_flux()[0] == pytest.approx(flux, rel=1e-6)
    more = 0.4 * (0.5 * spread) ** 2 if series and spread <= 0.1 else 0.0
    assert flux == pytest.approx(1.0 + more, rel=1e-5 if more else 1e-6)


def test_physical_sheared_area_is_the_true_parallelogram():
    matrix = np.eye(4)
    matrix[:3, :3] = [[1.0, 0.6, 0.0], [0.0, 0.8, 0.2], [0.0, 0.0, 1.0]]
    wanted = {"energy": 2.0, "shape": 'SQUARE', "size": 1.0, "spread": np.pi}
    physical, cycles = (lit('AREA', matrix, model=m, **wanted) for m in ("physical", "cycles"))
    assert isinstance(physical, AreaLight) and isinstance(cycles, AreaLight)
    assert physical.notes == cycles.notes == ("area-sheared",)
    assert physical.area == pytest.approx(0.8)
    assert cycles.area == pytest.approx(1.0)
    assert cycles.irradiance(np.zeros((1, 3)), np.zeros((1, 3))) is None
    place = (0.5, -0.3, -2)
    e, f = matrix[:3, 0], matrix[:3, 1]
    corners = np.array([-e - f, e - f, e + f, f - e]) / 2.0
    quads = mesh(corners[[[0, 1, 2], [0, 2, 3]]], 2.0 / (np.pi * 0.8))
    for normal in (UP, (1, 0, 0.3)):
        expected = irradiance(quads, place, normal)
        assert irradiance(physical, place, normal) == pytest.approx(expected, rel=1e-10)


def test_what_leaves_a_mesh():
    """A sheet: all, twice; a ball: its outside; a bowl: the inside's view of the opening is ½."""
    globe = ball()
    corners = globe.vertices.astype(float)[globe.triangles]
    bowl = corners[corners[..., 2].min(axis=1) >= -1e-6]
    sheet = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    for triangles, area, share, shadow, tolerance in (
        (sheet, 1.0, 1.0, 1.0, EXACT),
        (corners, 4.0 * np.pi, 0.5, np.pi, FACETS),
        (bowl, 2.0 * np.pi, 0.75, np.pi, FACETS),
    ):
        light, expected = mesh(triangles), 2.0 * np.pi * area * share
        assert light.leaving_flux()[0] == pytest.approx(expected, rel=tolerance)
        assert light.peak_radiant_intensity()[0] == pytest.approx(shadow, rel=tolerance)


# --- every closed form against brute force


@pytest.mark.parametrize("distance", [1.01, 1.1, 3.0, 10.0])
def test_noise_next_to_a_mesh_of_many_triangles_is_bounded(distance):
    """A unit ball of 2048 triangles over a facing point sends πL/d²; what hides itself is not lit.

    By area alone the deviation of a sample is 70 times its mean at 1.01.
    """
    faces = np.array([np.diag(2.0 * np.array(s) - 1.0) for s in np.ndindex(2, 2, 2)])
    for _ in range(4):
        a, b, c = faces.swapaxes(0, 1)
        d, e, f = (x / np.linalg.norm(x, axis=1)[:, None] for x in (a + b, b + c, c + a))
        parts = (a, d, f), (d, b, e), (f, e, c), (d, e, f)
        faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    light, u = mesh(faces), np.random.default_rng(1).random((40_000, 2))
    places, normals = (np.tile(x, (len(u), 1)) for x in (-distance * UP, UP))
    sample = light.sample(places, normals, u)
    first, _ = light.intersect(places, sample.wi)
    value = sample.weight * np.maximum(sample.wi @ UP, 0.0) * (sample.distance < 1.0001 * first)
    assert value.mean() == pytest.approx(np.pi / distance**2, rel=0.02)
    assert value.std() < 2.5 * value.mean()


@pytest.mark.parametrize("copies", [1, 5, 19])
def test_doubled_and_flat_triangles_do_no_harm(copies):
    corners = np.array([[-0.5, -0.4, 1.0], [0.6, -0.3, 1.0], [0.1, 0.7, 1.0]])
    light = mesh([np.tile(corners[:1], (3, 1)), *[corners] * copies])
    u = np.random.default_rng(copies).random((2000, 2))
    sample = light.sample(np.zeros((len(u), 3)), np.tile(UP, (len(u), 1)), u)
    assert np.isfinite(sample.weight).all() and sample.weight.any()


def brute_force(light: Light, place: np.ndarray, normal: np.ndarray, axis: np.ndarray) -> float:
    """Return ∫ L cos θ dω by midpoints in azimuth about `axis` and Gauss in the polar angle.

    Along each meridian the edge of the light and of the horizon is found by bisection of the
    integrand's support from the axis outwards.
    """
    azimuths = 4096
    phi = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    frame = np.linalg.svd(axis[None])[2][1:]
    side = np.cos(phi)[:, None] * frame[0] + np.sin(phi)[:, None] * frame[1]

    def values(polar: np.ndarray) -> np.ndarray:
        wi = np.cos(polar)[:, None] * axis + np.sin(polar)[:, None] * side
        _, radiance = light.intersect(np.tile(place, (len(wi), 1)), wi)
        return radiance * np.maximum(wi @ normal, 0.0)

    inner, outer = np.zeros(azimuths), np.full(azimuths, np.pi)
    for _ in range(32):
        middle = 0.5 * (inner + outer)
        lit = values(middle) > 0.0
        inner, outer = np.where(lit, middle, inner), np.where(lit, outer, middle)
    total = 0.0
    for node, weight in zip(*np.polynomial.legendre.leggauss(20), strict=True):
        polar = 0.5 * inner * (node + 1.0)
        total += (0.5 * inner * weight * values(polar) * np.sin(polar)).sum()
    return float(total * 2.0 * np.pi / azimuths)


BRUTE_CASES = [
    pytest.param(light, id=f"{kind}-{light.name}")
    for kind in ('POINT', 'SPOT', 'AREA', 'SUN', 'MESH')
    for light in LIGHTS[kind].examples()
    if not light.is_delta and light.irradiance(np.zeros((1, 3)), np.eye(3)[:1]) is not None
    if light.name not in ("tetrahedron", "sun")
]


@pytest.mark.parametrize("light", BRUTE_CASES)
def test_closed_forms_by_brute_force(light):
    tried = 0
    for place in np.array([[-0.9, 0.0, 0.1], [-0.4, 0.5, 0.3]]):
        middle = light.triangles.mean(axis=(0, 1)) if light.kind == 'MESH' else [0.2, -0.1, 1.5]
        axis = light.towards if light.kind == 'SUN' else middle - place
        axis = axis / np.linalg.norm(axis)
        across = np.linalg.svd(axis[None])[2][1]
        for tilt in (0.6, 1.5):  # the axis stays above the horizon, so that support is a star
            normal = np.cos(tilt) * axis + np.sin(tilt) * across
            (exact,) = light.irradiance(place[None], normal[None])
            if np.isfinite(exact) and exact > 0.0:
                assert exact == pytest.approx(brute_force(light, place, normal, axis), rel=BRUTE)
                tried += 1
    assert tried >= 1


# --- the two models, and what a record says


def test_blackbody_has_luminance_one_and_blenders_colour():
    """Blender 4.5 and 5.2 give (1.770834, 0.844285, 0.272223) at 3000 K."""
    assert np.allclose(blackbody_rgb(3000.0), [1.770834, 0.844285, 0.272223], rtol=1e-3)
    assert blackbody_rgb(6500.0) @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0, rel=1e-3)
    assert np.array_equal(blackbody_rgb(20000.0), blackbody_rgb(12000.0))
