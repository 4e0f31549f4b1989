# SPDX-License-Identifier: GPL-3.0-or-later
"""What every registered light must keep, held against quadrature that knows nothing of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blender_rad.lights import LIGHTS, Light, LightSample
from blender_rad.lights import _geometry as geometry
from blender_rad.lights._distribution import Distribution

AROUND, UP = np.arange(-1, 14) * np.pi / 6.0, np.arange(-7, 8) * np.pi / 12.0
PATTERN = Distribution(
    longitude=AROUND[1:-1],
    latitude=UP[1:-1],
    table=2.0 + np.cos(AROUND - 0.4)[:, None] * np.cos(UP) + 0.5 * np.sin(UP),
    frame=np.array([[0.8, 0.0, -0.6], [0.1, 1.0, 0.0], [1.2, 0.0, 1.6]]),  # turns, and stretches
)
EXAMPLES = [(kind, light) for kind, cls in LIGHTS.items() for light in cls.examples()]
LIGHT_LIST = [pytest.param(light, id=f"{kind}-{light.name}") for kind, light in EXAMPLES] + [
    pytest.param(replace(light, distribution=PATTERN), id=f"{kind}-{light.name}-ies")
    for kind, light in EXAMPLES
    if light.name in ("point", "sphere", "scaled-ball", "spot", "narrow", "ellipse")
]
SIGMAS = 5.0  # of about 2000 comparisons one in 3000 may pass 3.4
SIDE = 64  # stratified samples a side
QUADRATURE = 1e-4  # of the far sphere: stratified, with a kink where a face is seen edge-on
FAR = 200.0  # [bu], against lights of half a bu: what is left of their size is below 2e-5
PEAK = 2e-3  # of the directions looked into, one is this close to the greatest
SUM = 0.005  # over coarse texels, in place of what is bilinear between them
ROUNDING = 1e-9


def receivers(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points about the lights, and normals: floor, wall, any way, and cut by the horizon."""
    points = rng.uniform((-1.5, -1.5, -1.8), (1.5, 1.5, 1.2), (n, 3))
    normals = rng.normal(size=(n, 3))
    normals[: n // 4] = [0.0, 0.0, 1.0]
    normals[n // 4 : n // 2, 2] = 0.0
    across = np.cross(points - [0.2, -0.1, 1.5], normals)
    normals[-n // 4 :] = (np.cross(across, points - [0.2, -0.1, 1.5]))[-n // 4 :]
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def strata(rng: np.random.Generator, side: int = SIDE) -> np.ndarray:
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    return (cells + rng.random(cells.shape)) / side


def far_sphere(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return points on a far sphere about the lights, and its outward normals; both (n, 3)."""
    u = strata(rng, 192)
    z, phi = 1.0 - 2.0 * u[:, 0], 2.0 * np.pi * u[:, 1]
    r = np.sqrt(1.0 - z * z)
    outward = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)
    return FAR * outward + [0.2, -0.1, 1.5], outward


def tinted(sample: LightSample, values: np.ndarray) -> np.ndarray:
    """Return `values` (n,) of samples in colour, (n, 3), over the light's rgb."""
    return values[:, None] * (np.ones(3) if sample.tint is None else sample.tint)


def estimate(light: Light, point, normal, u) -> tuple[float, float]:
    """Return the mean and standard error of sampled irradiance at one receiver."""
    n = len(u)
    sample = light.sample(np.tile(point, (n, 1)), np.tile(normal, (n, 1)), u)
    values = sample.weight * np.maximum(sample.wi @ normal, 0.0)
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(n))


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_samples_are_well_formed_and_linear_in_rgb(light: Light, rng: np.random.Generator) -> None:
    points, normals = receivers(rng, 200)
    u = rng.random((200, 2))
    sample = light.sample(points, normals, u)
    assert np.allclose(np.linalg.norm(sample.wi, axis=1), 1.0, atol=1e-12)
    lit = sample.weight > 0.0
    assert np.all(sample.weight >= 0.0) and lit.any()
    assert np.all(sample.pdf[lit] > 0.0)
    assert np.all(np.isinf(sample.pdf)) == light.is_delta
    assert np.all(sample.distance[lit] > 0.0)
    twice = replace(light, rgb=2.0 * light.rgb)
    assert np.array_equal(twice.radiant_flux(), 2.0 * light.radiant_flux(), equal_nan=True)
    again = twice.sample(points, normals, u)
    assert all(np.array_equal(a, b) for a, b in zip(sample, again, strict=True))


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_samples_average_to_the_closed_form(light: Light, rng: np.random.Generator) -> None:
    points, normals = receivers(rng, 40)
    exact = light.irradiance(points, normals)
    if exact is None:
        pytest.skip("no closed form")
    known = np.flatnonzero(np.isfinite(exact))
    assert np.all(exact[known] >= 0.0) and exact[known].max() > 0.0
    u = strata(rng)
    for i in known:
        mean, error = estimate(light, points[i], normals[i], u)
        assert abs(mean - exact[i]) <= SIGMAS * error + ROUNDING * exact[known].max()


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_far_sphere_receives_the_radiant_flux(light: Light, rng: np.random.Generator) -> None:
    flux = light.radiant_flux()
    if np.isnan(flux).all():
        pytest.skip("no flux: at infinity")
    if light.is_delta and light.kind == 'AREA':
        pytest.skip("a parallel beam is a delta on a far sphere; see the analytic tests")
    points, outward = far_sphere(rng)
    sample = light.sample(points, -outward, rng.random((len(points), 2)))
    values = sample.weight * np.maximum(-np.einsum("ij,ij->i", sample.wi, outward), 0.0)
    area = 4.0 * np.pi * FAR**2
    error = area * values.std(ddof=1) / np.sqrt(len(points))
    total = area * values.mean()
    assert np.allclose(light.rgb * total, flux, atol=SIGMAS * error * np.abs(light.rgb).max())
    exact = light.irradiance(points, -outward)
    if exact is not None and light.kind != 'SPOT':  # whose ramp this quadrature does not resolve
        assert np.allclose(light.rgb * area * exact.mean(), flux, rtol=QUADRATURE)


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_far_sphere_shows_the_peaks(light: Light, rng: np.random.Generator) -> None:
    """Greatest radiance and E·d² over directions; the sun's and the world's own facing E."""
    _, outward = far_sphere(rng)
    axis = getattr(light, "direction", getattr(light, "_axis", outward[0]))
    outward[:2] = -light.towards if light.kind == 'SUN' else axis
    points = FAR * outward + [0.2, -0.1, 1.5]
    centred = [[0.5, 0.5], [0.0, 0.0]]  # of rectangles, of ellipses
    u = np.append(centred, rng.random((len(points) - 2, 2)), axis=0)
    sample = light.sample(points, -outward, u)
    if not light.is_delta:
        seen = tinted(sample, sample.weight * sample.pdf).max(axis=0)
        assert np.allclose(light.peak_radiance(), light.rgb * seen, rtol=PEAK)
    facing = np.max(sample.weight * np.maximum(-np.einsum("ij,ij->i", sample.wi, outward), 0.0))
    if getattr(light, "sky", None):
        up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
        sample = light.sample(points, up, strata(rng, 192))
        values = tinted(sample, sample.weight * np.maximum(sample.wi[:, 2], 0.0))
        error = light.rgb * values.std(axis=0) / np.sqrt(len(values))
        off = light.rgb * values.mean(axis=0) - light.facing_irradiance()
        assert (np.abs(off) < SIGMAS * error + light.facing_irradiance() * SUM).all()
    elif light.kind in ('SUN', 'WORLD'):
        exact = light.irradiance(points[:1], -outward[:1])
        whole = np.pi if exact is None else exact[0]  # None: a sky with portals
        assert np.allclose(light.facing_irradiance(), light.rgb * whole)
        assert np.isnan(light.peak_radiant_intensity()).all()
    elif light.name != "tetrahedron" and not (light.is_delta and light.kind == 'AREA'):
        assert np.allclose(light.peak_radiant_intensity(), light.rgb * facing * FAR**2, rtol=PEAK)
        assert np.isnan(light.facing_irradiance()).all()


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_directions_follow_their_density(light: Light, rng: np.random.Generator) -> None:
    """In every cell of directions 1/pdf averages to its lit solid angle: chi squared over cells."""
    if light.is_delta or light.name == "disc":
        pytest.skip("a single direction; 1/pdf without a mean square, see the unit tests")
    n, side, cells = 30_000, 384, 8
    point, normal = np.array([-0.8, -0.1, 0.1]), np.array([0.0, 0.0, 1.0])
    sample = light.sample(np.tile(point, (n, 1)), np.tile(normal, (n, 1)), rng.random((n, 2)))
    used = (sample.weight > 0.0) & seen_first(light, point, sample)
    wi, inverse = sample.wi[used], 1.0 / sample.pdf[used]
    axis = wi.mean(axis=0) / np.linalg.norm(wi.mean(axis=0))
    frame = np.concatenate([axis[None], np.linalg.svd(axis[None])[2][1:]])
    widest = 1.0 - float((wi @ axis).min())

    def in_cells(directions: np.ndarray, weights: np.ndarray) -> np.ndarray:
        x, y, z = frame @ directions.T
        place = (1.0 - x) / widest, np.arctan2(z, y) / (2.0 * np.pi) + 0.5
        return np.histogram2d(*place, cells, ((0.0, 1.0), (0.0, 1.0)), weights=weights)[0]

    u = strata(rng, side)
    cos, phi = 1.0 - widest * u[:, 0], 2.0 * np.pi * u[:, 1]
    sin = np.sqrt(1.0 - cos * cos)
    uniform = np.stack([cos, sin * np.cos(phi), sin * np.sin(phi)], axis=1) @ frame
    _, radiance = light.intersect(np.tile(point, (side**2, 1)), uniform)
    bright = (radiance.reshape(side**2, -1) > 0.0).any(axis=1)
    share = in_cells(uniform, bright.astype(float)) / side**2
    solid_angle = 2.0 * np.pi * widest
    expected, measured = solid_angle * share, in_cells(wi, inverse) / n
    variance = (in_cells(wi, inverse**2) / n - measured**2) / n
    variance += solid_angle**2 * share * (1.0 - share) / side**2  # at most: they are stratified
    filled = share > 1e-4
    assert np.all(np.abs(measured - expected)[~filled] <= 3e-4 * solid_angle)
    chi_squared = float(np.sum((measured - expected)[filled] ** 2 / variance[filled]))
    degrees = int(filled.sum())
    assert chi_squared <= degrees + SIGMAS * np.sqrt(2.0 * degrees)
    total, error = float(share.sum() * solid_angle), float(np.sqrt(variance.sum()))
    assert abs(inverse.sum() / n - total) <= SIGMAS * error


def seen_first(light: Light, point: np.ndarray, sample: LightSample) -> np.ndarray:
    """Return which samples nothing else of the light hides (a mesh may hide itself)."""
    if light.kind in ('SUN', 'WORLD'):
        return np.ones(len(sample.wi), dtype=bool)
    distance, _ = light.intersect(np.broadcast_to(point, sample.wi.shape), sample.wi)
    return sample.distance <= distance * (1.0 + 1e-9)


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_what_is_looked_at_has_the_density_of_samples(
    light: Light, rng: np.random.Generator
) -> None:
    """At what is sampled, and all over: its integral is the share of samples that are lit."""
    points, normals = receivers(rng, 4000)
    sample = light.sample(points, normals, rng.random((4000, 2)))
    _, radiance, pdf = light.look(points, normals, sample.wi)
    assert light.is_found != light.is_delta
    if light.is_delta:
        assert not radiance.any() and not pdf.any()
        return
    lit = (sample.weight > 0.0) & seen_first(light, points, sample)
    lit &= (radiance.reshape(4000, -1) > 0.0).any(axis=1)
    assert lit.sum() > 100
    assert np.allclose(pdf[lit], sample.pdf[lit], rtol=1e-6)
    n, point, normal = 1 << 14, np.array([-0.8, -0.1, 0.1]), np.array([0.0, 0.0, 1.0])
    place = np.tile(point, (n, 1)), np.tile(normal, (n, 1))
    taken = light.sample(*place, rng.random((n, 2)))
    used = (taken.weight > 0.0) & seen_first(light, point, taken)
    axis = taken.wi[used].mean(axis=0)
    axis /= np.linalg.norm(axis)
    widest = 1.0 - (taken.wi[used] @ axis).min()
    cone = np.tile(axis, (n, 1)), np.full(n, widest), strata(rng, 1 << 7)
    _, radiance, pdf = light.look(*place, geometry.sample_cone(*cone))
    bright = (radiance.reshape(n, -1) > 0.0).any(axis=1)
    values = 2.0 * np.pi * widest * np.where(bright, pdf, 0.0)
    error = np.hypot(values.std(), used.std()) / np.sqrt(n)
    assert abs(values.mean() - used.mean()) < SIGMAS * error + ROUNDING


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_rays_find_what_was_sampled(light: Light, rng: np.random.Generator) -> None:
    points, normals = receivers(rng, 4000)
    sample = light.sample(points, normals, rng.random((4000, 2)))
    distance, radiance = light.intersect(points, sample.wi)
    if light.is_delta:
        assert np.all(np.isinf(distance)) and np.all(radiance == 0.0)
        return
    lit = sample.weight > 0.0
    first = seen_first(light, points, sample)
    assert light.kind == 'MESH' or np.all(first[lit])
    radiance = np.broadcast_to(radiance.reshape(4000, -1), (4000, 3))
    same = lit & first & (radiance > 0.0).any(axis=1)
    assert same.sum() >= 0.999 * (lit & first).sum()  # rounding may lose a ray to an outline
    assert np.allclose(radiance[same], tinted(sample, sample.weight * sample.pdf)[same], rtol=1e-7)
    assert np.allclose(distance[same], sample.distance[same], rtol=1e-7)
    away, dark = light.intersect(points, -sample.wi)
    assert light.kind in ('WORLD', 'SUN') or np.all(np.isfinite(away[dark > 0.0]))
