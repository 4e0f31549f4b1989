# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiances from textbooks, and brute-force quadrature of ∫ L cos θ dω where books end.

Expected values are written out here from the equations, with nothing of the package in them.
"""

from __future__ import annotations

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
from tests.handmade import ball

EXACT = 1e-12
BRUTE = 1e-6
FACETS = 0.01  # a ball of 4032 triangles, seen from 512 points
WHITE = np.ones(3)
DOWN = np.array([0.0, 0.0, -1.0])


def record(
    kind: str, matrix: Any = None, unit_scale_m: float = 1.0, **properties: Any
) -> LightRecord:
    place = np.eye(4) if matrix is None else np.asarray(matrix, dtype=float)
    if matrix is None:
        place[2, 3] = 2.0
    return LightRecord("Light", kind, properties, place, unit_scale_m, (4, 5, 0))


def irradiance(light: Light, place: Any, normal: Any) -> float:
    n = np.asarray(normal, dtype=float)
    exact = light.irradiance(np.array([place], dtype=float), (n / np.linalg.norm(n))[None])
    assert exact is not None
    return float(light.rgb[0] * exact[0])


def at_origin(light: Light, normal: Any = (0, 0, 1)) -> float:
    return irradiance(light, (0, 0, 0), normal)


def lit(*of_record: Any, model: Any = "cycles", **properties: Any) -> Light:
    """Return the light of a record."""
    light = light_from_record(record(*of_record, **properties), model)
    assert light is not None
    return light


# --- point and spot: inverse square, sphere, soft falloff, cone


def test_point_is_the_inverse_square_law() -> None:
    light = PointLight(name="p", rgb=10.0 * WHITE, position=np.array([0.0, 0.0, 3.0]))
    for x in (0.0, 1.0, 4.0):
        d = np.hypot(x, 3.0)
        expected = 10.0 / (4.0 * np.pi * d**2) * 3.0 / d
        assert irradiance(light, (x, 0, 0), (0, 0, 1)) == pytest.approx(expected, rel=EXACT)
    assert irradiance(light, (0, 0, 4), (0, 0, 1)) == 0.0


def test_soft_falloff_at_two_metres() -> None:
    """r = 0.3, d = 2: a disc reads d²/(d²+r²) = 0.97800 of the sphere, the number Cycles shows."""
    properties = {"energy": 1.0, "shadow_soft_size": 0.3}
    soft, ball = (lit('POINT', model=model, **properties) for model in ("cycles", "physical"))
    assert at_origin(ball) == pytest.approx(1.0 / (16.0 * np.pi), rel=EXACT)
    assert at_origin(soft) / at_origin(ball) == pytest.approx(4.0 / 4.09, rel=EXACT)
    assert round(at_origin(soft) / at_origin(ball), 5) == 0.978


def test_inside_a_sphere_it_is_pi_l() -> None:
    light = PointLight(name="p", rgb=8.0 * WHITE, position=np.zeros(3), radius=2.0)
    radiance = 8.0 / (4.0 * np.pi**2 * 2.0**2)
    for normal in ((0, 0, 1), (1, -2, 0.3)):
        assert irradiance(light, (0.5, 0.3, -1), normal) == pytest.approx(np.pi * radiance)


def test_sphere_half_below_the_horizon() -> None:
    """Its centre in the plane of the receiver: E/L = a - sin a cos a, a = asin(r/d)."""
    light = PointLight(name="p", rgb=WHITE, position=np.array([2.0, 0.0, 0.0]), radius=1.0)
    a = np.pi / 6.0
    expected = (a - np.sin(a) * np.cos(a)) / (4.0 * np.pi**2)
    assert irradiance(light, (0, 0, 0), (0, 0, 1)) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("half_deg", "blend"), [(30.0, 0.0), (30.0, 0.4), (80.0, 1.0)])
def test_spot_flux_and_axis(half_deg: float, blend: float) -> None:
    size = 2.0 * np.radians(half_deg)
    light = lit('SPOT', energy=5.0, spot_size=size, spot_blend=blend, shadow_soft_size=0)
    c = np.cos(np.radians(half_deg))
    expected = 5.0 * (1.0 - c) * (1.0 - blend / 2.0) / 2.0
    assert light.radiant_flux()[0] == pytest.approx(expected, rel=EXACT)
    assert at_origin(light) == pytest.approx(5.0 / (4.0 * np.pi * 4.0), rel=EXACT)


def test_spot_ramp_at_half_its_width() -> None:
    """Where cos θ is midway on the ramp the smoothstep is ½."""
    c, blend = np.cos(0.6), 0.5
    cos = c + 0.5 * (1.0 - c) * blend
    properties = {"energy": 1.0, "spot_size": 1.2, "spot_blend": blend, "shadow_soft_size": 0.0}
    light = lit('SPOT', **properties)
    place, d = (2.0 * np.sqrt(1.0 - cos**2) / cos, 0, 0), 2.0 / cos
    expected = 0.5 / (4.0 * np.pi * d**2) * cos
    assert irradiance(light, place, (0, 0, 1)) == pytest.approx(expected, rel=1e-10)


def test_scaled_spot_is_an_elliptic_cone() -> None:
    """tan of the cone along x and y is that of the cone times scale over the scale along z."""
    matrix = np.diag([2.0, 1.0, 0.5, 1.0])
    matrix[2, 3] = 1.0
    properties = {"energy": 1.0, "spot_size": np.pi / 3, "spot_blend": 0, "shadow_soft_size": 0}
    light = lit('SPOT', matrix, **properties)
    tan = np.tan(np.pi / 6.0)
    for place in ((4.0 * tan, 0, 0), (0, 2.0 * tan, 0)):
        inside, outside = np.array(place) * 0.999, np.array(place) * 1.001
        assert irradiance(light, inside, (0, 0, 1)) > 0.0
        assert irradiance(light, outside, (0, 0, 1)) == 0.0


def test_uniform_scale_leaves_a_spot_alone() -> None:
    properties = {"energy": 1.0, "spot_size": 1.0, "spot_blend": 0.3, "shadow_soft_size": 0.1}
    fluxes = [
        lit('SPOT', np.diag([scale, scale, scale, 1.0]), **properties).radiant_flux()
        for scale in (1.0, 7.0)
    ]
    assert np.allclose(*fluxes, rtol=EXACT)


# --- area


def rectangle(a: float, b: float, h: float, **fields: Any) -> AreaLight:
    """Return a rectangle a by b at height h that shines down, with L = 1/(πA)."""
    u, v = np.array([a, 0.0, 0.0]), np.array([0.0, b, 0.0])
    center = np.array([0.0, 0.0, h])
    return AreaLight(
        name="a", rgb=WHITE, center=center, axis_u=u, axis_v=v, direction=DOWN, **fields
    )


@pytest.mark.parametrize(("a", "b", "h"), [(1.0, 1.0, 3.0), (2.0, 0.3, 0.5), (1e-4, 1e-4, 1.0)])
def test_rectangle_by_configuration_factors(a: float, b: float, h: float) -> None:
    """Below a corner, parallel and perpendicular (Howell, B-3 and B-4)."""
    light = rectangle(a, b, h)
    x, y = a / h, b / h
    p, q = np.sqrt(1.0 + x * x), np.sqrt(1.0 + y * y)
    parallel = (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2.0 * np.pi)
    radiance = 1.0 / (np.pi * a * b)
    corner = (-a / 2.0, -b / 2.0, 0.0)
    assert irradiance(light, corner, (0, 0, 1)) == pytest.approx(np.pi * radiance * parallel, 1e-9)
    across = (np.arctan(y) - np.arctan(y / p) / p) / (2.0 * np.pi)
    measured = irradiance(light, corner, (1, 0, 0))
    assert measured == pytest.approx(np.pi * radiance * across, rel=1e-9)
    assert irradiance(light, (0, 0, 2.0 * h), (0, 0, -1)) == 0.0


def test_coaxial_disc() -> None:
    light = rectangle(2.0, 2.0, 1.5, ellipse=True)
    radiance = 1.0 / (np.pi * np.pi)
    expected = np.pi * radiance * 1.0 / (1.0 + 1.5**2)
    assert irradiance(light, (0, 0, 0), (0, 0, 1)) == pytest.approx(expected, rel=EXACT)


def test_disc_off_axis() -> None:
    """Parallel: F = ½[1 - (x²+h²-r²)/√((x²+h²+r²)²-4x²r²)]."""
    r, h = 0.7, 1.1
    light = rectangle(2.0 * r, 2.0 * r, h, ellipse=True)
    for x in (0.3, 0.9, 3.0):
        q = x * x + h * h
        factor = 0.5 * (1.0 - (q - r * r) / np.sqrt((q + r * r) ** 2 - 4.0 * x * x * r * r))
        expected = factor / (np.pi * r * r)
        assert irradiance(light, (x, 0, 0), (0, 0, 1)) == pytest.approx(expected, rel=1e-10)


def test_ellipse_becomes_a_disc() -> None:
    disc, nearly = (rectangle(1.0, b, 0.8, ellipse=True) for b in (1.0, 1.0 + 1e-9))
    for normal in ((0, 0, 1), (-0.5, 0.1, 1)):
        place = (0.6, -0.2, 0)
        assert irradiance(nearly, place, normal) == pytest.approx(irradiance(disc, place, normal))


def test_ellipse_is_nan_only_where_the_horizon_cuts_it() -> None:
    light = rectangle(1.0, 0.5, 1.0, ellipse=True)
    normals = np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1], [1.0, 0, 0.49], [1.0, 0, 0.51]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = light.irradiance(np.zeros((5, 3)), normals)
    assert values is not None
    assert np.isnan(values).tolist() == [False, True, False, True, False]
    assert values[2] == 0.0


def test_spread_on_axis() -> None:
    """100 W, 0.1 m square, 2 m away: 10.375 times as bright with a spread of 60° (far-field limit).

    L(0)/L_Lambert = tan h/(tan h - h) = 10.74 on the axis, less where the square is seen slanted.
    """
    size, h = 1e-3, np.radians(30.0)
    light = rectangle(size, size, 2.0, spread=2.0 * h)
    u = np.random.default_rng(1).random((1000, 2))
    points, normals = np.zeros((1000, 3)), np.tile([0.0, 0.0, 1.0], (1000, 1))
    sample = light.sample(points, normals, u)
    measured = np.mean(sample.weight * sample.wi[:, 2])
    expected = np.tan(h) / (np.tan(h) - h) / (np.pi * 4.0)
    assert measured == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("spread", [0.05, 0.0999, 0.101, 1.0, 3.0])
@pytest.mark.parametrize("series", [True, False])
def test_spread_flux_by_quadrature(spread: float, series: bool) -> None:
    light = rectangle(1.0, 1.0, 1.0, spread=spread, series=series)
    theta = (np.arange(20000) + 0.5) / 20000 * 0.5 * spread
    towards = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=1)
    _, radiance = light.intersect(np.array([0, 0, 1.0]) - 1e-3 * towards, towards)
    width = 0.5 * spread / 20000
    flux = 2.0 * np.pi * np.sum(radiance * np.sin(theta) * np.cos(theta)) * width
    assert light.radiant_flux()[0] == pytest.approx(flux, rel=1e-6)
    if not series or spread > 0.1:
        assert flux == pytest.approx(1.0, rel=1e-6)
    else:
        assert flux == pytest.approx(1.0 + 0.4 * (0.5 * spread) ** 2, rel=1e-5)


def test_parallel_beam_keeps_its_flux() -> None:
    light = rectangle(2.0, 1.0, 5.0, spread=0.0)
    assert irradiance(light, (0.9, 0.4, 0), (0, 0, 1)) == pytest.approx(0.5, rel=EXACT)
    assert irradiance(light, (0.9, 0.4, 0), (1, 0, 1)) == pytest.approx(0.5 / np.sqrt(2.0))
    assert irradiance(light, (1.1, 0.4, 0), (0, 0, 1)) == 0.0
    assert irradiance(light, (0.9, 0.4, 6.0), (0, 0, -1)) == 0.0


def test_physical_sheared_area_is_the_true_parallelogram() -> None:
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
    quads = MeshLight(
        name="q", rgb=2.0 / (np.pi * 0.8) * WHITE, triangles=corners[[[0, 1, 2], [0, 2, 3]]]
    )
    for normal in ((0, 0, 1), (1, 0, 0.3)):
        expected = irradiance(quads, place, normal)
        assert irradiance(physical, place, normal) == pytest.approx(expected, rel=1e-10)


# --- sun, world, mesh


def test_sun_reads_its_energy() -> None:
    for angle in (0.0, 0.01, 1.0, np.pi):
        light = lit('SUN', np.eye(4), energy=3.0, angle=angle)
        assert at_origin(light) == pytest.approx(3.0, rel=EXACT)
        if angle < np.pi / 3:
            assert at_origin(light, (np.sqrt(3.0), 0, 1)) == pytest.approx(3.0 * 0.5, rel=EXACT)


def test_sun_as_radiance() -> None:
    light = lit('SUN', np.eye(4), energy=3.0, angle=1.0, normalize=False)
    assert at_origin(light) == pytest.approx(3.0 * np.pi * np.sin(0.5) ** 2, rel=EXACT)


def test_half_sky_on_a_wall() -> None:
    """A uniform hemisphere gives a wall half of what it gives the floor: (1 + cos)/2 in general."""
    light = SunLight(name="s", rgb=WHITE, towards=np.array([0, 0, 1.0]), half_angle=np.pi / 2)
    for tilt in (0.0, 0.5, np.pi / 2, 2.5):
        measured = irradiance(light, (0, 0, 0), (np.sin(tilt), 0, np.cos(tilt)))
        assert measured == pytest.approx(0.5 * (1.0 + np.cos(tilt)), abs=1e-12)


def test_world_gives_pi_l() -> None:
    light = WorldLight(name="World", rgb=0.5 * WHITE)
    assert irradiance(light, (0, 0, 0), (1, 2, 3)) == pytest.approx(0.5 * np.pi, rel=EXACT)


def test_closed_box_of_emitters_gives_pi_l() -> None:
    c = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    triangles = np.array([t for q in quads for t in (c[[q[0], q[1], q[2]]], c[[q[0], q[2], q[3]]])])
    light = MeshLight(name="m", rgb=WHITE, triangles=triangles)
    for normal in ((0, 0, 1), (1, 2, -3)):
        assert irradiance(light, (0.3, -0.5, 0.2), normal) == pytest.approx(np.pi, rel=1e-12)
    assert light.radiant_flux()[0] == pytest.approx(2.0 * np.pi * 24.0)


def test_what_leaves_a_mesh() -> None:
    """A sheet: all, twice; a ball: its outside; a bowl: the inside's view of the opening is ½."""
    globe = ball()
    corners = globe.vertices.astype(float)[globe.triangles]
    bowl = corners[corners[..., 2].min(axis=1) >= -1e-6]
    sheet = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    for triangles, area, share, shadow, tolerance in (
        (sheet, 1.0, 1.0, 1.0, EXACT),
        (corners, 4.0 * np.pi, 0.5, np.pi, FACETS),
        (bowl, 2.0 * np.pi, 0.75, np.pi, FACETS),
    ):
        light = MeshLight(name="m", rgb=WHITE, triangles=triangles)
        expected = 2.0 * np.pi * area * share
        assert light.leaving_flux()[0] == pytest.approx(expected, rel=tolerance)
        assert light.peak_radiant_intensity()[0] == pytest.approx(shadow, rel=tolerance)


