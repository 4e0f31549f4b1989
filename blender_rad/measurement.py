# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender has measured, for the points that the camera sees first.

`Scene.measured` holds values at points k to a pixel's width. A camera ray takes those of the
nearest one, or of one beside that, where the view meets the same material of the same object on a
face that looks about the same way; where none does, the ray is left out. So outlines are as sharp
as without, and values err by how much they change over a fraction of a pixel, in no direction.
"""

from dataclasses import replace

import numpy as np

from .arrays import Bools, Floats, Ints
from .cameras import FLAT, camera_rays
from .rays import Caster
from .scene import Camera, Scene
from .shading import Shading
from .surfaces import Geometry, Surface, dot, normalized, pick

ALIKE = 0.7  # cosine between faces
BESIDE = sorted(
    ((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)), key=lambda s: abs(s[0]) + abs(s[1])
)


class Measurement:
    """Finds measured points; the `caster` is that of camera rays."""

    def __init__(self, scene: Scene, camera: Camera, geometry: Geometry, caster: Caster) -> None:
        self._scene, self._camera, self._geometry, self._caster = scene, camera, geometry, caster
        self._needed = np.array([m.measured for m in scene.materials], dtype=bool)
        self._normals = Shading(scene, geometry, "normal")

    def of(self, surface: Surface, where: Floats) -> tuple[Surface, Ints]:
        """Return `surface` with its measured points and normals, and what has none (k,).

        `where` (n, 2) are the places in the picture that it is seen at [pixels].
        """
        point, missing = self._points(surface, where)
        surface = replace(surface, subpixel=point)
        bent, normal = normalized(self._normals.at(surface)), surface.normal.copy(order="K")
        rows = bent.any(axis=1)
        normal[rows] = bent[rows]
        return replace(surface, normal=normal), missing

    def _points(self, surface: Surface, where: Floats) -> tuple[Ints, Ints]:
        """Return a point for each place, and the places that have none."""
        point = np.zeros(len(where), dtype=np.int64)
        missing = np.flatnonzero(self._needed.take(surface.material))
        if self._scene.measured is None:
            return point, missing
        edge = self._at_the_edge(missing, where)
        size = np.array(self._scene.measured.shape[2:0:-1])
        finer = size[0] / self._scene.resolution[0]
        for beside in BESIDE:
            if not len(missing):
                break
            cell = np.clip(np.floor(pick(where, missing) * finer) + beside, 0, size - 1)
            alike = self._alike(surface, missing, (cell + 0.5) / finer)
            column, row = cell[alike].astype(np.int64).T
            point[missing[alike]] = (size[1] - 1 - row) * size[0] + column
            missing = missing[~alike]
        return point, np.union1d(missing, edge)

    def _at_the_edge(self, rows: Ints, where: Floats) -> Ints:
        """Return the `rows` beside which panoramas end: Cycles' slopes are unbounded there."""
        if self._camera.kind in FLAT:
            return rows[:0]
        beside = [pick(where, rows) + step for step in np.eye(2)]
        reach = [camera_rays(self._camera, self._scene.resolution, at).reach for at in beside]
        return rows[np.isinf(np.minimum(*reach))]

    def _alike(self, surface: Surface, rows: Ints, where: Floats) -> Bools:
        """Return whether the view at places (k, 2) meets what the points `rows` (k,) are on."""
        rays = camera_rays(self._camera, self._scene.resolution, where)
        met, hits = rays.met(self._caster)
        other = self._geometry.surface(hits, pick(rays.directions, met))
        same = rows.take(met)
        found = np.zeros(len(rows), dtype=bool)
        found[met] = (
            (other.material == surface.material.take(same))
            & (other.instance == surface.instance.take(same))
            & (dot(other.normal, pick(surface.normal, same)) > ALIKE)
        )
        return found
