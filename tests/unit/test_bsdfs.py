# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's curves and tables of lost energy by other ways; lobes without roughness; Mitsuba's."""

import numpy as np
import pytest

from blender_rad.bsdfs import Frame, Lobe
from blender_rad.bsdfs._diffuse import Diffuse
from blender_rad.bsdfs._energy import clear, reflecting, remapped
from blender_rad.bsdfs._fresnel import (
    Conductor,
    Dielectric,
    EdgeTint,
    Remapped,
    index_of,
    normal_reflectance,
)
from blender_rad.bsdfs._microfacet import (
    Microfacet,
    Refraction,
    beckmann_masking,
    ggx_masking,
    slopes,
)
from blender_rad.bsdfs.glossy import AshikhminShirley

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
def test_tables_agree_with_facets_drawn_by_area(table, term, rough, cosine, rng):
    """Of lost energy, made with facets drawn by sight."""
    nodes = table()
    row, column = (round(x * (len(nodes) - 1)) for x in (rough, cosine))
    alpha, up = (row / (len(nodes) - 1)) ** 2, column / (len(nodes) - 1)
    wo = np.array([np.sqrt(1.0 - up**2), 0.0, up])
    m, weight = drawn(alpha, wo, rng)
    found = weight * term(alpha, wo, m)
    error = found.std() / np.sqrt(SAMPLES)
    assert abs(nodes[row, column] - found.mean()) < SIGMAS * error + TABLES


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
def test_means_are_those_of_the_curves(face, within):
    expected = np.sum(WEIGHTS * COSINES * face.reflectance(COSINES)[:, 0])
    assert face.mean[0, 0] == pytest.approx(expected, abs=within)


def test_curves_pass_through_what_is_known():
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


def turned_over(wo: Array) -> tuple[Array, Array]:
    return wo * [-1.0, -1.0, 1.0], np.ones(len(wo))


def snell(wo: Array) -> tuple[Array, Array]:
    """Its direction, and the light that is not reflected."""
    flat = -wo[:, :2] / 1.5
    down = -np.sqrt(1.0 - np.sum(flat**2, axis=1))
    passed = 1.0 - Dielectric(np.full(len(wo), 1.5)).reflectance(wo[:, 2])[:, 0]
    return np.column_stack([flat, down]), passed


def sharp_glass(*shape: Array) -> Lobe:
    ior = np.full(len(shape[0]), 1.5)
    return Refraction(*shape, Dielectric(ior), ior=ior)


SHARP = [(Microfacet, turned_over), (AshikhminShirley, turned_over), (sharp_glass, snell)]


@pytest.mark.parametrize(("lobe", "expected"), SHARP)
def test_sharp_faces_send_all_light_one_way(lobe, expected, rng):
    n = 500
    normal = rng.normal(size=(n, 3))
    frame = Frame.around(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    cosine, turn = rng.uniform(0.05, 1.0, n), 2.0 * np.pi * rng.random(n)
    flat = np.sqrt(1.0 - cosine**2)
    wo = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), cosine])
    one = lobe(np.ones((n, 3)), frame, wo, np.zeros(n), np.zeros(n))
    wi = one.sample(rng.random((n, 2)))
    way, passed = expected(wo)
    np.testing.assert_allclose(frame.local(wi), way, atol=1e-12)
    value, density = one.evaluate(wi)
    np.testing.assert_allclose(value[:, 0] / density, passed, rtol=1e-12)
    off = wi + 1e-5 * normal
    value, density = one.evaluate(off / np.linalg.norm(off, axis=1, keepdims=True))
    assert not value.any() and not density.any(), "lights without extent are not seen"


# Mitsuba's at random pairs of directions, where the models are the same. Mitsuba 3 has no Phong. It
# masks both ways apart, G₁(i) G₁(o), where Cycles and we correlate the heights,
# 1/(1 + Λ(i) + Λ(o)): that ratio is taken out.

COLOUR = (0.8, 0.5, 0.1)
ETA, K = (0.2, 0.92, 1.1), (3.9, 2.45, 2.14)  # copper


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["diffuse", "ggx", "beckmann"])
@pytest.mark.parametrize("alpha", [(0.05, 0.05), (0.3, 0.3), (0.7, 0.2)])
@pytest.mark.parametrize("metal", [False, True], ids=["mirror", "copper"])
def test_lobes_are_those_of_mitsuba(kind, alpha, metal, rng):
    mitsuba = pytest.importorskip("mitsuba", reason="needs the extra `witnesses`")
    n, same = 2000, 1e-4
    both = rng.normal(size=(2, n, 3))  # a half of the second near the mirror of the first
    both[1, ::2] = both[0, ::2] * [-1.0, -1.0, 1.0] + 0.2 * both[1, ::2]
    both[..., 2] = np.abs(both[..., 2]) + 0.01
    viewer, light = both / np.linalg.norm(both, axis=-1, keepdims=True)
    upright = Frame(*(np.tile(axis, (n, 1)) for axis in np.eye(3)))
    if kind == "diffuse":
        colour = np.tile(COLOUR, (n, 1))
        ours, density = Diffuse(colour, upright, viewer, np.zeros(n), colour).evaluate(light)
        ours = colour * ours
        description = {"type": kind, "reflectance": {"type": "rgb", "value": COLOUR}}
    else:
        ax, ay = (np.full(n, a) for a in alpha)
        fresnel = Conductor(np.tile(np.array(ETA) + 1j * np.array(K), (n, 1))) if metal else None
        beckmann = kind == "beckmann"
        lobe = Microfacet(np.ones((n, 3)), upright, viewer, ax, ay, fresnel, beckmann)
        ours, density = lobe.evaluate(light)
        masking = beckmann_masking if beckmann else ggx_masking
        out, back = (masking(slopes(w, ax, ay)) for w in (viewer, light))
        ours = ours * ((1.0 + out + back) / ((1.0 + out) * (1.0 + back)))[:, None]
        index = {"eta": {"type": "rgb", "value": ETA}, "k": {"type": "rgb", "value": K}}
        description = {"type": "roughconductor", "distribution": kind, "alpha_u": alpha[0]}
        description |= {"alpha_v": alpha[1]} | (index if metal else {"material": "none"})
    mitsuba.set_variant("scalar_rgb")
    bsdf, context = mitsuba.load_dict(description), mitsuba.BSDFContext()
    value, pdf = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        point = mitsuba.SurfaceInteraction3f()
        point.wi, towards = viewer[k].tolist(), light[k].tolist()
        value[k] = np.array(bsdf.eval(context, point, towards))
        pdf[k] = bsdf.pdf(context, point, towards)
    assert np.allclose(ours, value, rtol=same, atol=same * 1e-2)
    if kind != "beckmann":  # whose visible normals are drawn by GGX's here
        assert np.allclose(density, pdf, rtol=same, atol=same * 1e-2)
