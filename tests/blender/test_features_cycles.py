# SPDX-License-Identifier: GPL-3.0-or-later
"""Feature by feature and flag by flag, our direct light against that of Cycles.

Each case sets up the open scene; both render it, with every pixel compared. Of the flags most
change nothing but noise in Cycles.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import pytest

from .agreement import FINE, PICTURE, agrees, both_sides, cases, glow, lamp, look_at, square, stage
from .reading import (
    CUBE,
    add,
    added,
    gathered,
    geometry_nodes,
    instanced,
    light,
    material,
    node,
    polygons,
    put,
    world,
)

SKY, FACING = {"Color": (0.3, 0.4, 0.6, 1)}, (0.5, -6, 3)
Where = tuple[float, float, float]


def fill(energy: float = 50.0) -> Any:
    return lamp('POINT', (-2, -2, 3), energy=energy, shadow_soft_size=0)


def shown(kind: str, location: Where = (-1, 0.3, 1.4), **properties: Any) -> None:
    """A light that the camera sees, and that faces it."""
    stage()
    lamp(kind, location, FACING, visible_camera=True, **properties)
    fill()


def on_box(kind: str = 'POINT', of_light: dict[str, Any] | None = None, **box: Any) -> None:
    stage(**box)
    lamp(kind, (-1, -1.2, 2.5), **{"shadow_soft_size": 0.1, **(of_light or {})})


def rendered(**settings: Any) -> None:
    on_box()
    put(bpy.context.scene.render, **settings)


def sky(**visible: bool) -> None:
    on_box()
    put(world(**SKY).cycles_visibility, **visible)


def ceiling() -> None:
    square("Ceiling", scale=(3, 3, 1), location=(0, 0, 2.5))


def emitter(copies: int = 1, **properties: Any) -> None:
    """A square that glows from both faces, `copies` times side by side."""
    stage()
    ceiling()
    first = square("Square", glow(), location=(-0.9, 0.3, 1.6), scale=(0.3, 0.3, 1))
    others = [add("Copy", first.data, location=(0.9 * k - 0.9, 0.3, 1.6), scale=first.scale)
              for k in range(1, copies)]  # fmt: skip
    for each in (first, *others):
        put(each, **properties)


def instanced_emitter() -> None:
    """One emitting object, instanced by a collection three times over."""
    stage()
    panel = square("Square", glow(), scale=(0.25, 0.35, 1), rotation_euler=(0.4, 0.2, 0))
    instanced([(k - 1.2, 0.2 * k, 1.7) for k in range(3)], panel)


def emitter_under_ceiling() -> None:
    """A panel close to a ceiling, which its upper face lights at grazing angles alone."""
    stage()
    ceiling()
    place = {"location": (0, 0.3, 2.45), "scale": (0.4, 0.4, 1)}
    square("Panel", glow(20.0), **place, visible_camera=False)
    look_at((0, 0.3, 2.5), (0.3, -3, 0.9), lens=60)


def two_materials() -> None:
    """A box that glows in two colours on two of its faces, and reflects with the others."""
    box = stage(location=(0.2, -0.2, 0.8)).data
    for k, colour in enumerate([(1, 0.2, 0.1), (0.1, 0.3, 1)]):
        box.materials.append(glow(4.0 * (k + 1), colour))
        box.polygons[2 * k].material_index = k + 1
    fill(30)


def emission_and_diffuse() -> None:
    """A material that adds emission to Lambert reflection; in no plane of the axes."""
    box = stage(location=(0.2, -0.2, 0.8), rotation_euler=(0.3, 0.2, 0.5))
    added(box.data.materials[0], "Emission", Strength=2.0)
    fill()


def orthographic() -> None:
    on_box()
    put(bpy.context.scene.camera, type='ORTHO', ortho_scale=5.0)


def unit_scale() -> None:
    on_box()
    put(bpy.context.scene.unit_settings, system='METRIC', scale_length=0.01)


def made_by_nodes() -> None:
    """Bodies without a material that geometry nodes make: one of their own, others as instances."""
    on_box()
    host = add("Host", bpy.data.meshes.new("Host"), location=(-1, -0.4, 0.6))
    tree, join = geometry_nodes(host, "GeometryNodeJoinGeometry")
    ball = node(tree, "GeometryNodeMeshUVSphere", Radius=0.5)
    cube = node(tree, "GeometryNodeMeshCube", Size=(0.3, 0.3, 0.3))
    place = {"Start_Location": (0.8, -0.5, -0.3), "Offset": (0.3, 0.3, 0.2)}
    line = node(tree, "GeometryNodeMeshLine", Count=3, **place)
    copies = node(tree, "GeometryNodeInstanceOnPoints", line)
    tree.links.new(cube.outputs[0], copies.inputs["Instance"])
    for each in (copies, ball):
        tree.links.new(each.outputs[0], join.inputs[0])


# --- what is read of geometry -------------------------------------------------------------------


def bodies() -> None:
    """What Blender turns into triangles; the box is finer in renders."""
    on_box()
    put(bpy.data.objects["Box"].modifiers.new("Subdivision", 'SUBSURF'), levels=0, render_levels=3)
    bpy.ops.object.text_add(location=(-1.5, -1.2, 0.1), rotation=(1.2, 0, 0))
    bpy.ops.curve.primitive_bezier_circle_add(location=(-1.2, 0.3, 0.6), rotation=(0.5, 0.3, 0))
    put(bpy.context.object, bevel_depth=0.2, scale=(0.6,) * 3)
    for k, make in enumerate(
        (bpy.ops.object.metaball_add, bpy.ops.surface.primitive_nurbs_surface_sphere_add)
    ):
        make(location=(1.6, 0.3 - 1.4 * k, 0.6))
        bpy.context.object.scale = (0.5,) * 3


def instances() -> None:
    """Collections with a lamp in them, children of vertices, instances of geometry nodes."""
    on_box(visible_camera=False)
    bulb = light('POINT', "Bulb", energy=5, shadow_soft_size=0, location=(0, -0.3, 0.9))
    part = square("Part", scale=(0.2, 0.3, 1), rotation_euler=(0.7, 0.1, 0))
    instanced([(k - 1.4, -0.5, 0.5 + 0.1 * k) for k in range(3)], bulb, part)
    for shows, place in ((False, (-1, 1, 1)), (True, (1, 1, 0.6))):
        parent = square("Parent", location=place, scale=(0.5,) * 3)
        add("Child", polygons("Child", *CUBE), parent=parent, scale=(0.2, 0.3, 0.2))
        parent.instance_type, parent.show_instancer_for_render = 'VERTS', shows
    ground = square("Ground", location=(1.3, -0.8, 0.4), scale=(0.5,) * 3)
    tree, scatter = geometry_nodes(ground, "GeometryNodeInstanceOnPoints")
    cube = node(tree, "GeometryNodeMeshCube", Size=(0.5, 0.4, 0.6))
    tree.links.new(node(tree, "NodeGroupInput").outputs[0], scatter.inputs["Points"])
    tree.links.new(cube.outputs[0], scatter.inputs["Instance"])


def painted() -> None:
    """One mesh for three, of which one has its own material and one a bevel; materials by face."""
    on_box(visible_camera=False)
    paints = [material(f"Paint {k}", "BsdfDiffuse", Color=(k, 0.3, 0.1)) for k in range(2)]
    mesh = polygons("Cube", *CUBE)
    for paint in paints:
        mesh.materials.append(paint)
    for face in mesh.polygons:
        face.material_index = face.index % 3
    mesh.polygons[5].material_index = 7  # beyond the slots: Cycles takes the last
    turned = {"scale": (0.4,) * 3, "rotation_euler": (0.5, 0.3, 0.2)}
    add("One", mesh, location=(-1, 0, 0.7), **turned)
    other = add("Other", mesh, location=(1, -0.4, 0.7), **turned)
    put(other.material_slots[0], link='OBJECT', material=paints[1])
    add("Bevelled", mesh, location=(0, -0.9, 0.6), **turned).modifiers.new("Bevel", 'BEVEL')


def hidden() -> None:
    """Of five squares in the way of light, only what is off in viewports alone is there."""
    on_box()
    squares = [
        square(f"Square {k}", location=(0.9 * k - 2, -0.4, 0.6 + 0.2 * k), scale=(0.4,) * 3)
        for k in range(5)
    ]
    squares[0].hide_render = squares[1].hide_viewport = True
    gathered("Hidden", squares[2], shown=True).hide_render = True
    gathered("Out", squares[3], shown=True)
    bpy.context.view_layer.layer_collection.children["Out"].exclude = True
    rays = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    put(squares[4], **{f"visible_{ray}": False for ray in rays})


BALL = {"shadow_soft_size": 0.3, "use_soft_falloff": False}
BORDER = {"border_min_x": 0.2, "border_max_x": 0.9, "border_min_y": 0.1, "border_max_y": 0.8}
TURNED = {"scale": (0.8, -0.1, 3), "rotation_euler": (0.5, 0.6, 0.2)}
CASES: dict[str, Callable[[], None]] = {
    "shown-point": partial(shown, 'POINT', shadow_soft_size=0.3),
    "shown-sphere": partial(shown, 'POINT', **BALL),
    "shown-spot": partial(shown, 'SPOT', shadow_soft_size=0.3, spot_size=1.0),
    "shown-spot-sphere": partial(shown, 'SPOT', **BALL, spot_size=0.9),
    "shown-area": partial(shown, 'AREA', size=0.7),
    "shown-area-spread": partial(shown, 'AREA', size=0.7, spread=1.2, shape='DISK'),
    "shown-area-hidden-in-part": partial(shown, 'AREA', (0.6, 1.4, 0.6), size=1.2),
    "shown-sun": partial(shown, 'SUN', (-0.5, 10, 1.0), angle=0.3),
    "no-camera-rays": partial(on_box, visible_camera=False),
    "no-shadow-rays": partial(on_box, visible_shadow=False),
    "no-diffuse-rays": partial(on_box, visible_diffuse=False),
    "no-shadow-area": partial(on_box, 'AREA', {"use_shadow": False}),
    "no-shadow-sun": partial(on_box, 'SUN', {"use_shadow": False, "shadow_soft_size": 0}),
    "negative": partial(on_box, of_light={"energy": -50.0}),
    "emitter": emitter,
    "emitter-scaled": partial(emitter, **TURNED),
    "emitter-copies": partial(emitter, 3),
    "emitter-instances": instanced_emitter,
    "emitter-under-ceiling": emitter_under_ceiling,
    "emitter-two-materials": two_materials,
    "emitter-and-diffuse": emission_and_diffuse,
    "emitter-no-camera-rays": partial(emitter, visible_camera=False),
    "emitter-no-shadow-rays": partial(emitter, visible_shadow=False),
    "emitter-no-diffuse-rays": partial(emitter, 2, visible_diffuse=False),
    "orthographic": orthographic,
    "transparent": partial(rendered, film_transparent=True),
    "border": partial(rendered, use_border=True, use_crop_to_border=True, **BORDER),
    "aspect": partial(rendered, pixel_aspect_x=1.6),
    "unit-scale": unit_scale,
    "bodies": bodies,
    "instances": instances,
    "shared-mesh": painted,
    "hidden": hidden,
    "world": sky,
    "world-no-camera-rays": partial(sky, camera=False),
    "world-no-diffuse-rays": partial(sky, diffuse=False),
}


QUICK_CASES = [name for name in CASES if not name.startswith("emitter-")]


@pytest.mark.feature(PICTURE, area="Objects, lights and settings")
@pytest.mark.parametrize("name", cases(CASES, QUICK_CASES))
def test_feature_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    agrees(both_sides(**(FINE if name.startswith("emitter") else {})))


@pytest.mark.feature(PICTURE, area="Objects, lights and settings")
def test_what_geometry_nodes_make_turns_to_clay() -> None:
    made_by_nodes()
    agrees(both_sides(shading="clay"))


# --- flags ----------------------------------------------------------------------------------------

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


def on_lamps(of_cycles: bool = False, **properties: Any) -> None:
    for each in lamps():
        put(each.data.cycles if of_cycles else each.data, **properties)


def on_world(**properties: Any) -> None:
    lamps()
    put(world(**SKY).cycles, **properties)


def grouped() -> None:
    """Lamps, a panel and the world in light groups: the picture has all of them."""
    placed = [*lamps(), world(**SKY), square("Panel", glow(), location=(-1, 0.5, 1.5))]
    for k, each in enumerate(placed):
        bpy.context.view_layer.lightgroups.add(name=f"Group {k}")
        each.lightgroup = f"Group {k}"


def portal() -> None:
    """A portal that sees the world in part: it guides, and is no light."""
    on_world()
    lamp('AREA', (0, 0, 2.5), energy=1000, size=1.0).data.cycles.is_portal = True


def unlit_by() -> None:
    lamps()[0].visible_diffuse = False


def seen_alone() -> None:
    """A lamp that shows and lights nothing, beside those that do."""
    lamps()
    seen = {"visible_camera": True, "visible_diffuse": False}
    lamp('POINT', (-1, 0.3, 1.2), shadow_soft_size=0.3, **seen)


def unmet() -> None:
    """A sun in view without Multiple Importance, which then no ray meets."""
    shown('SUN', (-0.5, 10, 1.0), angle=0.3)
    made = bpy.data.objects["Sun"]
    made.data.cycles.use_multiple_importance_sampling = False


def on_velvet() -> None:
    """Velvet is lit by what is for glossy rays, as far as no surface's ray finds it."""
    stage()
    for k, lit in enumerate(("visible_diffuse", "visible_glossy")):
        lamp('SUN', (1 - 2 * k, -2, 3), angle=0.0, **{lit: False})
    velvet = material("Velvet", "BsdfSheen", distribution='ASHIKHMIN', Roughness=0.6)
    for name in ("Floor", "Box"):
        bpy.data.objects[name].data.materials[0] = velvet


