# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene scripts share: plain objects and lights in Blender, closed forms for the answers.

The closed forms here are written apart from the library's, so that they can witness it.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

Point = tuple[float, float, float]
UP: Point = (0.0, 0.0, 1.0)
WHITE: Point = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Answer:
    """Irradiance [W/m²] on a surface at `position` [m] that faces `normal`, per channel."""

    name: str
    position: Point
    normal: Point
    irradiance: tuple[float, float, float]


# --- closed forms: irradiance over radiance or power ---------------------------------------------


def point(position: Point, receiver: Point, normal: Point = UP, radius: float = 0.0) -> float:
    """Return E/Φ = cosθ / (4π(d² + r²)) of a point light; r counts with soft falloff only."""
    away = np.subtract(position, receiver)
    square = float(away @ away)
    cosine = max(float(away @ np.array(normal)) / math.sqrt(square), 0.0)
    return cosine / (4 * math.pi * (square + radius**2))


def polygon(corners: Sequence[Sequence[float]], receiver: Point, normal: Point = UP) -> float:
    """Return E/L = ½ Σ θᵢ (n·gᵢ) of a polygon above the horizon, after Lambert."""
    to = np.asarray(corners, dtype=float) - receiver
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    following = np.roll(to, -1, axis=0)
    angle = np.arccos(np.clip(np.sum(to * following, axis=1), -1.0, 1.0))
    edge = np.cross(to, following)
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    return abs(float(angle @ (edge @ np.array(normal)))) / 2


def area_corners(bl_object: Any) -> list[Point]:
    """Return the corners of a rectangular area light in the world."""
    x = bl_object.data.size / 2
    y = bl_object.data.size_y / 2 if bl_object.data.shape == 'RECTANGLE' else x
    corners = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]
    return [tuple(bl_object.matrix_world @ Vector(corner)) for corner in corners]


def total(terms: Iterable[tuple[float, Point]]) -> tuple[float, float, float]:
    """Return Σ factor · colour, per channel."""
    r, g, b = sum(factor * np.array(colour) for factor, colour in terms)
    return (float(r), float(g), float(b))


# --- Blender -------------------------------------------------------------------------------------


def empty(world: Point = (0.0, 0.0, 0.0), strength: float = 1.0) -> Any:
    """Start a scene with nothing but a uniform world; return it."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    _with_nodes(scene.world)
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*world, 1)
    background.inputs["Strength"].default_value = strength
    scene.render.engine = 'CYCLES'
    scene.cycles.samples = 64
    scene.render.resolution_x, scene.render.resolution_y = 960, 640
    scene.render.resolution_percentage = 40  # a check in a minute or two
    return scene


def matte(name: str, colour: Point) -> Any:
    """Return a Lambert material: Diffuse BSDF, roughness 0."""
    return _material(name, 'ShaderNodeBsdfDiffuse', colour)


def glow(name: str, colour: Point, radiance: float) -> Any:
    """Return a material that only emits, [W/(m² sr)]."""
    made = _material(name, 'ShaderNodeEmission', colour)
    made.node_tree.nodes['Emission'].inputs["Strength"].default_value = radiance
    return made


def _with_nodes(block: Any) -> None:
    """Give a world or material its node tree, which it has from birth in Blender 5."""
    if block.node_tree is None:
        block.use_nodes = True


def _material(name: str, closure: str, colour: Point) -> Any:
    made = bpy.data.materials.new(name)
    _with_nodes(made)
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(closure)
    shader.inputs["Color"].default_value = (*colour, 1)
    output = tree.nodes.new('ShaderNodeOutputMaterial')
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    made.diffuse_color = (*colour, 1)
    return made


def put(name: str, data: Any, matrix: Matrix | None = None, into: Any = None) -> Any:
    """Put an object with `data` into a collection, the scene's by default."""
    made = bpy.data.objects.new(name, data)
    made.matrix_world = matrix or Matrix()
    (into or bpy.context.scene.collection).objects.link(made)
    bpy.context.view_layer.update()
    return made


def mesh(
    name: str,
    vertices: Any,
    faces: Any,
    material: Any,
    matrix: Matrix | None = None,
    *,
    smooth: bool = False,
    into: Any = None,
) -> Any:
    """Put a mesh from vertices and faces."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(np.asarray(vertices).tolist(), [], [list(map(int, face)) for face in faces])
    data.materials.append(material)
    data.polygons.foreach_set("use_smooth", [smooth] * len(data.polygons))
    return put(name, data, matrix, into)


def quad(name: str, width: float, depth: float, material: Any, matrix: Matrix | None = None) -> Any:
    """Put a rectangle that faces its local +Z."""
    x, y = width / 2, depth / 2
    corners = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]
    return mesh(name, corners, [(0, 1, 2, 3)], material, matrix)


BOX = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def boxes(
    name: str,
    extents: Iterable[Sequence[float]],
    material: Any,
    matrix: Any = None,
    *,
    into: Any = None,
) -> Any:
    """Put one object of boxes, each (x0, y0, z0, x1, y1, z1)."""
    vertices: list[Point] = []
    faces: list[list[int]] = []
    for x0, y0, z0, x1, y1, z1 in extents:
        first = len(vertices)
        ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        vertices += [(x, y, z0) for x, y in ring] + [(x, y, z1) for x, y in ring]
        faces += [[first + corner for corner in face] for face in BOX]
    return mesh(name, vertices, faces, material, matrix, into=into)


def lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    material: Any,
    matrix: Matrix | None = None,
    *,
    segments: int = 32,
    into: Any = None,
) -> Any:
    """Put a solid of revolution about Z from (radius, height) pairs, smooth, open at both ends."""
    turn = np.arange(segments) * 2 * np.pi / segments
    rings = [[(r * math.cos(a), r * math.sin(a), z) for a in turn] for r, z in profile]
    faces = [
        (i * segments + j, i * segments + k, (i + 1) * segments + k, (i + 1) * segments + j)
        for i in range(len(profile) - 1)
        for j, k in zip(range(segments), [*range(1, segments), 0], strict=True)
    ]
    return mesh(name, np.concatenate(rings), faces, material, matrix, smooth=True, into=into)


def subdivide(bl_object: Any, viewport: int, render: int) -> Any:
    """Subdivide a mesh, in renders otherwise than in the viewport."""
    modifier = bl_object.modifiers.new("Subdivision", 'SUBSURF')
    modifier.levels, modifier.render_levels = viewport, render
    return bl_object


def aim(position: Point, target: Point) -> Matrix:
    """Return a matrix at `position` whose -Z looks at `target` and whose Y is up."""
    turn = Vector(target) - Vector(position)
    return Matrix.Translation(position) @ turn.to_track_quat('-Z', 'Y').to_matrix().to_4x4()


def light(
    name: str, kind: str, matrix: Matrix, energy: float, *, into: Any = None, **properties: Any
) -> Any:
    """Put a light of radiant flux (sun: irradiance) `energy`."""
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in properties.items():
        setattr(data, key, value)
    return put(name, data, matrix, into)


def camera(position: Point, target: Point, lens: float) -> Any:
    """Put the scene's camera."""
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    bpy.context.scene.camera = put("Camera", data, aim(position, target))
    return bpy.context.scene.camera


def save(path: Path) -> None:
    """Save what was built, compressed; by way of a temporary file, since Blender keeps its path."""
    passing = Path(tempfile.gettempdir()) / path.name
    bpy.ops.wm.save_as_mainfile(filepath=str(passing), compress=True, copy=True)
    shutil.move(passing, path)
