# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from a scene: geometry as it renders, instances, visibility, lights, world."""

import math
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.emitters import emitters
from blender_rad.scene import Scene

from .reading import (
    SQUARE,
    add,
    camera,
    empty_scene,
    light,
    node,
    polygons,
    put,
    sphere,
    with_nodes,
    world,
)


@pytest.fixture(autouse=True)
def scene() -> Any:
    return empty_scene()


def read(**options: Any) -> Scene:
    return read_scene(bpy.context.scene, **options)


def test_what_is_not_finite_is_left_out() -> None:
    broken = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (math.nan, 0, 0)]
    add("Half", polygons("Half", broken, [(0, 1, 2), (0, 1, 3)]))
    far = add("Far", scale=(1e30,) * 3)
    add("Lost", polygons("Lost", *SQUARE), scale=(1e30,) * 3, parent=far)
    light('POINT', "Endless", energy=math.inf)
    scene = read()
    assert [i.name for i in scene.instances] == ["Half"]
    assert len(scene.meshes[0].triangles) == 1
    assert np.isfinite(scene.meshes[0].vertices).all()
    assert not scene.lights
    found = {f.object for f in scene.findings if f.code == "not-finite"}
    assert found == {"Half", "Lost", "Endless"}


def test_hair_and_volumes_become_boxes() -> None:
    ball = add("Ball", sphere("Ball"))
    bpy.context.view_layer.objects.active = ball
    hair = ball.modifiers.new("Hair", 'PARTICLE_SYSTEM').particle_system.settings
    put(hair, type='HAIR', count=20, hair_length=0.5)
    bpy.ops.object.volume_add()
    scene = read()
    boxes = {i.name: i for i in scene.instances if i.proxy}
    assert set(boxes) == {"Ball", "Volume"}
    assert not any(scene.materials[box.materials[0]].opaque for box in boxes.values())
    assert scene.meshes[boxes["Ball"].mesh].vertices.max() > 1.3
    assert not next(i for i in scene.instances if not i.proxy).proxy


def test_lights_with_their_properties_and_constant_nodes() -> None:
    lamp = light('SPOT', energy=30.0, spot_size=0.5, color=(1, 0.5, 0.25))
    (found,) = read().lights
    assert (found.name, found.kind) == ("Lamp", "SPOT")
    np.testing.assert_allclose(found.rgb, [30, 15, 7.5], rtol=1e-6)
    tree = with_nodes(lamp.data)
    tree.nodes.clear()
    node(tree, "OutputLight", node(tree, "Emission", Color=(0.5, 1, 1), Strength=3))
    np.testing.assert_allclose(read().lights[0].rgb, [45, 45, 22.5], rtol=1e-6)


def test_lights_that_do_not_light() -> None:
    light('POINT', "Hidden").visible_diffuse = False
    portal = light('AREA', "Portal")
    portal.data.cycles.is_portal = True
    seen = light('AREA', "Seen")
    seen.visible_diffuse, seen.visible_camera = False, True
    scene = read()
    rest = ("glossy", "transmission")
    assert {lamp.name: lamp.reaches for lamp in scene.lights} == {"Hidden": rest, "Seen": rest}
    assert [f.object for f in scene.findings] == ["Hidden", "Seen"]
    assert not emitters(scene)[0]  # nothing here shines


def test_empty_collections_link_nothing() -> None:
    panel = add("Panel", polygons("Panel", *SQUARE))
    panel.light_linking.blocker_collection = bpy.data.collections.new("Blockers")
    assert not read().linking


def test_worlds() -> None:
    assert read().world.radiance == (0, 0, 0)
    made = world(Color=(0.5, 1, 0.25, 1), Strength=4)
    made.cycles_visibility.diffuse = False
    found = read().world
    assert found.radiance == (2, 4, 1)
    assert (found.known, found.visible_camera, found.visible_diffuse) == (True, True, False)
    node(made.node_tree, "LightPath")
    way = made.node_tree.nodes["Light Path"].outputs[0]
    made.node_tree.links.new(way, made.node_tree.nodes["Background"].inputs["Color"])
    scene = read()
    assert not scene.world.known
    assert [(u.kind, u.name, u.feature) for u in scene.unsupported] == [
        ("world", "World", "Light Path")
    ]


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="worlds and materials always have nodes")
def test_without_nodes_colours_count() -> None:
    world().color = (0.25, 0.5, 1)
    plain = bpy.data.materials.new("Plain")
    plain.diffuse_color = (0.25, 0.5, 0.75, 1)
    add("Plane", polygons("Plane", *SQUARE)).data.materials[0] = plain
    scene = read()
    assert scene.world.radiance == (0.25, 0.5, 1)
    assert scene.materials[0].albedo == (0.25, 0.5, 0.75)


@pytest.mark.parametrize(
    ("system", "expected"), [('METRIC', 0.01), ('IMPERIAL', 0.01), ('NONE', 1)]
)
def test_unit_scale_counts_with_a_unit_system(system: str, expected: float) -> None:
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, 0.01
    assert read().unit_scale_m == pytest.approx(expected)


def test_nothing_is_changed_and_nothing_stays() -> None:
    scene = bpy.context.scene
    camera()
    scene.camera = None
    before = {p: getattr(scene.render, p) for p in ("engine", "use_freestyle", "resolution_x")}
    engines = {c.__name__ for c in bpy.types.RenderEngine.__subclasses__()}
    assert read().camera is None
    assert {p: getattr(scene.render, p) for p in before} == before
    assert scene.camera is None
    assert {c.__name__ for c in bpy.types.RenderEngine.__subclasses__()} <= engines | {"Reader"}


def test_errors_come_out_of_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    from blender_rad.bpy_io import read as module

    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("carried out")

    monkeypatch.setattr(module, "read_depsgraph", fail)
    with pytest.raises(RuntimeError, match="carried out"):
        read()


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="one working space before Blender 5")
def test_working_space() -> None:
    scene = read()
    assert scene.working_space == bpy.data.colorspace.working_space
    assert sum(scene.luminance_weights) == pytest.approx(1, abs=1e-6)
