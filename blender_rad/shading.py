# SPDX-License-Identifier: GPL-3.0-or-later
"""What the materials of a scene are at points on its surfaces."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from .arrays import Floats, Ints, Singles
from .scene import BLACK, Instance, Material, Scene
from .surfaces import Geometry, Surface, dot, normalized, pick
from .tangents import around, tangents
from .textures import GENERATED, NORMAL, TANGENT, Context, Expression

CLOSED = (5, 0, 0)  # Blender's version from which on longitudes have no seam


class Shading:
    """A colour of `materials`, those of the scene by default, constant or not.

    `name` is that of a colour of `Material` that has a ``…_texture``, or normal.
    """

    def __init__(
        self,
        scene: Scene,
        geometry: Geometry,
        name: str,
        materials: Sequence[Material] | None = None,
    ) -> None:
        self._scene, self._geometry = scene, geometry
        materials = scene.materials if materials is None else materials
        bent, varying = name == "normal", name if name == "normal" else f"{name}_texture"
        colours = [BLACK if bent else getattr(m, name) for m in materials]
        self._colours = np.array(colours, dtype=np.float64).reshape(-1, 3)
        textures: list[Expression | None] = [getattr(m, varying) for m in materials]
        self._textures = {k: texture for k, texture in enumerate(textures) if texture}

    def at(self, surface: Surface) -> Floats:
        """Return the colours (n, 3) of points on surfaces."""
        found = pick(self._colours, surface.material)
        every = contexts(self._scene, self._geometry, surface, self._textures)
        for material, rows, context in every:
            found[rows] += self._textures[material].rgb(context, len(rows))
        return found


def contexts(
    scene: Scene, geometry: Geometry, surface: Surface, materials: Iterable[int]
) -> Iterator[tuple[int, Ints, Context]]:
    """Yield each of `materials`, the points (k,) that it has on one instance, and their context."""
    for material in materials:
        own = np.flatnonzero(surface.material == material)
        for index in np.unique(surface.instance.take(own)):
            rows = own[surface.instance.take(own) == index]
            instance = scene.instances[index]
            context = context_on(
                scene,
                instance,
                surface.triangle.take(rows) - geometry.first[index],
                np.stack([surface.u, surface.v])[:, rows],
                surface.incoming.take(rows, axis=0),
            )
            context.normal = surface.normal.take(rows, axis=0)
            if scene.measured is not None and surface.subpixel is not None:
                table = scene.measured.reshape(len(scene.measured), -1, 3)
                context.measured = partial(_looked_up, table, surface.subpixel.take(rows))
            yield material, rows, context


def _looked_up(table: Singles, points: Ints, slot: int) -> Floats:
    """Return the values (n, 3) of a slot at `points` (n,) of a table (slots, points, 3)."""
    return table[slot].take(points, axis=0).astype(np.float64)


def context_on(
    scene: Scene, instance: Instance, triangle: Ints, uv: Floats, incoming: Floats
) -> Context:
    """Return where points on a mesh are, and who looks at them.

    They are on a `triangle` (n,) of the mesh, by the barycentric weights `uv` (2, n) of its second
    and third corner, and seen along `incoming` (n, 3) [bu], which reaches to the viewers.
    """
    weights = np.stack([1.0 - uv[0] - uv[1], *uv], axis=1)
    mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
    corners = mesh.vertices[mesh.triangles[triangle]].astype(np.float64)
    local = np.einsum("nk,nkd->nd", weights, corners)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cofactor = np.linalg.det(matrix[:3, :3]) * np.linalg.pinv(matrix[:3, :3])
    geometric = normalized(across @ cofactor) * np.sign(np.linalg.det(matrix[:3, :3]))
    normal, raw = geometric, normalized(across)
    if mesh.normals is not None:
        rows = mesh.smooth[triangle]
        smooth = np.einsum("nk,nkd->nd", weights, mesh.normals[triangle].astype(np.float64))
        raw = np.where(rows[:, None], smooth, raw)
        normal = normalized(smooth @ np.linalg.pinv(matrix[:3, :3]))
        normal[~rows] = geometric[~rows]
    towards = normalized(incoming)
    side = np.where(dot(geometric, towards) < 0.0, -1.0, 1.0)[:, None]

    def attribute(name: str) -> Floats | None:
        if name == GENERATED and mesh.texture_space and name not in mesh.attributes:
            centre, size = mesh.texture_space
            return 0.5 + 0.5 * (local - centre) / np.where(size == 0.0, 1.0, size)
        if name == NORMAL:
            return raw
        found = mesh.attributes.get(name)
        if found is None and name.endswith(TANGENT):
            mapped = mesh.attributes.get(name.removesuffix(TANGENT))
            closed = mapped is None and scene.blender_version >= CLOSED
            mapped = around(mesh) if mapped is None and name == TANGENT else mapped
            if mapped is not None:
                found = mesh.attributes[name] = tangents(mesh, mapped, closed=closed)
        return None if found is None else np.einsum("nk,nkd->nd", weights, found[triangle])

    return Context(
        position=local @ matrix[:3, :3].T + matrix[:3, 3],
        normal=normal * side,
        geometric=geometric * side,
        incoming=towards,
        distance=np.sqrt(dot(incoming, incoming))[:, None],
        backfacing=(side < 0.0).astype(float),
        parametric=np.pad(weights[:, :2], ((0, 0), (0, 1))),
        object_from_world=np.linalg.pinv(matrix),
        attribute=attribute,
    )
