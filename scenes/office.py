# SPDX-License-Identifier: GPL-3.0-or-later
"""An office: ceiling panels, downlights in frames, a window to a uniform sky, a globe on a stand.

On the desks, where nothing is in the way, everything that shines is a polygon or a sphere:

- panel (area light, one-sided, area A, power P): L = P/(πA), E = (L/2) Σ θᵢ (n·gᵢ);
- downlight (emitting square): the same with its own radiance;
- the sky through the window, whose sill is above the desk: the same with the sky's radiance and
  the opening's corners;
- globe (point light with a radius, soft falloff off, hence a sphere): E = Φ cosθ / (4π d²).
"""

from __future__ import annotations

import math

import bpy
import kit
from mathutils import Matrix

WIDTH, DEPTH, HEIGHT = 6.0, 4.4, 2.8
TOP = 0.74  # of the desks
NEUTRAL, WARM, SKY = (1.0, 0.96, 0.9), (1.0, 0.8, 0.55), (0.62, 0.8, 1.0)
SKY_RADIANCE, DOWNLIGHT_RADIANCE, PANEL_POWER, GLOBE_POWER = 1.5, 30.0, 16.0, 60.0
WINDOW = (0.9, 2.3, 0.7, 3.7)  # z0, z1, y0, y1 in the wall x = 0
PANELS = [(x, y) for x in (1.5, 3.0, 4.5) for y in (1.3, 3.1)]
DOWNLIGHTS = [(0.5, 1.2), (0.5, 2.2), (0.5, 3.2)]
PANEL_HALF = (0.6, 0.15)
GLOBE = (0.55, 4.0, 1.55)
DESKS = [(1.7, 3.35), (3.6, 3.35)]
METERS = [(1.6, 3.15, TOP), (4.2, 3.15, TOP)]  # where no monitor hides window or globe


def room() -> None:
    """Put floor, ceiling and three walls, one with a window; the camera's side stays open."""
    white, grey = kit.matte("Wall", (0.8, 0.79, 0.76)), kit.matte("Floor", (0.42, 0.33, 0.25))
    z0, z1, y0, y1 = WINDOW
    x, y, z = WIDTH, DEPTH, HEIGHT
    kit.mesh("Floor", [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)], [(0, 1, 2, 3)], grey)
    kit.mesh("Ceiling", [(0, 0, z), (0, y, z), (x, y, z), (x, 0, z)], [(0, 1, 2, 3)], white)
    walls = [(0, y, 0), (x, y, 0), (x, y, z), (0, y, z), (x, 0, 0), (x, 0, z), (0, 0, 0), (0, 0, z)]
    kit.mesh("Walls", walls, [(0, 1, 2, 3), (1, 4, 5, 2), (4, 6, 7, 5)], white)
    outer = [(0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)]
    inner = [(0, y0, z0), (0, y1, z0), (0, y1, z1), (0, y0, z1)]
    ring = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]
    kit.mesh("Window wall", outer + inner, ring, kit.matte("Accent", (0.3, 0.45, 0.48)))
    frame = [
        (0, y0 - 0.06, z0 - 0.09, 0.05, y1 + 0.06, z0 - 0.03),
        (0, y0 - 0.06, z1, 0.05, y1 + 0.06, z1 + 0.06),
    ]
    kit.boxes("Window frame", frame, kit.matte("Frame", (0.75, 0.75, 0.75)))


def furniture() -> None:
    """Put desks, chairs, a shelf with books, a rug."""
    oak, dark = kit.matte("Oak", (0.62, 0.44, 0.26)), kit.matte("Steel", (0.12, 0.12, 0.13))
    screen, seat = kit.matte("Screen", (0.03, 0.03, 0.035)), kit.matte("Seat", (0.7, 0.26, 0.12))
    desk = [(-0.8, -0.4, TOP - 0.03, 0.8, 0.4, TOP)]
    legs = [
        (x - 0.02, y - 0.02, 0, x + 0.02, y + 0.02, TOP - 0.03)
        for x in (-0.74, 0.74)
        for y in (-0.34, 0.34)
    ]
    monitor = [
        (-0.3, 0.2, TOP + 0.12, 0.3, 0.23, TOP + 0.48),
        (-0.03, 0.22, TOP, 0.03, 0.25, TOP + 0.2),
        (-0.12, 0.14, TOP, 0.12, 0.3, TOP + 0.015),
    ]
    chair = [(-0.23, -0.23, 0.42, 0.23, 0.23, 0.48), (-0.22, -0.25, 0.52, 0.22, -0.2, 0.95)]
    feet = [
        (x - 0.02, y - 0.02, 0, x + 0.02, y + 0.02, 0.42) for x in (-0.2, 0.2) for y in (-0.2, 0.2)
    ]
    for number, (x, y) in enumerate(DESKS, 1):
        at = Matrix.Translation((x, y, 0))
        kit.boxes(f"Desk {number}", desk, oak, at)
        kit.boxes(f"Legs {number}", legs, dark, at)
        kit.boxes(f"Monitor {number}", monitor, screen, at)
        turned = Matrix.Translation((x + 0.1, y - 0.75, 0)) @ Matrix.Rotation(
            0.5 - number * 0.4, 4, 'Z'
        )
        kit.boxes(f"Chair {number}", chair, seat, turned)
        kit.boxes(f"Chair feet {number}", feet, dark, turned)
    shelf = [(4.85, 4.05, z, 5.9, 4.38, z + 0.03) for z in (0.05, 0.5, 0.95, 1.4, 1.85)]
    shelf += [(x, 4.05, 0, x + 0.03, 4.38, 1.88) for x in (4.82, 5.9)]
    kit.boxes("Shelf", shelf, oak)
    colours = [(0.6, 0.15, 0.1), (0.1, 0.25, 0.45), (0.75, 0.6, 0.2), (0.2, 0.4, 0.25)]
    for tone, colour in enumerate(colours):
        books = [
            (
                4.9 + 0.065 * i,
                4.12,
                z,
                4.95 + 0.065 * i,
                4.36,
                z + 0.22 + 0.03 * ((i * 7 + tone) % 5),
            )
            for row, z in enumerate((0.08, 0.53, 0.98, 1.43))
            for i in range(14 - 2 * row)
            if (i * 3 + row) % 4 == tone
        ]
        kit.boxes(f"Books {tone + 1}", books, kit.matte(f"Book {tone + 1}", colour))
    kit.boxes("Rug", [(1.0, 0.9, 0, 4.3, 2.2, 0.012)], kit.matte("Rug", (0.5, 0.16, 0.14)))
    kit.boxes("Stand", [(0.53, 3.98, 0, 0.57, 4.02, 1.3), (0.4, 3.85, 0, 0.7, 4.15, 0.03)], dark)


