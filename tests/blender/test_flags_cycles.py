# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of lights, worlds and materials that change nothing but noise in Cycles, and those that do.

The stage has a box under lamps of three kinds, a glowing panel and a world.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest

from .agreement import both_sides, lamp
from .reading import SQUARE, add, polygons
from .test_features_cycles import SIZE, agrees, emission, glowing, stage, world

pytestmark = pytest.mark.feature("picture: tiles 1 %, energy 0.2 %", area="Flags")
# What Cycles leaves to EEVEE.
EEVEE = {
    **dict.fromkeys(("diffuse_factor", "specular_factor", "transmission_factor"), 0.1),
    **{"use_custom_distance": True, "cutoff_distance": 0.5, "shadow_buffer_clip_start": 2.0},
    **{"shadow_filter_radius": 5.0, "use_shadow_jitter": True, "shadow_jitter_overblur": 20.0},
}


def lamps() -> list[Any]:
    stage()
    return [
        lamp('POINT', (-2, -2, 3), energy=50, shadow_soft_size=0.2),
        lamp('AREA', (1.5, -1, 2.2), energy=40, size=2.0),
        lamp('SUN', (1, 2, 3), energy=1.0, angle=0.3),
    ]


def on_lamps(of_cycles: bool = False, **properties: Any) -> Callable[[], None]:
    def build() -> None:
        for each in lamps():
            for name, value in properties.items():
                setattr(each.data.cycles if of_cycles else each.data, name, value)

    return build


def on_world(**properties: Any) -> Callable[[], None]:
    def build() -> None:
        lamps()
        world()
        for name, value in properties.items():
            setattr(bpy.context.scene.world.cycles, name, value)

    return build


def grouped() -> None:
    """Lamps, a panel and the world in light groups: the picture has all of them."""
    placed = lamps()
    world()
    placed.append(add("Panel", glowing(polygons("Panel", *SQUARE)), location=(-1, 0.5, 1.5)))
    layer = bpy.context.view_layer
    for k, each in enumerate([*placed, bpy.context.scene.world]):
        layer.lightgroups.add(name=f"Group {k}")
        each.lightgroup = f"Group {k}"


def portal() -> None:
    """A portal that sees the world in part: it guides, and is no light."""
    lamps()
    world()
    guide = lamp('AREA', (0, 0, 2.5), energy=1000, size=1.0)
    guide.data.cycles.is_portal = True


def unlit_by() -> None:
    lamps()[0].visible_diffuse = False


def seen_alone() -> None:
    """A lamp that shows and lights nothing, beside those that do."""
    lamps()
    shown = lamp('POINT', (-1, 0.3, 1.2), shadow_soft_size=0.3)
    shown.visible_camera, shown.visible_diffuse = True, False


def sampled(method: str) -> Callable[[], None]:
    def build() -> None:
        stage()
        made = emission(6.0)
        made.cycles.emission_sampling = method
        mesh = polygons("Panel", *SQUARE)
        mesh.materials[0] = made
        place = {"location": (-0.3, 0.3, 1.9), "rotation_euler": (2.6, 0.2, 0.3)}
        add("Panel", mesh, **place, scale=(0.8, 0.6, 1))

    return build


CASES = {
    "settings-of-eevee": on_lamps(**EEVEE),
    "light-without-mis": on_lamps(True, use_multiple_importance_sampling=False),
    "light-max-bounces-0": on_lamps(True, max_bounces=0),
    "light-groups": grouped,
    "light-no-diffuse-rays": unlit_by,
    "light-that-the-camera-alone-sees": seen_alone,
    "portal": portal,
    "world-sampling-none": on_world(sampling_method='NONE', max_bounces=0),
    "world-sampling-manual": on_world(sampling_method='MANUAL', sample_map_resolution=64),
    **{f"emission-sampling-{m.lower()}": sampled(m) for m in ('NONE', 'FRONT', 'BACK')},
}
QUICK = ("settings-of-eevee", "light-groups")


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_flag_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    agrees(both_sides(SIZE, samples=64 if name in QUICK else 192))
