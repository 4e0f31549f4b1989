# SPDX-License-Identifier: GPL-3.0-or-later
"""What rays hit: points, normals and materials, gathered from all meshes at once.

The meshes of a scene are laid end to end in a `Geometry`, so that a batch of hits on any of them
is read by plain indexing. A mesh with a single user is stored in world space, as Cycles' static BVH
has it, a shared one in its own.

Vectors (n, 3) of a batch lie in memory by column (Fortran's order), so that NumPy's loops run along
n: several times faster than along three. Results of arithmetic keep that order; `pick` does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .arrays import Bools, Floats, Ints
from .rays import Hits, transform_points
from .scene import Instance, Scene

T = TypeVar("T", bound=np.generic)

# Ray origins leave the surface by this share of the coordinates' and the triangle's size: float32
# rounds at 6e-8 of it, and a few roundings add up.
RAY_OFFSET = 1e-6


@dataclass(frozen=True)
class Surface:
    """Points (n,) on surfaces, seen from a direction; vectors are (n, 3)."""

    point: Floats  # [bu]
    geometric_normal: Floats  # unit, turned to the viewer's side of the triangle, as is the next
    normal: Floats
    material: Ints  # index into `Scene.materials`
    instance: Ints  # index into `Scene.instances`
    triangle: Ints  # index into the geometry's triangles
    u: Floats  # barycentric weights of the second and third corner
    v: Floats
    incoming: Floats  # towards the viewer
    epsilon: Floats  # [bu] how far a ray's origin must leave the surface
    cutoff: Floats  # cosine below which the shadow terminator offset acts, 0 where it does not
    backfacing: Bools | None = None
    subpixel: Ints | None = None  # index into the points of `Scene.measured`, if there are any


def dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products (n,) of vectors (n, 3)."""
    total = a[:, 0] * b[:, 0]
    total += a[:, 1] * b[:, 1]
    total += a[:, 2] * b[:, 2]
    return total


def pick(vectors: NDArray[T], rows: Ints) -> NDArray[T]:
    """Return `vectors[rows]` (k, m) by column, where `vectors` (n, m) are."""
    return vectors.T.take(rows, axis=1).T


def weighted(weights: tuple[Floats, Floats, Floats], vectors: NDArray[Any]) -> Floats:
    """Return Σ wⱼ vⱼ (n, 3) by column, of three weights (n,) and vectors (n, 3, 3)."""
    total = np.empty((len(vectors), 3), order="F")
    for axis in range(3):
        column = total[:, axis]
        np.multiply(weights[0], vectors[:, 0, axis], out=column)
        column += weights[1] * vectors[:, 1, axis]
        column += weights[2] * vectors[:, 2, axis]
    return total


def cross(a: Floats, b: Floats) -> Floats:
    """Return the vector products (n, 3): several times faster than `numpy.cross`."""
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[:, j] * b[:, k], a[:, k] * b[:, j], out=out[:, i])
    return out


def normalized(vectors: Floats) -> Floats:
    """Return `vectors` (n, 3) at unit length; zero vectors stay zero."""
    squared = dot(vectors, vectors)
    squared[squared == 0.0] = 1.0
    return vectors * (1.0 / np.sqrt(squared))[:, None]


