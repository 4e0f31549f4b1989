# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions against values worked out by hand; each node against Cycles is in tests/blender."""

import pickle

import numpy as np
import pytest

from blender_rad.lights.mesh import MeshLight
from blender_rad.textures import UV, Context, Expression, constant, folded

PIXELS = np.zeros((2, 3, 4), dtype=np.float32)
PIXELS[..., 0] = [[0.0, 1.0, 4.0], [9.0, 16.0, 25.0]]
PIXELS[..., 3] = 1.0


def image(interpolation: str, extension: str, pixels: object = PIXELS) -> Expression:
    settings = {"pixels": pixels, "encoded": False, "unassociate": False}
    settings |= {"interpolation": interpolation, "extension": extension, "projection": "FLAT"}
    place = Expression("ShaderNodeTexCoord", "UV")
    return Expression("ShaderNodeTexImage", "Color", settings, {"Vector": place})


def red(expression: Expression, x: float, y: float) -> float:
    """Return red at a place in pixels of PIXELS, from the lower left."""
    place = np.array([[x / 3.0, y / 2.0]])
    return float(expression.evaluate(Context(attribute={UV: place}.get))[0, 0])


@pytest.mark.parametrize(
    ("interpolation", "extension", "place", "value"),
    [
        ("Closest", "REPEAT", (-0.1, 0.5), 4.0),
        ("Closest", "CLIP", (3.1, 0.5), 0.0),
        ("Linear", "EXTEND", (1.25, 1.0), 0.5 * (0.25 * 0 + 0.75 * 1 + 0.25 * 9 + 0.75 * 16)),
        ("Cubic", "EXTEND", (1.5, 1.5), (9 + 4 * 16 + 25) / 6 * 5 / 6 + (0 + 4 + 4) / 6 / 6),
    ],
)
def test_images_interpolate(interpolation, extension, place, value):
    assert red(image(interpolation, extension), *place) == pytest.approx(value, rel=1e-6)


def test_expressions_fold_and_travel():
    inputs = {name: constant(0.25) for name in ("Value", "Value_001", "Value_002")}
    settings = {"operation": "SQRT", "use_clamp": False}
    half = Expression("ShaderNodeMath", "Value", settings, inputs)
    assert folded(half).kind == "VALUE"
    assert (half * constant((1, 2, 3)) + half).value == pytest.approx(np.array([[1.0, 1.5, 2.0]]))
    varying = image("Linear", "REPEAT") * half
    assert varying.value is None
    assert (varying * constant(0.0)).value == 0.0
    assert red(pickle.loads(pickle.dumps(varying)), 1.0, 0.5) == pytest.approx(0.25)


def test_textured_mesh_light_sends_what_its_texture_says(rng):
    """A square whose radiance rises along x from one face, against quadrature."""
    corners = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
    triangles, tint = corners[[[0, 2, 1], [0, 3, 2]]], np.array([1.0, 2.0, 0.0])

    def glow(i, uv, towards):
        a, b, c = np.moveaxis(triangles[i], 1, 0)
        x = (a + uv[0][:, None] * (b - a) + uv[1][:, None] * (c - a))[:, 0]
        return np.where(towards[:, 2] < 0.0, x, 0.0)[:, None] * tint

    light = MeshLight(name="ramp", rgb=np.ones(3), triangles=triangles, texture=glow)
    n = 1 << 15
    origin, up = np.tile([0.3, 0.4, 0.0], (n, 1)), np.tile([0.0, 0.0, 1.0], (n, 1))
    sample = light.sample(origin, up, rng.random((n, 2)))
    values = (sample.weight * sample.wi[:, 2])[:, None] * sample.tint
    x, y = np.meshgrid(*[(np.arange(512) + 0.5) / 512] * 2)
    exact = np.mean(x / ((x - 0.3) ** 2 + (y - 0.4) ** 2 + 1.0) ** 2) * tint
    error = 5.0 * values.std(axis=0) / np.sqrt(n)
    assert np.all(np.abs(values.mean(axis=0) - exact) <= error + 1e-12)
    assert light.radiant_flux() == pytest.approx(np.pi * 0.5 * tint, rel=1e-2)
    assert light.irradiance(origin[:1], up[:1]) is None
    distance, radiance = light.intersect(origin, sample.wi)
    met = sample.weight > 0.0  # some go over the hemisphere, past it
    assert distance[met] == pytest.approx(sample.distance[met])
    assert radiance[met] == pytest.approx(sample.tint[met], abs=1e-9)
    behind = light.sample(origin + 2.0 * up, -up, rng.random((n, 2)))
    assert not behind.tint.any()
