# SPDX-License-Identifier: GPL-3.0-or-later
"""A hundred instances of one collection, laid out like the seeds of a sunflower.

Instance n stands at the golden angle times n from its neighbour, at a distance of 0.42 √(n + 5) m,
so that a disc of 0.8 m in the middle stays free. On its centre, with nothing in the way:

- the square panel overhead, height h, side 2a: L = P/(πA) and, from Lambert's polygon,
  E = L · 4 · a/√(a² + h²) · atan(a/√(a² + h²));
- two spots with soft falloff, aimed at the centre: P cosθ / (4π(d² + r²)) each.
"""

from __future__ import annotations

import math

import bpy
import kit
from mathutils import Matrix

COUNT, SPREAD, FREE = 100, 0.42, 5
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
HEIGHT, HALF, PANEL_POWER = 5.0, 0.6, 420.0
SPOTS = {
    "Amber": ((5.5, -3.0, 5.0), 900.0, (1.0, 0.55, 0.22)),
    "Azure": ((-5.5, -1.5, 5.0), 900.0, (0.25, 0.5, 1.0)),
}
STEM = [(0.16, 0), (0.15, 0.03), (0.06, 0.1), (0.045, 0.3), (0.08, 0.38), (0.045, 0.4)]
HEAD = [
    (0.11 * math.sin(i / 10 * math.pi), 0.5 - 0.11 * math.cos(i / 10 * math.pi)) for i in range(11)
]


def pawn() -> bpy.types.Collection:
    """Return a collection that only its instances show."""
    piece = bpy.data.collections.new("Pawn")
    kit.lathe("Body", STEM, kit.matte("Bone", (0.78, 0.74, 0.66)), segments=20, into=piece)
    kit.lathe("Head", HEAD, kit.matte("Coral", (0.75, 0.36, 0.28)), segments=20, into=piece)
    return piece


def build() -> list[kit.Answer]:
    """Build the scene; return what is known of it on paper."""
    kit.empty()
    kit.quad("Ground", 40, 40, kit.matte("Slate", (0.5, 0.5, 0.52)))
    piece = pawn()
    for n in range(COUNT):
        far, turn = SPREAD * math.sqrt(n + FREE), n * GOLDEN_ANGLE
        at = Matrix.Translation((far * math.cos(turn), far * math.sin(turn), 0))
        matrix = at @ Matrix.Rotation(turn, 4, 'Z') @ Matrix.Diagonal((1, 1, 0.85 + 0.1 * far, 1))
        made = kit.put(f"Pawn {n + 1:03}", None, matrix)
        made.instance_type, made.instance_collection = 'COLLECTION', piece
        made.empty_display_size = 0.1
    kit.light("Panel", 'AREA', Matrix.Translation((0, 0, HEIGHT)), PANEL_POWER, size=2 * HALF)
    root = math.hypot(HALF, HEIGHT)
    overhead = PANEL_POWER / (math.pi * 4 * HALF**2) * 4 * HALF / root * math.atan(HALF / root)
    terms = [(overhead, kit.WHITE)]
    for name, (place, power, colour) in SPOTS.items():
        kit.light(
            name,
            'SPOT',
            kit.aim(place, (0, 0, 0)),
            power,
            color=colour,
            spot_size=math.radians(70),
            spot_blend=0.3,
            shadow_soft_size=0.12,
        )
        terms.append((power * kit.point(place, (0, 0, 0), radius=0.12), colour))
    kit.camera((0.0, -9.0, 5.6), (0, -0.2, 0.1), 42)
    return [kit.Answer("centre", (0, 0, 0), kit.UP, kit.total(terms))]
