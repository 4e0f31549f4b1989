# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes against Mitsuba's BSDFs at random pairs of directions, where the models are the same.

Mitsuba 3 has no Phong; what 0.6 had is the modified one, by the same formula. It masks both ways
apart, G₁(i) G₁(o), where Cycles and we correlate the heights, 1/(1 + Λ(i) + Λ(o)): that ratio is
taken out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from blender_rad.bsdfs import Frame
from blender_rad.bsdfs._diffuse import Diffuse
from blender_rad.bsdfs._fresnel import Conductor
from blender_rad.bsdfs._microfacet import Microfacet, beckmann_masking, ggx_masking, slopes

pytestmark = pytest.mark.slow
mitsuba = pytest.importorskip("mitsuba", reason="needs the extra `witnesses`")

N = 2000
ETA, K = (0.2, 0.92, 1.1), (3.9, 2.45, 2.14)  # copper
SAME = 1e-4
Array = np.ndarray


def pairs(rng: np.random.Generator) -> tuple[Array, Array]:
    """Directions of the upper hemisphere, a half of the second near the mirror of the first."""
    both = rng.normal(size=(2, N, 3))
    both[1, ::2] = both[0, ::2] * [-1.0, -1.0, 1.0] + 0.2 * both[1, ::2]
    both[..., 2] = np.abs(both[..., 2]) + 0.01
    return tuple(both / np.linalg.norm(both, axis=-1, keepdims=True))


def theirs(description: dict[str, Any], viewer: Array, light: Array) -> tuple[Array, Array]:
    """Return f cosθ (n, 3) of the light's side, and the density (n,) of its sampling."""
    mitsuba.set_variant("scalar_rgb")
    bsdf, context = mitsuba.load_dict(description), mitsuba.BSDFContext()
    value, density = np.zeros((N, 3)), np.zeros(N)
    for k in range(N):
        point = mitsuba.SurfaceInteraction3f()
        point.wi, towards = viewer[k].tolist(), light[k].tolist()
        value[k] = np.array(bsdf.eval(context, point, towards))
        density[k] = bsdf.pdf(context, point, towards)
    return value, density


def upright() -> Frame:
    return Frame(*(np.tile(axis, (N, 1)) for axis in np.eye(3)))


def test_diffuse(rng: np.random.Generator) -> None:
    viewer, light = pairs(rng)
    colour = np.tile([0.8, 0.5, 0.1], (N, 1))
    ours, density = Diffuse(colour, upright(), viewer, np.zeros(N), colour).evaluate(light)
    reflectance = {"type": "rgb", "value": [0.8, 0.5, 0.1]}
    value, pdf = theirs({"type": "diffuse", "reflectance": reflectance}, viewer, light)
    assert np.allclose(colour * ours, value, rtol=SAME)
    assert np.allclose(density, pdf, rtol=SAME)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize("alpha", [(0.05, 0.05), (0.3, 0.3), (0.7, 0.2)])
@pytest.mark.parametrize("metal", [False, True], ids=["mirror", "copper"])
def test_rough_conductors(
    distribution: str, alpha: tuple[float, float], metal: bool, rng: np.random.Generator
) -> None:
    viewer, light = pairs(rng)
    ax, ay = (np.full(N, a) for a in alpha)
    index = np.tile(np.array(ETA) + 1j * np.array(K), (N, 1))
    fresnel = Conductor(index) if metal else None
    beckmann = distribution == "beckmann"
    lobe = Microfacet(np.ones((N, 3)), upright(), viewer, ax, ay, fresnel, beckmann)
    ours, density = lobe.evaluate(light)
    masking = beckmann_masking if beckmann else ggx_masking
    out, back = (masking(slopes(w, ax, ay)) for w in (viewer, light))
    ours = ours * ((1.0 + out + back) / ((1.0 + out) * (1.0 + back)))[:, None]
    rgb = {"eta": {"type": "rgb", "value": ETA}, "k": {"type": "rgb", "value": K}}
    description = {"type": "roughconductor", "distribution": distribution}
    description |= {"alpha_u": alpha[0], "alpha_v": alpha[1]} | (
        rgb if metal else {"material": "none"}
    )
    value, pdf = theirs(description, viewer, light)
    assert np.allclose(ours, value, rtol=SAME, atol=SAME * 1e-2)
    if not beckmann:  # whose visible normals are drawn by GGX's here
        assert np.allclose(density, pdf, rtol=SAME, atol=SAME * 1e-2)
