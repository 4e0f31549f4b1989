# SPDX-License-Identifier: GPL-3.0-or-later
"""Sixty lights of all kinds about a box, of which our engine chooses a few at each point."""

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from blender_rad.crowds import gathered
from blender_rad.direct import DirectLight

from .agreement import FINE, PICTURE, agrees, both_sides, cases, glow, lamp, square, stage
from .reading import material

KINDS = {
    'POINT': {"shadow_soft_size": 0.05},
    'SPOT': {"shadow_soft_size": 0.0, "spot_size": 1.4},
    'AREA': {"size": 0.3},
}


def lamps(count: int = 60) -> None:
    """One of which almost touches the box, and a panel of two triangles that glow."""
    stage()
    rng = np.random.default_rng(5)
    for k, kind in enumerate(list(KINDS) * (count // len(KINDS))):
        x, y, z = rng.uniform((-2.5, -2.5, 1.3), (2.5, 2.5, 3.0))
        shown = {"energy": rng.uniform(2, 20), "color": rng.uniform(0.3, 1, 3), **KINDS[kind]}
        lamp(kind, (x, y, z) if k else (0.4, 0.2, 1.2), (x, y - 0.5, 0), **shown)
    square(
        "Panel", glow(2.0), location=(-1, 0.8, 0.8), rotation_euler=(1.8, 0.3, 0), scale=(0.3,) * 3
    )


def on_gloss() -> None:
    lamps()
    for name in ("Floor", "Box"):
        paint = material(name, "BsdfPrincipled", Roughness=0.35, Base_Color=(0.5, 0.3, 0.2, 1))
        bpy.data.objects[name].data.materials[0] = paint


CASES: dict[str, Callable[[], None]] = {"60-lights": lamps, "60-lights-on-gloss": on_gloss}


@pytest.mark.feature(PICTURE, area="Many lights")
@pytest.mark.parametrize("name", cases(CASES, ["60-lights"]))
def test_many_lights_are_those_of_cycles(name: str) -> None:
    CASES[name]()
    sides = both_sides(per_light=False, **({} if name == "60-lights" else {**FINE, "samples": 256}))
    made = sides.scene
    assert made.camera is not None
    assert not gathered(DirectLight(made), made, made.camera, per_light=False).emitters
    agrees(sides)
