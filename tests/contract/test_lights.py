# SPDX-License-Identifier: GPL-3.0-or-later
"""What every registered light must keep, held against quadrature that knows nothing of it."""

from dataclasses import replace

import numpy as np
import pytest

from blender_rad.lights import LIGHTS, Light, LightSample
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


def strata(rng: np.random.Generator, side: int) -> np.ndarray:
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


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_samples_are_well_formed_and_linear_in_rgb(light, rng):
    points, normals = receivers(rng, 200)
    u = rng.random((200, 2))
    sample = light.sample(points, normals, u)
    assert np.allclose(np.linalg.norm(sample.wi, axis=1), 1.0, atol=1e-12)
    lit = sample.weight > 0.0
    assert np.all(sample.weight >= 0.0) and lit.any()
    assert np.all(sample.pdf[lit] > 0.0) and np.all(sample.distance[lit] > 0.0)
    assert np.all(np.isinf(sample.pdf)) == light.is_delta
    twice = replace(light, rgb=2.0 * light.rgb)
    assert np.array_equal(twice.radiant_flux(), 2.0 * light.radiant_flux(), equal_nan=True)
    again = twice.sample(points, normals, u)
    assert all(np.array_equal(a, b) for a, b in zip(sample, again, strict=True))


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_samples_average_to_the_closed_form(light, rng):
    points, normals = receivers(rng, 40)
    exact = light.irradiance(points, normals)
    if exact is None or np.isnan(exact).all():
        pytest.skip("no closed form")
    known = np.flatnonzero(np.isfinite(exact))
    assert np.all(exact[known] >= 0.0) and exact[known].max() > 0.0
    u = strata(rng, 64)
    for i in known:
        sample = light.sample(points[[i]].repeat(len(u), 0), normals[[i]].repeat(len(u), 0), u)
        values = sample.weight * np.maximum(sample.wi @ normals[i], 0.0)
        error = values.std(ddof=1) / np.sqrt(len(u))
        assert abs(values.mean() - exact[i]) <= SIGMAS * error + ROUNDING * exact[known].max()


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_far_sphere_receives_the_radiant_flux(light, rng):
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
    known = exact is not None and not np.isnan(exact).all()
    if known and light.kind != 'SPOT':  # whose ramp this quadrature does not resolve
        assert np.allclose(light.rgb * area * exact.mean(), flux, rtol=QUADRATURE)


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_far_sphere_shows_the_peaks(light, rng):
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


def seen_first(light: Light, point: np.ndarray, sample: LightSample) -> np.ndarray:
    """Return which samples nothing else of the light hides (a mesh may hide itself)."""
    if light.kind in ('SUN', 'WORLD'):
        return np.ones(len(sample.wi), dtype=bool)
    distance, _ = light.intersect(np.broadcast_to(point, sample.wi.shape), sample.wi)
    return sample.distance <= distance * (1.0 + 1e-9)


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_directions_follow_the_density_that_looks_find(light, rng):
    """Chi squared, over cells of directions, of samples against the integral of the density."""
    if light.is_delta:
        pytest.skip("a single direction")
    n, side, cells = 30_000, 384, 8
    point, normal = np.array([[-0.8, -0.1, 0.1]]), np.array([[0.0, 0.0, 1.0]])
    sample = light.sample(point.repeat(n, 0), normal.repeat(n, 0), rng.random((n, 2)))
    wi = sample.wi[(sample.weight > 0.0) & seen_first(light, point, sample)]
    axis = wi.mean(axis=0) / np.linalg.norm(wi.mean(axis=0))
    frame = np.concatenate([axis[None], np.linalg.svd(axis[None])[2][1:]])
    widest = 1.0 - float((wi @ axis).min())

    def in_cells(directions, weights=None):
        x, y, z = frame @ directions.T
        place = (1.0 - x) / widest, np.arctan2(z, y) / (2.0 * np.pi) + 0.5
        return np.histogram2d(*place, cells, ((0.0, 1.0), (0.0, 1.0)), weights=weights)[0]

    u = strata(rng, side)
    cos, phi = 1.0 - widest * u[:, 0], 2.0 * np.pi * u[:, 1]
    sin = np.sqrt(1.0 - cos * cos)
    uniform = np.stack([cos, sin * np.cos(phi), sin * np.sin(phi)], axis=1) @ frame
    _, radiance, pdf = light.look(point.repeat(side**2, 0), normal.repeat(side**2, 0), uniform)
    bright = (radiance.reshape(side**2, -1) > 0.0).any(axis=1)
    hits = n * 2.0 * np.pi * widest / side**2 * np.where(bright, pdf, 0.0)
    expected, counts = in_cells(uniform, hits), in_cells(wi)
    within = in_cells(uniform, hits**2) - expected**2 / np.maximum(in_cells(uniform), 1.0)
    variance = expected + np.maximum(within, 0.0)  # at most: they are stratified
    filled = expected > 5.0
    assert abs((counts - expected)[~filled].sum()) <= 3e-4 * n
    degrees = int(filled.sum())
    chi_squared = float(np.sum((counts - expected)[filled] ** 2 / variance[filled]))
    assert chi_squared <= degrees + SIGMAS * np.sqrt(2.0 * degrees)


@pytest.mark.parametrize("light", LIGHT_LIST)
def test_rays_find_what_was_sampled(light, rng):
    points, normals = receivers(rng, 4000)
    sample = light.sample(points, normals, rng.random((4000, 2)))
    distance, radiance, pdf = light.look(points, normals, sample.wi)
    assert light.is_found != light.is_delta
    if light.is_delta:
        assert np.isinf(distance).all() and not radiance.any() and not pdf.any()
        return
    lit, first = sample.weight > 0.0, seen_first(light, points, sample)
    assert light.kind == 'MESH' or np.all(first[lit])
    radiance = np.broadcast_to(radiance.reshape(4000, -1), (4000, 3))
    same = lit & first & (radiance > 0.0).any(axis=1)
    assert same.sum() >= max(100, 0.999 * (lit & first).sum())  # rounding may lose an outline
    assert np.allclose(pdf[same], sample.pdf[same], rtol=1e-6)
    assert np.allclose(radiance[same], tinted(sample, sample.weight * sample.pdf)[same], rtol=1e-7)
    assert np.allclose(distance[same], sample.distance[same], rtol=1e-7)
    away, dark = light.intersect(points, -sample.wi)
    assert light.kind in ('WORLD', 'SUN') or np.all(np.isfinite(away[dark > 0.0]))
