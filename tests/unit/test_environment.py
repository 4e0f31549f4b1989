# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies by direction: samples against their density, and light of great contrast kept whole."""

import numpy as np
import pytest

from blender_rad.lights import SkyMap
from blender_rad.lights._environment import WHOLE
from blender_rad.lights.world import Portal, WorldLight

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
CONTRAST = 1e5


def sky_with_sun(half: tuple[float, float]) -> SkyMap:
    """Noise from 0 to 1 with one texel of great contrast, dark at its edges."""
    texels = np.random.default_rng(3).random((16, 32, 3), dtype=np.float32)
    texels[5, 9] = CONTRAST * np.array([1.0, 0.8, 0.6])
    texels[[0, -1]] = texels[:, [0, -1]] = 0.0
    return SkyMap(texels, TURN, half)


def directions(sky: SkyMap, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the centres (n² 2, 3) of fine cells of the map and their solid angles."""
    a, b = sky.half
    azimuth = a * (1.0 - (np.arange(2 * n) + 0.5) / n)
    elevation = b * (1.0 - 2.0 * (np.arange(n) + 0.5) / n)
    e, f = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
    local = np.stack([np.cos(e) * np.cos(f), np.cos(e) * np.sin(f), np.sin(e)], axis=1)
    return local @ TURN, np.cos(e) * (a / n) * (2.0 * b / n)


@pytest.mark.parametrize("half", [WHOLE, (0.05, 0.04)])
def test_a_sun_of_one_texel_arrives_without_noise(half: tuple[float, float]) -> None:
    """Bilinear between texels it holds what one of them does: L ΔΩ cos θ."""
    sky = sky_with_sun(half)
    light = WorldLight(name="World", rgb=np.full(3, sky.scale), sky=sky)
    wi, solid_angle = directions(sky, 640)
    radiance, _ = sky.look(wi)
    sun = wi[np.argmax(radiance.sum(axis=1))]
    exact = (radiance * (np.maximum(wi @ sun, 0.0) * solid_angle)[:, None]).sum(axis=0)
    assert sky.irradiance(sun) == pytest.approx(exact, rel=0.02)
    n = 4096
    u = np.stack([np.arange(n) / n, np.arange(n) * 0.6180339887 % 1.0], axis=1)
    sample = light.sample(np.zeros((n, 3)), np.tile(sun, (n, 1)), u)
    assert sample.tint is not None
    each = sample.weight * np.maximum(sample.wi @ sun, 0.0)
    values = light.rgb * each[:, None] * sample.tint
    assert values.mean(axis=0) == pytest.approx(exact, rel=2e-3)
    assert values.std() < 0.5 * values.mean()  # an eighth of them are for the hemisphere


@pytest.mark.parametrize("order", [1, -1])
def test_samples_that_a_portal_cannot_have_are_spread_over_the_hemisphere(order: int) -> None:
    frame = np.eye(3)[[1, 2, 0]]  # the portals face along x, and the first is seen from its edge
    places = np.array([[0.0, 2.0, 1.0], [3.0, 0.0, 1.0]])[::order]
    portals = tuple(Portal(place, frame, np.array([0.4, 0.7])) for place in places)
    light = WorldLight(name="World", rgb=np.ones(3), portals=portals)
    u = (np.indices((256, 256)).reshape(2, -1).T + 0.5) / 256
    sample = light.sample(np.zeros((len(u), 3)), np.tile([1.0, 0.0, 0.0], (len(u), 1)), u)
    cosine = np.maximum(sample.wi[:, 0], 0.0)
    assert np.mean(sample.weight * cosine) == pytest.approx(np.pi, rel=2e-3)
    assert np.mean(sample.weight * cosine**2) == pytest.approx(2.0 * np.pi / 3.0, rel=5e-3)