class Geometry:
    """All triangles of a scene in one set of arrays, those of an instance from its `first` on."""

    def __init__(self, scene: Scene) -> None:
        meshes, instances = scene.meshes, scene.instances
        users = Counter(instance.mesh for instance in instances)
        in_world = [i.normals_in_world and users[i.mesh] == 1 for i in instances]
        moves = {i.mesh: i.world_from_object for i, w in zip(instances, in_world, strict=True) if w}
        starts = _starts([len(m.vertices) for m in meshes])
        corners = [m.triangles + starts[k] for k, m in enumerate(meshes)]
        self._corners = _end_to_end(corners, (0, 3), np.int64)
        vertices = [
            transform_points(moves[k], m.vertices) if k in moves else m.vertices
            for k, m in enumerate(meshes)
        ]
        self._vertices = _end_to_end(vertices, (0, 3), np.float64)
        self._size = np.abs(self._vertices).max(axis=1, initial=0.0)[self._corners].max(axis=1)
        self._slots = _end_to_end([m.slots for m in meshes], (0,), np.int64)
        smooth = _end_to_end([m.smooth for m in meshes], (0,), np.bool_)
        shaded = [np.full(len(m.triangles), m.normals is not None) for m in meshes]
        self._shaded = _end_to_end(shaded, (0,), np.bool_)
        self._lifted = (smooth & self._shaded).astype(np.float64)
        self._normal_row = np.cumsum(self._shaded) - 1
        normals = [(m.normals, moves.get(k)) for k, m in enumerate(meshes)]
        turned = [_moved_normals(n, move) for n, move in normals if n is not None]
        self._normals = _end_to_end(turned, (0, 3, 3), np.float32)
        starts = _starts([len(m.triangles) for m in meshes])
        self.first = np.array([starts[i.mesh] for i in instances], dtype=np.int64)
        self._in_world = np.array(in_world, dtype=bool)
        matrices = np.array([i.world_from_object for i in instances]).reshape(-1, 4, 4)
        self._matrix = matrices[:, :3]
        own = np.where(self._in_world[:, None, None], np.eye(4), matrices)
        self._scale = np.linalg.norm(own[:, :3, :3], axis=(1, 2))
        self._distance = np.linalg.norm(own[:, :3, 3], axis=1)
        self._normal_matrix = np.array([_normal_matrix(m) for m in matrices]).reshape(-1, 3, 3)
        self._mirrored = np.linalg.det(matrices[:, :3, :3]) < 0
        self._materials = _material_table(instances)
        self._geometry_offset = np.array([i.terminator_geometry_offset for i in instances])
        shading = np.array([i.terminator_shading_offset for i in instances])
        self.shading_frequency = 1.0 / (1.0 - 0.5 * shading)
        self.shading_is_shifted = bool(shading.any())

    def surface(self, hits: Hits, directions: Floats) -> Surface:
        """Return what rays along `directions` (n, 3) met; all `hits` are hits."""
        triangle = self.first.take(hits.instance) + hits.triangle
        corners = self._vertices.take(self._corners.take(triangle, axis=0), axis=0)
        moved = np.flatnonzero(~self._in_world.take(hits.instance))
        if len(moved):
            matrices = self._matrix.take(hits.instance[moved], axis=0)
            corners[moved] = _transformed(corners[moved], matrices)
        point, edge1, edge2 = (np.asfortranarray(corners[:, k]) for k in range(3))
        edge1 -= point
        edge2 -= point
        geometric = normalized(cross(edge1, edge2))
        if self._mirrored.any():
            geometric[self._mirrored.take(hits.instance)] *= -1.0
        normal = self._shading_normals(hits, triangle, geometric)
        side = np.where(dot(geometric, directions) > 0.0, -1.0, 1.0)[:, None]
        size = self._size.take(triangle) * self._scale.take(hits.instance)
        slots = self._materials.shape[1]
        slot = np.minimum(self._slots.take(triangle), slots - 1)
        return Surface(
            point=point + hits.u[:, None] * edge1 + hits.v[:, None] * edge2,
            geometric_normal=geometric * side,
            normal=normal * side,
            material=self._materials.take(hits.instance * slots + slot),
            instance=hits.instance,
            triangle=triangle,
            u=hits.u,
            v=hits.v,
            incoming=-directions,
            epsilon=RAY_OFFSET * (size + self._distance.take(hits.instance)),
            cutoff=self._lifted.take(triangle) * self._geometry_offset.take(hits.instance),
            backfacing=side[:, 0] < 0.0,
        )

    def _shading_normals(self, hits: Hits, triangle: Ints, geometric: Floats) -> Floats:
        shaded = np.flatnonzero(self._shaded.take(triangle))
        if not len(shaded):
            return geometric
        rows = self._normal_row.take(triangle.take(shaded))
        weights = _barycentric(hits.u.take(shaded), hits.v.take(shaded))
        smooth = normalized(weighted(weights, self._normals.take(rows, axis=0)))
        instance = hits.instance.take(shaded)
        moved = np.flatnonzero(~self._in_world.take(instance))
        if len(moved):
            matrices = self._normal_matrix.take(instance[moved], axis=0)
            smooth[moved] = normalized(np.einsum("nij,nj->ni", matrices, smooth[moved]))
        valid = dot(smooth, smooth) > 0.5
        if len(shaded) == len(triangle) and valid.all():
            return smooth
        normal = geometric.copy(order="K")
        normal[shaded[valid]] = smooth[valid]
        return normal

    def shadow_origins(self, surface: Surface, wi: Floats, cosine: Floats, rows: Ints) -> Floats:
        """Return where shadow rays along `wi` (k, 3) start, (k, 3), from the points `rows` (k,).

        Beside the rounding offset along the geometric normal, towards the side that `wi` is on
        (which does as Cycles does when it lets a ray ignore the triangle that it leaves), this is
        Cycles' shadow terminator geometry offset: smooth triangles are lifted towards the curved
        surface that their normals pretend, for directions near the terminator. `cosine` (n,) is
        theirs from the shading normals; below 0 they go through.
        """
        point, geometric = surface.point, surface.geometric_normal
        epsilon, cutoff = surface.epsilon, surface.cutoff
        if len(rows) < len(point):
            point, geometric = pick(point, rows), pick(geometric, rows)
            epsilon, cutoff, cosine = epsilon.take(rows), cutoff.take(rows), cosine.take(rows)
        through = cosine < 0.0
        if through.any():
            geometric = np.where(through[:, None], -geometric, geometric)
            cosine = np.abs(cosine)
        towards = dot(geometric, wi)
        lifted, amount = _lifted(cosine, towards, cutoff)
        side = np.copysign(epsilon, towards)
        side[lifted] = epsilon.take(lifted)
        origins = geometric * side[:, None]
        origins += point
        if len(lifted):
            lift = self._terminator_lift(surface, rows.take(lifted), pick(geometric, lifted))
            origins[lifted] += lift * amount[:, None]
        return origins

    def _terminator_lift(self, surface: Surface, rows: Ints, side: Floats) -> Floats:
        """Return the displacement (k, 3) to the smooth surface, on the `side` of normals (k, 3).

        The height over the triangle is the larger of half a quadratic that bends as the corner
        normals say and the lower envelope of the corners' tangent planes, as Cycles has it. All
        is done in the space that the mesh is stored in; the height is along the stored normal.
        """
        triangle, instance = surface.triangle[rows], surface.instance[rows]
        places = self._vertices.take(self._corners.take(triangle, axis=0), axis=0)
        normals = self._normals.take(self._normal_row.take(triangle), axis=0)
        weights = _barycentric(surface.u[rows], surface.v[rows])
        u, v, _ = weights
        point, axis = weighted(weights, places), weighted(weights, normals)
        p = [np.asfortranarray(places[:, k]) for k in range(3)]
        n = [np.asfortranarray(normals[:, k], dtype=np.float64) for k in range(3)]
        moved = np.flatnonzero(~self._in_world[instance])
        matrices = self._matrix[instance[moved], :, :3]
        axis[moved] = np.einsum("nij,nj->ni", matrices, axis[moved])
        a = dot(n[2] - n[0], p[0] - p[2])
        b = dot(n[2] - n[1], p[1] - p[2])
        c = dot(n[1] - n[0], p[1] - p[0])
        quadratic = a * u * (u - 1.0) + (a + b + c) * u * v + b * v * (v - 1.0)
        outward = np.where(dot(axis, side) > 0.0, 1.0, -1.0)
        envelope = np.full(len(rows), np.inf)
        for k in range(3):
            corner, tilt = p[k], n[k] * outward[:, None]
            rise = [dot(p[j] - corner, tilt) for j in range(3) if j != k]
            highest = np.maximum(np.maximum(*rise), 0.0)
            envelope = np.minimum(envelope, np.maximum(dot(corner - point, tilt) + highest, 0.0))
        height = outward * np.maximum(envelope, 0.5 * outward * quadratic)
        return axis * height[:, None]