def tinted() -> None:
    """A floor that glows as a blackbody, where there is one in a working space of its own."""
    lamps()
    if bpy.app.version >= (5, 0):
        bpy.ops.wm.set_working_color_space(working_space='ACEScg', convert_colors=False)
    bpy.data.objects["Floor"].data.materials[0] = material(
        "Hot", lambda tree: node(tree, "Emission", node(tree, "Blackbody", Temperature=2500.0))
    )


def sampled(method: str) -> None:
    stage()
    made = glow(6.0)
    made.cycles.emission_sampling = method
    place = {"location": (-0.3, 0.3, 1.9), "rotation_euler": (2.6, 0.2, 0.3)}
    square("Panel", made, **place, scale=(0.8, 0.6, 1))


MANUAL = {"sampling_method": 'MANUAL', "sample_map_resolution": 64}
FLAGS: dict[str, Callable[[], None]] = {
    "settings-of-eevee": partial(on_lamps, **EEVEE),
    "light-without-mis": partial(on_lamps, True, use_multiple_importance_sampling=False),
    "light-max-bounces-0": partial(on_lamps, True, max_bounces=0),
    "light-groups": grouped,
    "light-no-diffuse-rays": unlit_by,
    "light-that-the-camera-alone-sees": seen_alone,
    "portal": portal,
    "sun-without-mis-in-view": unmet,
    "velvet": on_velvet,
    "working-space": tinted,
    "world-sampling-none": partial(on_world, sampling_method='NONE', max_bounces=0),
    "world-sampling-manual": partial(on_world, **MANUAL),
    **{f"emission-sampling-{m.lower()}": partial(sampled, m) for m in ('NONE', 'FRONT', 'BACK')},
}
QUICK = ("settings-of-eevee", "light-groups")


@pytest.mark.feature(PICTURE, area="Flags")
@pytest.mark.parametrize("name", cases(FLAGS, QUICK))
def test_flag_is_that_of_cycles(name: str) -> None:
    FLAGS[name]()
    agrees(both_sides(**({} if name in QUICK else {**FINE, "samples": 256})))
