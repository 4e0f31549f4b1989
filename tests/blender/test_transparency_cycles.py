# SPDX-License-Identifier: GPL-3.0-or-later
"""Light through transparent surfaces, holdouts and indirect-only collections: ours and Cycles'.

Panes stand in front of the camera, and others between the light and the floor.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.meters import LuxMeter

from .agreement import (
    FINE,
    PICTURE,
    agrees,
    both_sides,
    cases,
    glow,
    lamp,
    look_at,
    panes,
    square,
    stage,
)
from .reading import gathered, material, node, world

SKY = {"Color": (0.3, 0.4, 0.6, 1)}
FLOOR = 0.8  # albedo


def through_panes(*, clear: bool, **light: Any) -> None:
    panes()
    lamp('AREA', (-1, -1.2, 2.9), **light)
    world(**SKY)
    bpy.context.scene.render.film_transparent = clear


@pytest.mark.feature(PICTURE)
@pytest.mark.parametrize("film_transparent", [pytest.param(False, marks=pytest.mark.slow), True])
def test_panes(film_transparent: bool) -> None:
    through_panes(clear=film_transparent)
    sides = both_sides(**FINE)
    agrees(sides)
    error = np.abs(sides.film.alpha - sides.seeds[..., 3].mean(axis=0))
    assert error.max() < 0.06
    assert film_transparent == bool((sides.film.alpha < 0.9).any())


@pytest.mark.parametrize("radius", [0.0, pytest.param(0.1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("bounces", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_bounces_are_counted_as_cycles_counts_them(bounces: int, radius: float) -> None:
    """Before Blender 5, and with none, what of a light with a radius passes one surface too many
    is chance: left out.
    """
    panes()
    lamp('POINT', (-1, -1.2, 2.9), shadow_soft_size=radius)
    bpy.context.scene.cycles.transparent_max_bounces = bounces
    sides = both_sides(**FINE)
    if not radius or (bounces and bpy.app.version >= (5, 0)):
        agrees(sides)
    kept = ~sides.film.excluded
    assert 0.2 < kept.mean()
    theirs = sides.seeds[..., :3].mean(axis=0, dtype=float)
    off = np.abs(theirs[kept].mean() / sides.film.radiance[kept].mean() - 1)
    assert off < 0.004


@pytest.mark.feature("illuminance on average: 0.2 % in each channel")
def test_lux_meters_behind_panes() -> None:
    """A meter on each pixel of the floor under tinted roofs: E = πL/albedo of what Cycles sees."""
    through_panes(clear=False, color=(0.4, 0.7, 1.0))
    lamp('SUN', (0.3, 0.2, 3), energy=2.0, angle=0.2)
    middle, size, wide = np.array([-0.5, 0.1, 0.0]), (15, 10), 0.6
    down = look_at((*middle[:2], 0), (*middle[:2], 0.9), type='ORTHO', ortho_scale=wide)
    down.rotation_euler = (0, 0, 0)
    sides = both_sides(size, ours=2, seeds=8, samples=256)
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


# --- holdouts -------------------------------------------------------------------------------------


def lit(**box: Any) -> Any:
    """The stage under a lamp and a world; its box is returned."""
    made = stage(**box)
    lamp('AREA', (-1, -1.2, 2.5))
    world(**SKY)
    return made


def held_and_glowing() -> None:
    """What is held out lights other surfaces as ever, but is not seen."""
    box = lit(is_holdout=True)
    box.data.materials[0] = glow()


def layer(flag: str) -> None:
    """The stage's box and a lamp that shows in a collection with a flag of the layer."""
    seen = {"size": 0.7, "visible_camera": True}
    members = lit(), lamp('AREA', (-1, 0.3, 1.4), (0.5, -6, 3), **seen)
    gathered("Made", *members, shown=True)
    setattr(bpy.context.view_layer.layer_collection.children["Made"], flag, True)


def shader() -> None:
    """30 % held out by a shader, in front of the box."""
    lit()
    hole = material("Hole", lambda tree: node(
        tree, "MixShader", 0.3, node(tree, "BsdfDiffuse"), node(tree, "Holdout")
    ))  # fmt: skip
    place = {"location": (-0.3, -1, 0.6), "rotation_euler": (1.3, 0, 0.1)}
    square("Pane", hole, **place, scale=(0.7, 0.7, 1))


def held_panes() -> None:
    """Tinted panes, of which one is held out: behind it there is what it lets pass."""
    through_panes(clear=True)
    bpy.data.objects["Pane 1"].is_holdout = True


def on_clear_film(build: Callable[[], Any]) -> None:
    build()
    bpy.context.scene.render.film_transparent = True


HELD = partial(lit, is_holdout=True)
CASES: dict[str, Callable[[], Any]] = {
    "object": HELD,
    "object-on-clear-film": partial(on_clear_film, HELD),
    "emitting-object": held_and_glowing,
    "collection": partial(layer, "holdout"),
    "indirect-only-collection": partial(layer, "indirect_only"),
    "shader": shader,
    "shader-on-clear-film": partial(on_clear_film, shader),
    "tinted-panes": held_panes,
}
QUICK = ("object-on-clear-film", "indirect-only-collection", "shader")


@pytest.mark.feature("picture and alpha: tiles 1 %, energy 0.2 %", area="Holdouts")
@pytest.mark.parametrize("name", cases(CASES, QUICK))
def test_holdout_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    sides = both_sides(ours=192 if name == "emitting-object" else 128, seeds=8)
    agrees(sides)
    assert not sides.scene.unsupported
    alpha = sides.seeds[..., 3].mean(axis=0)
    assert abs(alpha.mean() - sides.film.alpha.mean()) < 0.003
    assert "indirect" in name or np.ptp(alpha) > 0.2
