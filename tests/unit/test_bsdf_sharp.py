# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces without roughness: one direction, and all of its light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from blender_rad.bsdfs import Frame, Lobe
from blender_rad.bsdfs._fresnel import Dielectric
from blender_rad.bsdfs._microfacet import Microfacet, Refraction
from blender_rad.bsdfs.glossy import AshikhminShirley

Array = np.ndarray
N = 500


def mirrored(wo: Array) -> tuple[Array, Array]:
    return wo * [-1.0, -1.0, 1.0], np.ones(N)


def refracted(wo: Array) -> tuple[Array, Array]:
    """Snell's law, and the light that is not reflected."""
    flat = -wo[:, :2] / 1.5
    down = -np.sqrt(1.0 - np.sum(flat**2, axis=1))
    passed = 1.0 - Dielectric(np.full(N, 1.5)).reflectance(wo[:, 2])[:, 0]
    return np.column_stack([flat, down]), passed


def glass(*shape: Array) -> Lobe:
    ior = np.full(N, 1.5)
    return Refraction(*shape, Dielectric(ior), ior=ior)


@pytest.mark.parametrize(
    ("lobe", "expected"), [(Microfacet, mirrored), (AshikhminShirley, mirrored), (glass, refracted)]
)
def test_sharp_faces_send_all_light_one_way(
    lobe: Callable[..., Lobe], expected: Callable[[Array], tuple[Array, Array]],
    rng: np.random.Generator,
) -> None:  # fmt: skip
    normal = rng.normal(size=(N, 3))
    frame = Frame.around(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    cosine, turn = rng.uniform(0.05, 1.0, N), 2.0 * np.pi * rng.random(N)
    flat = np.sqrt(1.0 - cosine**2)
    wo = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), cosine])
    one = lobe(np.ones((N, 3)), frame, wo, np.zeros(N), np.zeros(N))
    wi = one.sample(rng.random((N, 2)))
    way, passed = expected(wo)
    np.testing.assert_allclose(frame.local(wi), way, atol=1e-12)
    value, density = one.evaluate(wi)
    np.testing.assert_allclose(value[:, 0] / density, passed, rtol=1e-12)
    off = wi + 1e-5 * normal
    value, density = one.evaluate(off / np.linalg.norm(off, axis=1, keepdims=True))
    assert not value.any() and not density.any(), "lights without extent are not seen"