def test_many_triangles_have_no_closed_form_but_a_mean(rng: np.random.Generator) -> None:
    one = np.array([[[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [0.0, 1.0, 1.5]]])
    few = MeshLight(name="m", rgb=WHITE, triangles=one)
    parts = [(i / 65.0, (i + 1) / 65.0) for i in range(65)]
    a, b, c = one[0]
    many = MeshLight(
        name="m",
        rgb=WHITE,
        triangles=np.array([[a + s * (b - a), a + t * (b - a), c] for s, t in parts]),
    )
    normal = np.tile([0.0, 0.0, 1.0], (20000, 1))
    assert many.irradiance(normal, normal) is None
    sample = many.sample(0.0 * normal, normal, rng.random((20000, 2)))
    values = sample.weight * np.maximum(sample.wi[:, 2], 0.0)
    expected = irradiance(few, (0, 0, 0), (0, 0, 1))
    assert abs(values.mean() - expected) < 4.0 * values.std() / np.sqrt(20000)


# --- every closed form against brute force


def brute_force(light: Light, place: np.ndarray, normal: np.ndarray, axis: np.ndarray) -> float:
    """Return ∫ L cos θ dω by midpoints over directions, refined about the outline.

    Directions are (azimuth about `axis`, polar angle); along each meridian the edge of the light
    and of the horizon is found by bisection of the integrand's support from the axis outwards.
    """
    azimuths, nodes = 4096, 20
    x, w = np.polynomial.legendre.leggauss(nodes)
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
    total = np.zeros(azimuths)
    for node, weight in zip(x, w, strict=True):
        polar = 0.5 * inner * (node + 1.0)
        total += 0.5 * inner * weight * values(polar) * np.sin(polar)
    return float(total.sum() * 2.0 * np.pi / azimuths)


BRUTE_CASES = [
    pytest.param(light, id=f"{kind}-{light.name}")
    for kind in ('POINT', 'SPOT', 'AREA', 'SUN', 'MESH')
    for light in LIGHTS[kind].examples()
    if not light.is_delta and light.irradiance(np.zeros((1, 3)), np.eye(3)[:1]) is not None
    if light.name not in ("tetrahedron", "sun")
]


@pytest.mark.parametrize("light", BRUTE_CASES)
def test_closed_forms_by_brute_force(light: Light, rng: np.random.Generator) -> None:
    tried = 0
    for place in ((-0.9, 0.0, 0.1), (-0.4, 0.5, 0.3)):
        point = np.array(place)
        target = np.array([0.2, -0.1, 1.5])
        if light.kind == 'MESH':
            target = light.triangles.mean(axis=(0, 1))
        axis = light.towards if light.kind == 'SUN' else target - point
        axis = axis / np.linalg.norm(axis)
        across = np.linalg.svd(axis[None])[2][1]
        for tilt in (0.6, 1.5):  # the axis stays above the horizon, so that support is a star
            normal = np.cos(tilt) * axis + np.sin(tilt) * across
            exact = light.irradiance(point[None], normal[None])
            assert exact is not None
            if np.isfinite(exact[0]) and exact[0] > 0.0:
                expected = brute_force(light, point, normal, axis)
                assert exact[0] == pytest.approx(expected, rel=BRUTE)
                tried += 1
    assert tried >= 1


# --- the two models, and what a record says


def test_models_differ_by_unit_scale_squared() -> None:
    """Three metres are 300 bu at 0.01 m: over real metres E = P/(4π 3²)."""
    matrix = np.eye(4)
    matrix[2, 3] = 300.0
    for properties in ({}, {"shadow_soft_size": 10.0, "use_soft_falloff": False}):
        wanted = {"energy": 7.0, **properties}
        physical = lit('POINT', matrix, 0.01, model="physical", **wanted)
        expected = 7.0 / (4.0 * np.pi * 9.0)
        assert at_origin(physical) == pytest.approx(expected)
        assert at_origin(lit('POINT', matrix, 0.01, **wanted)) == pytest.approx(1e-4 * expected)
        assert physical.radiant_flux()[0] * 0.01**2 == pytest.approx(7.0)


def test_stated_radiance_needs_no_unit_scale() -> None:
    """`normalize` off: P/π is radiance in either model; the area light below fills the view."""
    stated = {"energy": 3.0, "normalize": False}
    square = {"shape": 'SQUARE', "size": 1e5, "spread": np.pi}
    ball = {"shadow_soft_size": 9.0, "use_soft_falloff": False}
    for model in ("physical", "cycles"):
        for kind, shape, tolerance in (('AREA', square, 1e-4), ('POINT', ball, EXACT)):
            light = lit(kind, None, 0.01, model=model, **stated, **shape)
            assert at_origin(light) == pytest.approx(3.0, rel=tolerance)


def test_colour_exposure_temperature_and_nodes_multiply() -> None:
    light = lit(
        'POINT', energy=2.0, exposure=1.0, color=(1.0, 0.5, 0.0), use_temperature=True,
        temperature_color=(0.5, 1.0, 2.0), node_emission=(3.0, 3.0, 3.0),
    )  # fmt: skip
    assert np.allclose(light.rgb, [6.0, 6.0, 0.0])


def test_blackbody_has_luminance_one_and_blenders_colour() -> None:
    """Blender 4.5 and 5.2 give (1.770834, 0.844285, 0.272223) at 3000 K."""
    assert np.allclose(blackbody_rgb(3000.0), [1.770834, 0.844285, 0.272223], rtol=1e-3)
    assert blackbody_rgb(6500.0) @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0, rel=1e-3)
    assert np.array_equal(blackbody_rgb(20000.0), blackbody_rgb(12000.0))