def _lifted(facing: Floats, towards: Floats, cutoff: Floats) -> tuple[Ints, Floats]:
    """Return which points are lifted, and by how much (0 to 1).

    `facing` > 0 and `towards` are the cosines of the light from the shading and geometric normals.
    """
    near = np.flatnonzero((np.minimum(facing, towards) < cutoff) & (cutoff > 0.0))
    facing, towards, cutoff = facing.take(near), towards.take(near), cutoff.take(near)
    amount = np.where(facing < cutoff, 2.0 - (towards + facing) / cutoff, 1.0 - towards / cutoff)
    some = np.flatnonzero(amount > 0.0)
    return near[some], np.minimum(amount[some], 1.0)


def _barycentric(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return 1.0 - u - v, u, v


def _transformed(points: Floats, matrices: Floats) -> Floats:
    """Return points (n, k, 3) moved by affine matrices (n, 3, 4)."""
    turned = np.einsum("nij,nkj->nki", matrices[:, :, :3], points)
    return turned + matrices[:, None, :, 3]


def _normal_matrix(matrix: Floats) -> Floats:
    """Return the inverse transpose of the linear part, up to a positive factor."""
    linear = matrix[:3, :3]
    if np.linalg.det(linear) == 0.0:
        return np.eye(3)
    return np.asarray(np.linalg.inv(linear).T)


def _moved_normals(normals: NDArray[np.float32], move: Floats | None) -> NDArray[np.float32]:
    if move is None:
        return normals
    turned = normals.reshape(-1, 3).astype(np.float64) @ _normal_matrix(move).T
    return normalized(turned).reshape(-1, 3, 3).astype(np.float32)


def _starts(lengths: Sequence[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)]).astype(np.int64)


def _end_to_end(arrays: Sequence[NDArray[Any]], empty: tuple[int, ...], kind: Any) -> NDArray[Any]:
    return np.concatenate([np.zeros(empty, dtype=kind), *arrays]).astype(kind, copy=False)


def _material_table(instances: Sequence[Instance]) -> Ints:
    """Return material indices (instances, slots), the last slot repeated where there are fewer."""
    width = max((len(i.materials) for i in instances), default=1)
    rows = [[*i.materials, *[i.materials[-1]] * (width - len(i.materials))] for i in instances]
    return np.array(rows, dtype=np.int64).reshape(-1, width)
