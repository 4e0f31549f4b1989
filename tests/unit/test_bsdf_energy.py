# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's curves, and tables of lost energy against facets drawn by area instead of by sight."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.bsdfs import Frame
from blender_rad.bsdfs._energy import clear, compensation, reflecting, remapped
from blender_rad.bsdfs._fresnel import (
    Conductor,
    Dielectric,
    EdgeTint,
    Fresnel,
    Remapped,
    index_of,
    normal_reflectance,
)
from blender_rad.bsdfs._microfacet import Microfacet

Array = np.ndarray
SAMPLES = 200_000
SIGMAS, TABLES = 4.0, 3e-4
NODE = 7
GLASS = float(index_of(np.array((NODE / 15.0) ** 4)))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
COSINES = 0.5 * (1.0 + NODES)
WHITE = np.ones((64, 3))


def drawn(alpha: float, wo: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return facets m (n, 3) of GGX by D m_z, and their weights by (o·m)⁺ / (o_z m_z) G₁(o)."""
    u, turn = rng.random(SAMPLES), 2.0 * np.pi * rng.random(SAMPLES)
    up = 1.0 / np.sqrt(1.0 + alpha**2 * u / (1.0 - u))
    flat = np.sqrt(1.0 - up**2)
    m = np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=1)
    seen = np.maximum(m @ wo, 0.0)
    return m, seen / (up * wo[2]) / (1.0 + masking(alpha, wo[2]))


def masking(alpha: float, cosine: Array) -> Array:
    return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)


def passed(alpha: float, out: float, back: Array) -> Array:
    own = masking(alpha, np.array(out))
    return (1.0 + own) / (1.0 + own + masking(alpha, back))


def mirrored(alpha: float, wo: Array, m: Array) -> Array:
    back = 2.0 * (m @ wo) * m[:, 2] - wo[2]
    return np.where(back > 0.0, passed(alpha, wo[2], back), 0.0)


def through_glass(alpha: float, wo: Array, m: Array) -> Array:
    seen = np.maximum(m @ wo, 0.0)
    share = Dielectric(np.full(len(m), GLASS)).reflectance(seen)[:, 0]
    back = (seen / GLASS - np.sqrt(1.0 - (1.0 - seen**2) / GLASS**2)) * m[:, 2] - wo[2] / GLASS
    return share * mirrored(alpha, wo, m) + (1.0 - share) * passed(alpha, wo[2], back)


def towards_one(alpha: float, wo: Array, m: Array) -> Array:
    face = Remapped(np.full(len(m), GLASS), np.zeros((len(m), 1)))
    return face.reflectance(np.maximum(m @ wo, 0.0))[:, 0] * (mirrored(alpha, wo, m) > 0.0)


@pytest.mark.parametrize(
    ("table", "term"),
    [
        pytest.param(lambda: reflecting()[0], mirrored, id="reflecting"),
        pytest.param(lambda: clear(NODE)[0], through_glass, id="glass"),
        pytest.param(lambda: remapped(NODE)[0], towards_one, id="layers"),
    ],
)
@pytest.mark.parametrize(("rough", "cosine"), [(0.2, 0.2), (0.4, 1.0), (0.6, 0.4), (1.0, 0.6)])
def test_tables_agree_with_facets_drawn_by_area(
    table: object, term: object, rough: float, cosine: float, rng: np.random.Generator
) -> None:
    nodes = table()
    row, column = (round(x * (len(nodes) - 1)) for x in (rough, cosine))
    alpha, up = (row / (len(nodes) - 1)) ** 2, column / (len(nodes) - 1)
    wo = np.array([np.sqrt(1.0 - up**2), 0.0, up])
    m, weight = drawn(alpha, wo, rng)
    found = weight * term(alpha, wo, m)
    error = found.std() / np.sqrt(SAMPLES)
    assert abs(nodes[row, column] - found.mean()) < SIGMAS * error + TABLES


def test_compensated_white_faces_send_back_everything(rng: np.random.Generator) -> None:
    n, cosine, alpha = 40_000, 22.0 / 31.0, (25.0 / 31.0) ** 2
    wo = np.tile([np.sqrt(1.0 - cosine**2), 0.0, cosine], (n, 1))
    frame = Frame(*(np.tile(axis, (n, 1)) for axis in np.eye(3)))
    rough = np.full(n, alpha)
    lobe = Microfacet(np.ones((n, 3)), frame, wo, rough, rough)
    value, density = lobe.evaluate(lobe.sample(rng.random((n, 2))))
    ratio = value[:, 0] / np.maximum(density, 1e-300)
    factor, dark = compensation(wo[:1, 2], rough[:1], np.ones((1, 1)))
    error = ratio.std() / np.sqrt(n)
    assert abs(ratio.mean() * factor[0, 0] - 1.0) < SIGMAS * error + TABLES
    assert dark[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("face", "within"),
    [
        (Dielectric(np.full(64, 1.5)), 3e-3),
        (Dielectric(np.full(64, 1.0 / 1.5)), 7e-3),
        (EdgeTint.tinted(0.6 * WHITE, 0.5 * WHITE), 1e-9),
        (Conductor((0.2 + 3.9j) * WHITE), 5e-3),
        (Remapped(np.full(64, 1.5), 0.2 * WHITE), 3e-3),
    ],
)
def test_means_are_those_of_the_curves(face: Fresnel, within: float) -> None:
    expected = np.sum(WEIGHTS * COSINES * face.reflectance(COSINES)[:, 0])
    assert face.mean[0, 0] == pytest.approx(expected, abs=within)


def test_curves_pass_through_what_is_known() -> None:
    ior = np.array([1.5, 1.5, 1.0 / 1.5])
    brewster = 1.0 / np.sqrt(1.0 + 1.5**2)
    found = Dielectric(ior).reflectance(np.array([1.0, brewster, 0.5]))[:, 0]
    half = 0.5 * ((1.5**2 - 1.0) / (1.5**2 + 1.0)) ** 2  # one polarisation passes whole
    np.testing.assert_allclose(found, [0.04, half, 1.0], rtol=1e-12)
    assert index_of(normal_reflectance(ior[:1])) == pytest.approx(1.5)
    base, tint, edge = 0.6 * WHITE[:1], 0.5 * WHITE[:1], np.array([1.0 / 7.0])
    plain = EdgeTint.tinted(base, WHITE[:1]).reflectance(edge)
    assert plain == pytest.approx(0.6 + 0.4 * (6.0 / 7.0) ** 5)
    assert EdgeTint.tinted(base, tint).reflectance(edge) == pytest.approx(0.5 * plain)
    clear_metal = Conductor((1.5 + 0j) * WHITE[:1].astype(complex))
    np.testing.assert_allclose(clear_metal.reflectance(np.array([brewster]))[0], half, rtol=1e-12)
