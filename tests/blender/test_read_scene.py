# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from a scene: geometry as it renders, instances, visibility, lights, world."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.emitters import emitters
from blender_rad.scene import Mesh, Scene

from .reading import (
    CUBE,
    SQUARE,
    add,
    camera,
    collection,
    empty_scene,
    geometry_nodes,
    light,
    material,
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


def mesh_of(scene: Scene, name: str) -> Mesh:
    return scene.meshes[next(i.mesh for i in scene.instances if i.name == name)]


def test_subdivision_is_that_of_the_render() -> None:
    cube = add("Cube", polygons("Cube", *CUBE))
    modifier = cube.modifiers.new("Subdivision", 'SUBSURF')
    modifier.levels, modifier.render_levels = 0, 3
    assert len(mesh_of(read(), "Cube").triangles) == 6 * 4**3 * 2


@pytest.mark.parametrize("kind", ['FONT', 'CURVE', 'META', 'SURFACE'])
def test_what_blender_turns_into_triangles_is_read(kind: str) -> None:
    makers = {
        'FONT': bpy.ops.object.text_add,
        'CURVE': bpy.ops.curve.primitive_bezier_circle_add,
        'META': bpy.ops.object.metaball_add,
        'SURFACE': bpy.ops.surface.primitive_nurbs_surface_sphere_add,
    }
    makers[kind]()
    if kind == 'CURVE':
        bpy.context.object.data.bevel_depth = 0.1
    scene = read()
    assert [i.name for i in scene.instances] == [bpy.context.object.name]
    assert len(scene.meshes[0].triangles) > 10


def test_collection_instances_share_their_mesh() -> None:
    lamps = collection(
        "Lamps", ("Part", polygons("Part", *SQUARE)), ("Bulb", bpy.data.lights.new("Bulb", 'POINT'))
    )
    bpy.context.scene.collection.children.unlink(lamps)
    for x in range(3):
        placed = add(f"Place{x}", location=(x, 0, 0))
        placed.instance_type, placed.instance_collection = 'COLLECTION', lamps
    scene = read()
    assert [i.name for i in scene.instances] == ["Part"] * 3
    assert len(scene.meshes) == 1
    assert not any(i.normals_in_world for i in scene.instances)
    assert sorted(i.world_from_object[0, 3] for i in scene.instances) == [0, 1, 2]
    assert [bulb.name for bulb in scene.lights] == ["Bulb"] * 3


def test_vertex_instances_leave_out_the_instancer() -> None:
    parent = add("Parent", polygons("Parent", *SQUARE))
    add("Child", polygons("Child", *CUBE), parent=parent)
    parent.instance_type, parent.show_instancer_for_render = 'VERTS', False
    assert [i.name for i in read().instances] == ["Child"] * 4
    parent.show_instancer_for_render = True
    assert sorted(i.name for i in read().instances) == ["Child"] * 4 + ["Parent"]


def test_geometry_nodes_instances_share_their_mesh() -> None:
    ground = add("Ground", polygons("Ground", *SQUARE))
    tree, scatter = geometry_nodes(ground, "GeometryNodeInstanceOnPoints")
    cube = node(tree, "GeometryNodeMeshCube")
    tree.links.new(node(tree, "NodeGroupInput").outputs[0], scatter.inputs["Points"])
    tree.links.new(cube.outputs[0], scatter.inputs["Instance"])
    scene = read()
    assert [i.name for i in scene.instances] == ["Ground"] * 4
    assert [len(mesh.triangles) for mesh in scene.meshes] == [12]


def test_two_users_share_a_mesh_unless_modified() -> None:
    mesh = polygons("Mesh", *SQUARE)
    add("A", mesh)
    b = add("B", mesh, location=(3, 0, 0))
    scene = read()
    assert len(scene.meshes) == 1
    assert not any(i.normals_in_world for i in scene.instances)
    b.modifiers.new("Bevel", 'BEVEL')
    scene = read()
    assert len(scene.meshes) == 2
    assert all(i.normals_in_world for i in scene.instances)


def test_object_materials_come_through_instances() -> None:
    mesh = polygons("Mesh", *SQUARE)
    red = material("Red", "BsdfDiffuse", Color=(1, 0, 0, 1))
    add("A", mesh)
    b = add("B", mesh)
    b.material_slots[0].link = 'OBJECT'
    b.material_slots[0].material = red
    scene = read()
    albedo = {i.name: scene.materials[i.materials[0]].albedo for i in scene.instances}
    assert albedo["B"] == (1, 0, 0)
    assert albedo["A"] == pytest.approx((0.8, 0.8, 0.8))


def test_materials_by_face() -> None:
    mesh = polygons("Cube", *CUBE)
    for i in range(2):
        mesh.materials.append(material(f"M{i}", "BsdfDiffuse", Color=(i, 0, 0, 1)))
    for face in mesh.polygons:
        face.material_index = face.index % 3
    mesh.polygons[5].material_index = 7  # beyond the slots: Cycles takes the last
    add("Cube", mesh)
    scene = read()
    names = [scene.materials[m].name for m in scene.instances[0].materials]
    by_face = [names[s] for s in scene.meshes[0].slots[::2]]
    assert by_face == ["Cube", "M0", "M1", "Cube", "M0", "M1"]


def test_hidden_things_are_not_read() -> None:
    add("Render", polygons("A", *SQUARE)).hide_render = True
    collection("Hidden", ("Collection", polygons("B", *SQUARE))).hide_render = True
    collection("Out", ("Excluded", polygons("C", *SQUARE)))
    bpy.context.view_layer.layer_collection.children["Out"].exclude = True
    add("Viewport", polygons("D", *SQUARE)).hide_viewport = True
    unseen = add("Rays", polygons("E", *SQUARE))
    for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(unseen, f"visible_{ray}", False)
    assert [i.name for i in read().instances] == ["Viewport"]


def test_what_is_not_finite_is_left_out() -> None:
    broken = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (math.nan, 0, 0)]
    add("Half", polygons("Half", broken, [(0, 1, 2), (0, 1, 3)]))
    far = add("Far", scale=(1e30,) * 3)
    add("Lost", polygons("Lost", *SQUARE), scale=(1e30,) * 3, parent=far)
    light('POINT', "Endless", energy=math.inf)
    scene = read()
    assert len(mesh_of(scene, "Half").triangles) == 1
    assert np.isfinite(mesh_of(scene, "Half").vertices).all()
    assert [i.name for i in scene.instances] == ["Half"]
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
