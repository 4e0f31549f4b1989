# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and shadow linking, ours against that of Cycles.

A stage has two boxes; one lamp lights all of it, another one is linked.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.meters import LuxMeter

from .agreement import FINE, PICTURE, agrees, both_sides, cases, glow, lamp, square, stage
from .reading import CUBE, add, instanced, material, polygons

FEATURE = pytest.mark.feature(PICTURE, area="Light linking")
WIDE = {'POINT': {"shadow_soft_size": 0.3}, 'AREA': {"size": 0.8}, 'SUN': {"angle": 0.2}}


def linked(light: Any, kind: str, *members: Any, include: bool = True, child: Any = None) -> None:
    """Link a light to objects by a collection, in which a `child` has the other state."""
    made = bpy.data.collections.new("Linked")
    states = ('INCLUDE', 'EXCLUDE') if include else ('EXCLUDE', 'INCLUDE')
    for member in members:
        made.objects.link(member)
        made.collection_objects[-1].light_linking.link_state = states[0]
    if child:
        made.children.link(bpy.data.collections.new("Child"))
        made.children[0].objects.link(child)
        made.collection_children[0].light_linking.link_state = states[1]
    setattr(light.light_linking, f"{kind}_collection", made)


def boxes() -> tuple[Any, Any, Any]:
    """A stage with two boxes, and a lamp over it; floor and boxes are returned."""
    box = stage()
    other = add("Other", polygons("Other", *CUBE), location=(-0.8, 0, 0.5), scale=(0.3,) * 3)
    lamp('POINT', (-2, -2, 3), energy=30, shadow_soft_size=0)
    return bpy.data.objects["Floor"], box, other


def key(kind: str, **properties: Any) -> Any:
    return lamp(kind, (-0.6, -1, 2.5), (0.2, 0.2, 0), **{**WIDE[kind], **properties})


def one(how: str, of_light: str, include: bool) -> None:
    _, box, _ = boxes()
    linked(key(of_light), how, box, include=include)


def both_kinds() -> None:
    floor, box, other = boxes()
    light = key('AREA')
    linked(light, "receiver", floor, include=False, child=box)
    linked(light, "blocker", box, include=False)
    linked(key('POINT'), "receiver", box, other)


def glows() -> None:
    floor, box, _ = boxes()
    place = {"location": (-0.3, -0.9, 1.6), "rotation_euler": (0.2, 0.1, 0)}
    panel = square("Panel", glow(20.0), **place, scale=(0.3,) * 3)
    linked(panel, "receiver", floor)
    linked(panel, "blocker", box, include=False)


def glossy() -> None:
    """Links of what closures reflect, however it is sampled."""
    floor, box, other = boxes()
    for each in (floor, box, other):
        each.data.materials[0] = material("Coat", "BsdfGlossy", Roughness=0.3)
    light = key('AREA')
    linked(light, "receiver", box, include=False)
    linked(light, "blocker", other, include=False)


def of_instances() -> None:
    """Instances are linked as what instances them, where that is named; lights by their own."""
    _, box, other = boxes()
    light = key('POINT')
    hosts = instanced([(0.9 * k, 0.1, 0) for k in range(2)], other, light)
    linked(light, "receiver", hosts[1], box, include=False)
    linked(light, "blocker", hosts[0])


CASES: dict[str, Callable[[], None]] = {
    "receivers-included": partial(one, "receiver", 'POINT', True),
    "receivers-excluded": partial(one, "receiver", 'SUN', False),
    "blockers-included": partial(one, "blocker", 'POINT', True),
    "blockers-excluded": partial(one, "blocker", 'AREA', False),
    "sun-blockers-included": partial(one, "blocker", 'SUN', True),
    "sun-blockers-excluded": partial(one, "blocker", 'SUN', False),
    "area-blockers-included": partial(one, "blocker", 'AREA', True),
    "receivers-and-blockers": both_kinds,
    "emitting-mesh": glows,
    "instances": of_instances,
    "glossy": glossy,
}
QUICK = ("receivers-included", "blockers-excluded", "emitting-mesh", "instances")


def test_meters_have_the_lights_that_light_what_is_not_named() -> None:
    one("receiver", 'POINT', True)
    meter = LuxMeter(read_scene(bpy.context.scene), efficacy=1.0)
    readings = meter.read(np.array([[-1.5, -1.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    found = dict(zip(meter.names, readings.lights[0], strict=True))
    assert found["Point"] > 0.0 and found["Point.001"] == 0.0


@pytest.mark.slow
@FEATURE
@pytest.mark.parametrize("kind", ['SUN', 'AREA'], ids=["sun-without-mis", "area-without-mis"])
def test_cycles_loses_light_that_it_finds_by_the_surface(kind: str) -> None:
    """Behind what does not shadow a light; without Multiple Importance it finds none so."""
    _, box, _ = boxes()
    light = key(kind, **({"angle": 2.5} if kind == 'SUN' else {"size": 3.0}))
    linked(light, "blocker", box)
    sides = both_sides(**FINE)
    assert [f.object for f in sides.scene.findings if f.code == "shadow-linking"] == [light.name]
    lost, error = sides.energy()
    assert lost < -5 * error
    light.data.cycles.use_multiple_importance_sampling = False
    sides = both_sides(**FINE, samples=128)
    agrees(sides)
    assert not sides.scene.findings


@FEATURE
@pytest.mark.parametrize("name", cases(CASES, QUICK))
def test_links_are_those_of_cycles(name: str) -> None:
    CASES[name]()
    sides = both_sides(**({} if name in QUICK else FINE))
    assert sides.scene.linking
    agrees(sides)
