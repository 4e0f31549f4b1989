# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles' shadow terminator offsets on coarse smooth meshes, against ours, tile by tile."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blender_rad.rendering import Settings, render

from .agreement import Sides, both_sides, cases, lamp, look_at
from .reading import add, empty_scene, rounded, sphere

TOLERANCE = 0.005
LIGHTS: dict[str, dict[str, Any]] = {
    "point": {"kind": 'POINT', "shadow_soft_size": 0.0},
    "area": {"kind": 'AREA', "size": 1.0},
    "sun": {"kind": 'SUN', "angle": 0.02},
}


def round_mesh() -> Any:
    return sphere("Sphere", 16, 8)


def icosphere_with_custom_normals() -> Any:
    mesh = rounded("Ico", "icosphere", subdivisions=2)
    normals = np.array([tuple(v.normal) for v in mesh.vertices])
    normals += 0.15 * np.random.default_rng(5).normal(size=normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh.normals_split_custom_set_from_vertices(normals.tolist())
    return mesh


BODIES: dict[str, tuple[Callable[[], Any], dict[str, Any]]] = {
    "offset-0": (round_mesh, {"shadow_terminator_geometry_offset": 0.0}),
    "offset-0.1": (round_mesh, {"shadow_terminator_geometry_offset": 0.1}),
    "offset-1": (round_mesh, {"shadow_terminator_geometry_offset": 1.0}),
    "shading-0.5": (round_mesh, {"shadow_terminator_shading_offset": 0.5}),
    "both": (
        round_mesh,
        {"shadow_terminator_shading_offset": 0.3, "shadow_terminator_geometry_offset": 0.3},
    ),
    "mirrored": (round_mesh, {"scale": (-1.2, 0.9, 0.8)}),
    "custom-normals": (icosphere_with_custom_normals, {}),
}


QUICK = [f"{body}-point" for body in BODIES] + ["both-area", "both-sun", "custom-normals-area"]


def lit_body(body: str, light: str) -> Sides:
    empty_scene()
    build, settings = BODIES[body]
    add("Body", build(), **settings)
    look_at((0, 0, 0), (0.5, -4, 0.6), lens=60)
    lamp(location=(2.6, -1.8, 1.6), **LIGHTS[light])
    return both_sides((32, 32), ours=256)


@pytest.mark.feature("picture: tiles 0.5 %")
@pytest.mark.parametrize("name", cases([f"{b}-{x}" for b in BODIES for x in LIGHTS], QUICK))
def test_terminator_is_that_of_cycles(name: str) -> None:
    sides = lit_body(*name.rsplit("-", 1))
    assert not sides.film.excluded.any()
    off, error = sides.tiles()
    assert error.max() < TOLERANCE / 2
    assert (np.abs(off) < TOLERANCE + 3 * error).all()


@pytest.mark.parametrize("body", ["offset-1", "shading-0.5"])
def test_terminator_offsets_are_seen(body: str) -> None:
    """The test above could not fail if the offsets changed nothing that it looks at."""
    sides = lit_body(body, "point")
    plain = tuple(
        replace(i, terminator_geometry_offset=0.0, terminator_shading_offset=0.0)
        for i in sides.scene.instances
    )
    film = render(replace(sides.scene, instances=plain), Settings(samples=256, threads=2))
    off, error = replace(sides, film=film).tiles()
    assert (np.abs(off) > TOLERANCE + 3 * error).any()
