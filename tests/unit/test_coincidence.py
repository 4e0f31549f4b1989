# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that lie on others are found wherever they are seen, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest

from blender_rad.checking import Check, Terms
from blender_rad.coincidence import coincident_faces
from blender_rad.direct import DirectLight
from blender_rad.scene import Instance, Mesh
from tests.handmade import Floats, ball, camera_above, mesh, moved, scene, square

FLOOR, SMALL = square(), square(3.1)


def seen(
    meshes: list[Mesh], places: list[tuple[int, Floats]], at: float
) -> dict[tuple[str, str], float]:
    """The pairs of names, and the shares of a picture 4 wide around `at` where they coincide."""
    instances = [Instance(f"{k}", m, place, (0,)) for k, (m, place) in enumerate(places)]
    camera = replace(camera_above(), world_from_camera=moved(at, at, 10.0))
    made = scene(meshes, instances, [], camera, resolution=(64, 64))
    found = coincident_faces(DirectLight(made))
    return {(c.name, c.feature.split()[-1]): float(m.mean()) for c, m in found.items()}


def joined(*parts: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(p.vertices) for p in parts)])
    faces = [p.triangles + start for p, start in zip(parts, starts, strict=False)]
    return mesh(np.concatenate([p.vertices for p in parts]), np.concatenate(faces))


def turned(mesh_: Mesh, angle: float, axis: int = 2) -> Mesh:
    i, j = [k for k in range(3) if k != axis]
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return replace(mesh_, vertices=(mesh_.vertices @ matrix.T).astype(np.float32))


FLIPPED = replace(FLOOR, triangles=FLOOR.triangles[:, ::-1])
HERE = np.eye(4)


@pytest.mark.parametrize("at", [0.0, 70.0])
@pytest.mark.parametrize(
    ("meshes", "others"),
    {
        "copy": ([FLOOR, FLOOR], [(0, HERE), (1, HERE)]),
        "flipped": ([FLOOR, FLIPPED], [(0, HERE), (1, HERE)]),
        "turned": ([FLOOR, turned(SMALL, 0.3)], [(0, HERE), (1, HERE)]),
        "a hair lower": ([FLOOR, SMALL], [(0, HERE), (1, moved(z=-1e-6))]),
        "instance": ([FLOOR], [(0, HERE), (0, HERE)]),
        "same mesh, larger": ([joined(FLOOR, SMALL)], [(0, HERE)]),
        "slanted": ([turned(FLOOR, 0.5, 0), turned(SMALL, 0.5, 0)], [(0, HERE), (1, HERE)]),
    }.values(),
)
def test_faces_that_coincide_are_found(meshes, others, at):
    found = seen(meshes, [(m, moved(at, at) @ place) for m, place in others], at)
    assert list(found) == [("0", str(len(others) - 1))]
    assert found.popitem()[1] > 0.97


@pytest.mark.parametrize("at", [0.0, 70.0])
@pytest.mark.parametrize(
    ("meshes", "places"),
    {
        "decal": ([FLOOR, SMALL], [(0, HERE), (1, moved(z=1e-4))]),
        "thin box": ([joined(SMALL, replace(SMALL, vertices=SMALL.vertices - [0, 0, 1e-3]))], []),
        "fold": ([turned(ball(4, 8, smooth=False), 0.2, 1)], []),
        "fine ball": ([ball(200, 400)], []),
        "crossing": ([FLOOR, turned(FLOOR, 0.01, 0)], [(0, HERE), (1, HERE)]),
        "beside": ([square(0.5)], [(0, moved(x, y)) for x in range(-2, 3) for y in range(-2, 3)]),
    }.values(),
)
def test_nothing_else_is(meshes, places, at):
    places = places or [(0, HERE)]
    assert not seen(meshes, [(m, moved(at, at) @ place) for m, place in places], at)


def test_a_narrow_strip_is_followed():
    """Two floors that overlap by a sixth of a pixel."""
    instances = [Instance("a", 0, moved(-5.0), (0,)), Instance("b", 0, moved(4.99), (0,))]
    made = scene([FLOOR], instances, [], resolution=(64, 64))
    (mask,) = coincident_faces(DirectLight(made)).values()
    assert mask.any(axis=1).all()
    assert mask.any(axis=0).sum() == 1


def test_they_are_left_out_with_a_finding():
    instances = [Instance("floor", 0, HERE, (0,)), Instance("patch", 1, HERE, (0,))]
    film = Check(scene([FLOOR, square(1.0)], instances, []), Terms(samples=2)).film
    assert film.excluded.mean() == pytest.approx((10 / 16) ** 2)  # with the rim of a pixel
    (finding,) = film.findings
    assert (finding.code, finding.object) == ("coincident-faces", "floor")
    assert "patch in 100 pixels" in finding.message
