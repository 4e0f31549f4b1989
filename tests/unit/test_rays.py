# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray casting against brute force, with single and shared meshes."""

import numpy as np
import pytest

from blender_rad.rays import Caster, transform_points
from blender_rad.scene import Instance
from tests.handmade import mesh, moved, square

TETRAHEDRON = mesh(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
)


def tetrahedra(rng, count):
    """Instances turned, mirrored, squeezed and moved at random."""
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = rng.normal(size=(count, 3, 3))
    matrices[:, :3, 3] = rng.uniform([-6, -6, -2], [6, 6, 2], (count, 3))
    return [Instance(f"t{k}", 0, matrix, (0,)) for k, matrix in enumerate(matrices)]


def brute_force(meshes, instances, origins, directions):
    """Nearest hit of every ray with every triangle, by Cramer's rule."""
    best, found = np.full(len(origins), np.inf), np.full((len(origins), 2), -1)
    for number, instance in enumerate(instances):
        shape = meshes[instance.mesh]
        corners = transform_points(instance.world_from_object, shape.vertices)[shape.triangles]
        for index, (a, b, c) in enumerate(corners):
            columns = np.stack(np.broadcast_arrays(b - a, c - a, -directions), axis=-1)
            u, v, t = np.linalg.solve(columns, (origins - a)[..., None])[..., 0].T
            nearer = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < best)
            best[nearer], found[nearer] = t[nearer], (number, index)
    return best, found


@pytest.mark.parametrize("count", [1, 40])
def test_hits_match_brute_force(rng, count):
    meshes = [TETRAHEDRON, square(9.0)]
    instances = [*tetrahedra(rng, count), Instance("floor", 1, moved(z=-9.0), (0,))]
    origins = np.column_stack([rng.uniform(-8, 8, (3000, 2)), np.full(3000, 10.0)])
    directions = rng.normal([0, 0, -4], 0.5, (3000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    caster = Caster(meshes, instances, range(len(instances)))
    hits = caster.intersect(origins, directions)
    distance, found = brute_force(meshes, instances, origins, directions)
    same = hits.instance == found[:, 0]
    assert same.mean() > 0.999  # ties at edges may fall either way
    np.testing.assert_array_equal(hits.triangle[same], found[same, 1])
    np.testing.assert_allclose(hits.distance[same], distance[same], rtol=1e-5)
    assert len(np.unique(hits.instance)) > min(count, 30)
    blocked = caster.occluded(origins, directions, distance * 1.001)
    np.testing.assert_array_equal(blocked, np.isfinite(distance))
    assert not caster.occluded(origins, directions, distance * 0.99).any()


def test_only_chosen_instances_are_hit():
    instances = [Instance("low", 0, np.eye(4), (0,)), Instance("lower", 0, -np.eye(4), (0,))]
    ray = np.array([[0.1, 0.2, 3.0]]), np.array([[0.0, 0.0, -1.0]])
    assert Caster([square()], instances, [1]).intersect(*ray).instance[0] == 1
    nothing = Caster([square()], instances, []).intersect(*ray)
    assert nothing.instance[0] == -1 and np.isinf(nothing.distance[0])


def test_shared_mesh_is_stored_once(rng):
    """10 000 instances of 100 000 triangles: a copy each would need hundreds of GB."""
    big = mesh(rng.uniform(-1, 1, (50_000, 3)), rng.integers(0, 50_000, (100_000, 3)))
    places = [moved(3.0 * (k % 100), 3.0 * (k // 100)) for k in range(10_000)]
    instances = [Instance("i", 0, place, (0,)) for place in places]
    caster = Caster([big], instances, range(len(instances)))
    columns = np.array([[3.0 * 42, 3.0 * 17, 9.0], [3.0 * 99, 0.0, 9.0]])
    hits = caster.intersect(columns, np.tile([0.0, 0.0, -1.0], (2, 1)))
    np.testing.assert_array_equal(hits.instance, [1742, 99])


def test_casters_without_end():
    """A device a scene, each with keys of threads' storage, ended the program at about 1 100."""
    instances = [Instance("a", 0, np.eye(4), (0,)), Instance("b", 0, moved(z=1.0), (0,))]
    ray = np.array([[0.1, 0.2, 3.0]]), np.array([[0.0, 0.0, -1.0]])
    casters = [Caster([TETRAHEDRON], instances, [0, 1]) for _ in range(3000)]
    assert {int(caster.intersect(*ray).instance[0]) for caster in casters} == {1}