def rectangle(centre: tuple[float, float], half: tuple[float, float], z: float) -> list[kit.Point]:
    """Return the corners of a level rectangle that faces down."""
    (x, y), (a, b) = centre, half
    return [(x - a, y - b, z), (x - a, y + b, z), (x + a, y + b, z), (x + a, y - b, z)]


def fitting(name: str, places: list[tuple[float, float]]) -> bpy.types.Collection:
    """Return a collection that hangs from the ceiling, z = 0, at each of `places`."""
    made = bpy.data.collections.new(name)
    for number, (x, y) in enumerate(places, 1):
        hung = kit.put(f"{name} {number}", None, Matrix.Translation((x, y, HEIGHT)))
        hung.instance_type, hung.instance_collection = 'COLLECTION', made
        hung.empty_display_size = 0.1
    return made


def luminaires() -> list[tuple[kit.Point, list[kit.Point]]]:
    """Put the lights; return the polygons among them with their radiance per channel."""
    metal = kit.matte("Metal", (0.6, 0.6, 0.6))
    panel = fitting("Panel light", PANELS)
    kit.light(
        "Panel",
        'AREA',
        Matrix.Translation((0, 0, -0.05)),
        PANEL_POWER,
        into=panel,
        color=NEUTRAL,
        shape='RECTANGLE',
        size=2 * PANEL_HALF[0],
        size_y=2 * PANEL_HALF[1],
    )
    kit.boxes("Housing", [(-0.64, -0.19, -0.04, 0.64, 0.19, 0)], metal, into=panel)
    radiance = PANEL_POWER / (math.pi * 4 * PANEL_HALF[0] * PANEL_HALF[1])
    shining = [
        (tuple(radiance * c for c in NEUTRAL), rectangle(place, PANEL_HALF, HEIGHT - 0.05))
        for place in PANELS
    ]
    down, half, drop = fitting("Downlight fitting", DOWNLIGHTS), (0.18, 0.18), 0.02
    warm = kit.glow("Downlight", WARM, DOWNLIGHT_RADIANCE)
    kit.mesh("Downlight", rectangle((0, 0), half, -drop), [(0, 1, 2, 3)], warm, into=down)
    a, b = 0.19, 0.21
    sides = [(-b, -b, b, -a), (-b, a, b, b), (-b, -a, -a, a), (a, -a, b, a)]
    frame = [(x0, y0, -drop, x1, y1, 0) for x0, y0, x1, y1 in sides]
    kit.boxes("Frame", frame, metal, into=down)
    shining += [
        (tuple(DOWNLIGHT_RADIANCE * c for c in WARM), rectangle(place, half, HEIGHT - drop))
        for place in DOWNLIGHTS
    ]
    kit.light(
        "Globe",
        'POINT',
        Matrix.Translation(GLOBE),
        GLOBE_POWER,
        color=WARM,
        shadow_soft_size=0.16,
        use_soft_falloff=False,
    )
    return shining


def build() -> list[kit.Answer]:
    """Build the scene; return what is known of it on paper."""
    kit.empty(SKY, SKY_RADIANCE)
    room()
    furniture()
    shining = luminaires()
    z0, z1, y0, y1 = WINDOW
    towards_room = Matrix.Translation((-0.01, 0.5 * (y0 + y1), 0.5 * (z0 + z1))) @ Matrix.Rotation(
        -math.pi / 2, 4, 'Y'
    )
    portal = {"shape": 'RECTANGLE', "size": z1 - z0, "size_y": y1 - y0}
    kit.light("Window portal", 'AREA', towards_room, 1.0, **portal).data.cycles.is_portal = True
    window = [(0, y0, z0), (0, y1, z0), (0, y1, z1), (0, y0, z1)]
    shining.append((tuple(SKY_RADIANCE * c for c in SKY), window))
    kit.camera((5.75, 0.25, 1.75), (1.7, 3.3, 1.15), 19)
    answers: list[kit.Answer] = []
    for number, place in enumerate(METERS, 1):
        kit.put(f"Meter desk {number}", None, Matrix.Translation(place))
        terms = [(kit.polygon(corners, place), radiance) for radiance, corners in shining]
        terms.append((GLOBE_POWER * kit.point(GLOBE, place), WARM))
        answers.append(kit.Answer(f"desk {number}", place, kit.UP, kit.total(terms)))
    return answers
