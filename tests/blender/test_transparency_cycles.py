# SPDX-License-Identifier: GPL-3.0-or-later
"""Light through transparent surfaces, ours against that of Cycles.

Panes stand in front of the camera, and others between the light and the floor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

from blender_rad.meters import LuxMeter  # noqa: E402

from .agreement import both_sides, lamp, look_at  # noqa: E402
from .reading import SQUARE, add, material, polygons  # noqa: E402
from .test_features_cycles import SIZE, agrees, stage, world  # noqa: E402

TINT = (0.9, 0.5, 0.2, 1.0)
FLOOR = 0.8  # albedo


def tinted() -> Any:
    """30 % Lambert, the rest coloured and clear."""
    made = material("Pane", "ShaderNodeBsdfTransparent", Color=TINT)
    tree = made.node_tree
    output, clear = tree.get_output_node('CYCLES'), tree.nodes["Transparent BSDF"]
    mix, lambert = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("MixShader", "BsdfDiffuse"))
    mix.inputs[0].default_value = 0.3
    for k, closure in enumerate((clear, lambert)):
        tree.links.new(closure.outputs[0], mix.inputs[k + 1])
    tree.links.new(mix.outputs[0], output.inputs[0])
    return made


def panes(count: int = 3) -> None:
    stage()
    mesh = polygons("Pane", *SQUARE)
    mesh.materials[0] = tinted()
    for k in range(count):
        turned = {"scale": (0.7, 0.7, 1), "rotation_euler": (1.3, 0.1 * k, 0.1)}
        add(f"Pane {k}", mesh, location=(-0.3, -1 - 0.3 * k, 0.6), **turned)
        turned["rotation_euler"] = (0.1, 0.1 * k, 0.1)
        add(f"Roof {k}", mesh, location=(-0.6, 0.1, 1.3 + 0.15 * k), **turned)


@pytest.mark.feature("picture: tiles 1 %, energy 0.2 %")
@pytest.mark.parametrize("film_transparent", [pytest.param(False, marks=pytest.mark.slow), True])
def test_panes(film_transparent: bool) -> None:
    panes()
    lamp('AREA', (-1, -1.2, 2.9))
    world()
    bpy.context.scene.render.film_transparent = film_transparent
    sides = both_sides(SIZE)
    agrees(sides)
    error = np.abs(sides.film.alpha - sides.seeds[..., 3].mean(axis=0))
    assert error.max() < 0.06
    assert film_transparent == bool((sides.film.alpha < 0.9).any())


@pytest.mark.parametrize("bounces", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_bounces_are_counted_as_cycles_counts_them(bounces: int) -> None:
    """Before Blender 5, and with none, what passes one surface too many is chance: left out."""
    panes()
    lamp('POINT', (-1, -1.2, 2.9), shadow_soft_size=0)
    bpy.context.scene.cycles.transparent_max_bounces = bounces
    sides = both_sides(SIZE)
    if bounces and bpy.app.version >= (5, 0):
        agrees(sides)
    kept = ~sides.film.excluded
    assert 0.2 < kept.mean()
    theirs = sides.seeds[..., :3].mean(axis=0, dtype=float)
    off = np.abs(theirs[kept].mean() / sides.film.radiance[kept].mean() - 1)
    assert off < 0.004


@pytest.mark.feature("illuminance on average: 0.2 % in each channel")
def test_lux_meters_behind_panes() -> None:
    """A meter on each pixel of the floor under tinted roofs: E = πL/albedo of what Cycles sees."""
    panes()
    lamp('AREA', (-1, -1.2, 2.9), color=(0.4, 0.7, 1.0))
    lamp('SUN', (0.3, 0.2, 3), energy=2.0, angle=0.2)
    world()
    middle, size, wide = np.array([-0.5, 0.1, 0.0]), (15, 10), 0.6
    down = look_at((*middle[:2], 0), (*middle[:2], 0.9), type='ORTHO', ortho_scale=wide)
    down.rotation_euler = (0, 0, 0)
    sides = both_sides(size, ours=2, samples=256)
    rows, columns = np.indices(size[::-1]).reshape(2, -1) + 0.5
    places = np.stack([columns - size[0] / 2, size[1] / 2 - rows, 0 * rows], axis=1)
    points = middle + places * (wide / size[0])
    meter = LuxMeter(sides.scene, efficacy=1.0, error=0.05, threads=2)
    readings = meter.read(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    seen = sides.seeds[..., :3].mean(axis=(1, 2), dtype=float) * np.pi / FLOOR
    error = seen.std(axis=0, ddof=1) / np.sqrt(len(seen))
    found = readings.irradiance.mean(axis=0)
    assert not readings.excluded
    assert (found.max() > 1.5 * found.min()) and (error < 0.002 * found).all()
    assert (np.abs(seen.mean(axis=0) - found) < 0.002 * found + 3 * error).all()