def test_what_emits_nothing_is_no_light() -> None:
    flat = np.diag([1.0, 1.0, 0.0, 1.0])
    area = {"energy": 1.0, "shape": 'SQUARE', "size": 1.0}
    for dark in (
        record('POINT', energy=0.0),
        record('AREA', flat, **area),
        record('AREA', **{"cycles.is_portal": True}, **area),
        record('SPOT', flat, energy=1.0, spot_size=1.0),
        record('SUN', flat, energy=1.0),
    ):
        assert light_from_record(dark, "cycles") is None
    assert lit('POINT', flat, energy=1.0)


def test_spot_with_radius_is_exact_where_the_whole_ball_is_lit() -> None:
    spot = SpotLight(
        name="s",
        rgb=WHITE,
        position=np.array([0.0, 0.0, 2.0]),
        radius=0.1,
        light_from_world=np.eye(3),
        cos_half_angle=np.cos(0.5),
        blend=0.2,
    )
    ball = PointLight(name="p", rgb=WHITE, position=spot.position, radius=0.1)
    up = (0, 0, 1)
    assert irradiance(spot, (0, 0, 0), up) == irradiance(ball, (0, 0, 0), up)
    assert irradiance(spot, (2.0, 0, 0), up) == 0.0
    assert np.isnan(irradiance(spot, (2.0 * np.tan(0.5), 0, 0), up))
