# SPDX-License-Identifier: GPL-3.0-or-later
"""The lecture's point light: E = Φ cosθ / (4π r²), on a plane and on a tilted receiver.

Φ = 16π W, 2 m above the plane z = 0, so that Φ/4π = 4 W/sr and

- straight below, r = 2, θ = 0: E = 4/4 = 1 W/m²;
- 2 m aside, r² = 8, cosθ = 1/√2: E = 4/(8√2) = 1/(2√2) = 0.353553 W/m²;
- 2√3 m aside, r = 4, cosθ = 1/2: E = 4/(16·2) = 1/8 W/m²;
- on a receiver as high as the light, 2 m away, turned 60° away from it: E = 4/4 · 1/2 = 1/2 W/m².
"""

from __future__ import annotations

import math

import kit
from mathutils import Matrix

SQRT3 = math.sqrt(3.0)


def build() -> list[kit.Answer]:
    """Build the scene; return what is known of it on paper."""
    kit.empty()
    kit.quad("Plane", 40, 40, kit.matte("Paper", (0.8, 0.78, 0.74)))
    turned = Matrix.Translation((-2, 0, 2)) @ Matrix.Rotation(math.radians(30), 4, 'Y')
    kit.quad("Receiver", 1, 1, kit.matte("Card", (0.75, 0.25, 0.15)), turned)
    kit.boxes("Stand", [(-2.03, -0.03, 0, -1.97, 0.03, 1.99)], kit.matte("Wood", (0.3, 0.2, 0.12)))
    ball = [
        (0.5 * math.sin(a / 16 * math.pi), -0.5 * math.cos(a / 16 * math.pi)) for a in range(17)
    ]
    kit.lathe(
        "Ball", ball, kit.matte("Blue", (0.15, 0.3, 0.7)), Matrix.Translation((1.05, 2.2, 0.5))
    )
    kit.boxes(
        "Cube",
        [(-0.4, -0.4, 0, 0.4, 0.4, 0.8)],
        kit.matte("Ochre", (0.8, 0.55, 0.15)),
        Matrix.Translation((2.4, 0.9, 0)) @ Matrix.Rotation(0.5, 4, 'Z'),
    )
    kit.lathe(
        "Cone",
        [(0.5, 0), (0, 1.1)],
        kit.matte("Green", (0.25, 0.5, 0.25)),
        Matrix.Translation((-1.1, 1.7, 0)),
    )
    kit.light("Point", 'POINT', Matrix.Translation((0, 0, 2)), 16 * math.pi, shadow_soft_size=0)
    kit.camera((1.6, -7.0, 4.4), (0.05, 0.75, 0.55), 45)
    normal = (0.5, 0.0, SQRT3 / 2)
    return [
        kit.Answer("below the light", (0, 0, 0), kit.UP, (1.0,) * 3),
        kit.Answer("2 m aside", (2, 0, 0), kit.UP, (1 / (2 * math.sqrt(2)),) * 3),
        kit.Answer("2√3 m aside", (0, 2 * SQRT3, 0), kit.UP, (1 / 8,) * 3),
        kit.Answer("tilted by 60°", (-2, 0, 2), normal, (1 / 2,) * 3),
    ]
