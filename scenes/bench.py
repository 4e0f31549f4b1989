# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the benchmark: ``python scenes/bench.py OUT.blend``. 640×480, 300 000 triangles, 4 lights.

A terrain of 300 × 300 quads and twelve tori of 100 × 50 quads, 2 · (90 000 + 12 · 5 000) triangles,
under an area light, a spot, a sun and a spherical point light.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import bpy
import kit
import numpy as np
from mathutils import Matrix

TERRAIN, TORI, AROUND, ACROSS = 300, 12, 100, 50
SIZE = 12.0


def quads(rows: int, columns: int, *, closed: bool) -> np.ndarray:
    """Return the (n, 4) corners of a grid of `rows` × `columns` quads, as indices."""
    across = columns if closed else columns + 1
    i, j = (index.ravel() for index in np.mgrid[:rows, :columns])
    k, l = i + 1, j + 1
    if closed:
        k, l = k % rows, l % columns
    return np.stack([i * across + j, k * across + j, k * across + l, i * across + l], axis=1)


def from_arrays(name: str, vertices: np.ndarray, faces: np.ndarray, material: Any) -> Any:
    """Return a smooth mesh of (n, 3) vertices and (m, 4) faces."""
    made = bpy.data.meshes.new(name)
    made.vertices.add(len(vertices))
    made.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    made.loops.add(faces.size)
    made.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    made.polygons.add(len(faces))
    made.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    made.polygons.foreach_set("use_smooth", np.ones(len(faces), dtype=bool))
    made.update(calc_edges=True)
    made.materials.append(material)
    return made


def terrain() -> None:
    """Put the ground."""
    y, x = np.meshgrid(*[np.linspace(-SIZE / 2, SIZE / 2, TERRAIN + 1)] * 2, indexing="ij")
    z = 0.25 * np.sin(1.7 * x) * np.cos(1.3 * y) + 0.05 * np.sin(7 * x + 3 * y)
    faces = quads(TERRAIN, TERRAIN, closed=False)[:, ::-1]
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    kit.put("Terrain", from_arrays("Terrain", points, faces, kit.matte("Sand", (0.7, 0.62, 0.5))))


def tori() -> None:
    """Put a ring of tori, each with a mesh of its own."""
    u, v = np.mgrid[:AROUND, :ACROSS]
    u, v = u * 2 * np.pi / AROUND, v * 2 * np.pi / ACROSS
    width = 0.5 + 0.18 * np.cos(v)
    points = np.stack([width * np.cos(u), width * np.sin(u), 0.18 * np.sin(v)], axis=-1)
    faces = quads(AROUND, ACROSS, closed=True)
    for n in range(TORI):
        turn = n * 2 * math.pi / TORI
        hue = tuple(0.45 + 0.35 * math.cos(turn + shift) for shift in (0.0, 2.1, 4.2))
        data = from_arrays(
            f"Torus {n + 1}", points.reshape(-1, 3), faces, kit.matte(f"Hue {n + 1}", hue)
        )
        at = Matrix.Translation((3 * math.cos(turn), 3 * math.sin(turn), 0.9))
        kit.put(
            f"Torus {n + 1}",
            data,
            at @ Matrix.Rotation(turn, 4, 'Z') @ Matrix.Rotation(1.1, 4, 'Y'),
        )


def build() -> None:
    """Build the scene."""
    scene = kit.empty()
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    scene.render.resolution_percentage = 100
    terrain()
    tori()
    kit.light("Area", 'AREA', kit.aim((-3, -3, 5), (0, 0, 0)), 300, size=1.5)
    kit.light(
        "Spot",
        'SPOT',
        kit.aim((4, -3, 4), (0, 0, 0.5)),
        500,
        color=(0.4, 0.6, 1.0),
        spot_size=math.radians(60),
        spot_blend=0.3,
        shadow_soft_size=0.1,
    )
    kit.light("Sun", 'SUN', kit.aim((2, 3, 4), (0, 0, 0)), 0.5, angle=math.radians(2))
    kit.light(
        "Sphere",
        'POINT',
        Matrix.Translation((0, 0, 1.8)),
        120,
        color=(1.0, 0.7, 0.45),
        shadow_soft_size=0.25,
        use_soft_falloff=False,
    )
    kit.camera((0, -7.5, 4.6), (0, 0, 0.4), 32)


if __name__ == "__main__":
    build()
    kit.save(Path(sys.argv[1]))
