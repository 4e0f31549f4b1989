# SPDX-License-Identifier: GPL-3.0-or-later
"""A photographer's table: key, gelled spot, sun and a soft point light over subdivided shapes.

At a mark on the floor that nothing shades, the four lights add up:

- key, a rectangle of area A and power P: L = P/(πA), E = (L/2) Σ θᵢ (n·gᵢ) over its edges;
- spot with soft falloff, the mark being inside the cone by more than its blend and its radius:
  E = P cosθ / (4π(d² + r²)), the irradiance of a disc of radius r that faces the mark,
  πL sin²α cosθ with L = P/(4π²r²) and sin²α = r²/(d² + r²);
- soft point light: the same formula;
- sun, its whole disc above the horizon: E₀ cosθ, whatever its angle.

The shapes are subdivided once or not at all in the viewport and two to three times in renders.
"""

from __future__ import annotations

import math

import bpy
import kit
import numpy as np
from mathutils import Euler, Matrix

MARK = (0.9, -1.35, 0.0)
WARM, BLUE, ROSE, DAY = (1.0, 0.82, 0.6), (0.2, 0.42, 1.0), (1.0, 0.3, 0.42), (1.0, 0.97, 0.92)
VASE = [(0, 0), (0.2, 0), (0.32, 0.18), (0.36, 0.42), (0.24, 0.72), (0.12, 0.88), (0.2, 1.02)]
BOWL = [(0, 0.02), (0.14, 0.02), (0.3, 0.1), (0.42, 0.27), (0.4, 0.27), (0.27, 0.13), (0, 0.06)]
CORNER = 1.2


def cyclorama() -> None:
    """Put a floor that bends up into a wall."""
    arc = np.linspace(0, math.pi / 2, 17)
    profile = [(-6.0, 0.0), (1.2, 0.0)]  # the second keeps the floor's shading normals upright
    profile += [(1.4 + CORNER * math.sin(a), CORNER * (1 - math.cos(a))) for a in arc]
    profile += [(1.4 + CORNER, 6.0)]
    vertices = [(x, y, z) for y, z in profile for x in (-7.0, 7.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    kit.mesh("Cyclorama", vertices, faces, kit.matte("Seamless", (0.72, 0.7, 0.67)), smooth=True)


def shapes() -> None:
    """Put what is photographed."""
    bpy.ops.mesh.primitive_monkey_add(size=1.1)
    monkey = bpy.context.object
    monkey.name = monkey.data.name = "Suzanne"
    monkey.matrix_world = (
        Matrix.Translation((0.05, 0.15, 0.98)) @ Euler((-0.15, 0, 0.3)).to_matrix().to_4x4()
    )
    monkey.data.materials.append(kit.matte("Terracotta", (0.72, 0.33, 0.2)))
    monkey.data.polygons.foreach_set("use_smooth", [True] * len(monkey.data.polygons))
    kit.subdivide(monkey, 1, 2)
    kit.boxes("Plinth", [(-0.5, -0.4, 0, 0.6, 0.7, 0.5)], kit.matte("Plaster", (0.82, 0.81, 0.79)))
    vase = kit.lathe(
        "Vase",
        VASE,
        kit.matte("Celadon", (0.4, 0.62, 0.52)),
        Matrix.Translation((-1.35, 0.1, 0)),
        segments=10,
    )
    bowl = kit.lathe(
        "Bowl",
        BOWL,
        kit.matte("Ivory", (0.83, 0.78, 0.66)),
        Matrix.Translation((1.45, -0.2, 0)),
        segments=10,
    )
    kit.subdivide(vase, 0, 3)
    kit.subdivide(bowl, 0, 3)


def build() -> list[kit.Answer]:
    """Build the scene; return what is known of it on paper."""
    kit.empty()
    cyclorama()
    shapes()
    key = kit.light(
        "Key",
        'AREA',
        kit.aim((-2.6, -2.4, 3.4), (0, 0, 0.6)),
        160,
        color=WARM,
        shape='RECTANGLE',
        size=1.6,
        size_y=1.0,
    )
    where = (2.8, 0.2, 2.8)
    kit.light(
        "Spot",
        'SPOT',
        kit.aim(where, (0.2, -0.3, 0.6)),
        430,
        color=BLUE,
        spot_size=math.radians(75),
        spot_blend=0.25,
        shadow_soft_size=0.08,
    )
    fill = (2.6, -2.6, 1.5)
    kit.light("Fill", 'POINT', Matrix.Translation(fill), 26, color=ROSE, shadow_soft_size=0.3)
    sun = kit.light(
        "Sun", 'SUN', kit.aim((1.5, -2.0, 4.0), (0, 0, 0)), 0.35, color=DAY, angle=math.radians(3)
    )
    kit.camera((0.15, -5.6, 1.9), (0.05, 0, 0.72), 50)
    down = sun.matrix_world.to_3x3().col[2].normalized().z
    panel = 160 / (math.pi * 1.6 * 1.0) * kit.polygon(kit.area_corners(key), MARK)
    floor = kit.total(
        [
            (panel, WARM),
            (430 * kit.point(where, MARK, radius=0.08), BLUE),
            (26 * kit.point(fill, MARK, radius=0.3), ROSE),
            (0.35 * down, DAY),
        ]
    )
    return [kit.Answer("mark on the floor", MARK, kit.UP, floor)]
