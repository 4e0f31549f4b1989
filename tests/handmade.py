# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes built by hand, without Blender, for tests of the engine."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from blender_rad.lights import Light
from blender_rad.lights.area import AreaLight
from blender_rad.scene import Camera, Instance, Material, Mesh, Scene, World

Floats = NDArray[np.float64]
GREY = Material("grey", albedo=(0.8, 0.8, 0.8))


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: float = 1.0) -> Floats:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def mesh(vertices: Any, triangles: Any, normals: Any = None, name: str = "mesh") -> Mesh:
    triangles = np.asarray(triangles, dtype=np.int32)
    count = len(triangles)
    return Mesh(
        name=name,
        vertices=np.asarray(vertices, dtype=np.float32),
        triangles=triangles,
        normals=None if normals is None else np.asarray(normals, dtype=np.float32),
        smooth=np.full(count, normals is not None),
        slots=np.zeros(count, dtype=np.int32),
    )


def square(half: float = 5.0) -> Mesh:
    """A square in the plane z = 0, facing up."""
    corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], name="square")


def ball(rings: int = 32, segments: int = 64, smooth: bool = True) -> Mesh:
    """A unit sphere of triangles."""
    theta = np.linspace(0.0, np.pi, rings + 1)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)[None, :]
    axes = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    points = np.stack(np.broadcast_arrays(*axes), axis=-1).reshape(-1, 3)
    row, column = np.divmod(np.arange(rings * segments), segments)
    a = row * segments + column
    b = row * segments + (column + 1) % segments
    faces = np.concatenate(
        [np.stack([a, a + segments, b + segments], 1), np.stack([a, b + segments, b], 1)]
    )
    corners = points[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces = faces[np.linalg.norm(area, axis=1) > 1e-12]
    return mesh(points, faces, points[faces] if smooth else None, name="ball")


def camera_above(height: float = 10.0, half_width: float = 2.0) -> Camera:
    """An orthographic camera that looks down on a square 2·half_width wide."""
    return Camera(
        "camera",
        "orthographic",
        moved(z=height),
        (-half_width, half_width, -half_width, half_width),
        (0.1, 100.0),
    )


def panel(rgb: Any, at: Any, width: float, depth: float, **others: Any) -> AreaLight:
    """A rectangle that shines down."""
    axes = {"axis_u": np.array([width, 0.0, 0.0]), "axis_v": np.array([0.0, -depth, 0.0])}
    down, rgb = np.array([0.0, 0.0, -1.0]), np.broadcast_to(rgb, 3).astype(float)
    return AreaLight(name="area", rgb=rgb, center=np.array(at), direction=down, **axes, **others)


def scene(
    meshes: list[Mesh],
    instances: list[Instance],
    lights: list[Light],
    camera: Camera | None = None,
    materials: list[Material] | None = None,
    *,
    resolution: tuple[int, int] = (16, 16),
    **others: Any,
) -> Scene:
    return Scene(
        file="handmade.blend",
        sha256="",
        frame=1,
        meshes=tuple(meshes),
        instances=tuple(instances),
        materials=tuple(materials or [GREY]),
        lights=tuple(lights),
        world=others.pop("world", World()),
        camera=camera or camera_above(),
        resolution=resolution,
        **others,
    )
