# SPDX-License-Identifier: GPL-3.0-or-later
"""Feature by feature, our direct light against that of Cycles.

Each case sets up the open scene; both render it, with every pixel compared. A stage is a floor with
a box on it under a point light, seen from the front.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

pytestmark = [
    pytest.mark.blender,
    pytest.mark.feature("picture: tiles 1 %, energy 0.2 %", area="Objects, lights and settings"),
]
bpy = pytest.importorskip("bpy")

from .agreement import Sides, both_sides, lamp, look_at  # noqa: E402
from .reading import CUBE, SQUARE, add, empty_scene, material, polygons  # noqa: E402

SIZE = (48, 32)
TILES, ENERGY = 0.01, 0.002  # relative
NOISE_OF_TILES, NOISE_OF_ENERGY = 0.015, 0.006  # at most, so that the test means something
ALPHA = 0.2  # of a pixel, at edges


def stage(eye: tuple[float, float, float] = (0.5, -6, 3), **box: Any) -> Any:
    """Floor, box and camera; the box is returned."""
    empty_scene()
    add("Floor", polygons("Floor", *SQUARE), scale=(3, 3, 1))
    look_at((0, 0, 0.6), eye, lens=40)
    return add(
        "Box", polygons("Box", *CUBE), **{"location": (0.4, 0.2, 0.5), "scale": (0.4,) * 3, **box}
    )


def glowing(data: Any, strength: float = 5.0) -> Any:
    """Give a mesh an emitting material in its only slot."""
    data.materials[0] = emission(strength)
    return data


def emission(strength: float, colour: tuple[float, float, float, float] = (1, 0.7, 0.4, 1)) -> Any:
    return material("Glow", "ShaderNodeEmission", Color=colour, Strength=strength)


def world(colour: tuple[float, float, float] = (0.3, 0.4, 0.6), **visible: bool) -> None:
    created = bpy.data.worlds.new("World")
    created.color = colour
    if bpy.app.version >= (5, 0):
        background = created.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*colour, 1)
    for ray, value in visible.items():
        setattr(created.cycles_visibility, ray, value)
    bpy.context.scene.world = created


# --- cases ----------------------------------------------------------------------------------------


def shown(kind: str, location: tuple[float, float, float], **properties: Any) -> Callable[[], None]:
    """A light that the camera sees, and that faces it."""

    def build() -> None:
        stage()
        lamp(kind, location, (0.5, -6, 3), **properties).visible_camera = True
        lamp('POINT', (-2, -2, 3), energy=50, shadow_soft_size=0)

    return build


def on_box(light: Mapping[str, Any] | None = None, **box: Any) -> Callable[[], None]:
    """A box with properties, under a light with properties."""
    key = {"kind": 'POINT', "location": (-1, -1.2, 2.5), "shadow_soft_size": 0.1, **(light or {})}

    def build() -> None:
        stage(**box)
        lamp(**key)

    return build


def rendered(**settings: Any) -> Callable[[], None]:
    """The stage with settings of the render."""

    def build() -> None:
        on_box()()
        for name, value in settings.items():
            setattr(bpy.context.scene.render, name, value)

    return build


def sky(**visible: bool) -> Callable[[], None]:
    def build() -> None:
        on_box()()
        world(**visible)

    return build


def emitter(matrix: Mapping[str, Any], copies: int = 1, **properties: Any) -> Callable[[], None]:
    """A square that glows from both faces, `copies` times side by side."""

    def build() -> None:
        stage()
        add("Ceiling", polygons("Ceiling", *SQUARE), scale=(3, 3, 1), location=(0, 0, 2.5))
        mesh = glowing(polygons("Square", *SQUARE))
        for k in range(copies):
            place = {"location": (k * 0.9 - 0.9, 0.3, 1.6), "scale": (0.3, 0.3, 1), **matrix}
            add(f"Square {k}", mesh, **place, **properties)

    return build


def instanced_emitter() -> None:
    """One emitting object, instanced by a collection three times over."""
    stage()
    source = bpy.data.collections.new("Lamps")
    square = bpy.data.objects.new("Square", glowing(polygons("Square", *SQUARE)))
    square.scale = (0.25, 0.35, 1)
    square.rotation_euler = (0.4, 0.2, 0)
    source.objects.link(square)
    for k in range(3):
        host = add(f"Host {k}", None, location=(k - 1.2, 0.2 * k, 1.7))
        host.instance_type, host.instance_collection = 'COLLECTION', source


def emitter_under_ceiling() -> None:
    """A panel close to a ceiling, which its upper face lights at grazing angles alone."""
    stage()
    add("Ceiling", polygons("Ceiling", *SQUARE), scale=(3, 3, 1), location=(0, 0, 2.5))
    panel = glowing(polygons("Panel", *SQUARE), 20.0)
    add("Panel", panel, location=(0, 0.3, 2.45), scale=(0.4, 0.4, 1), visible_camera=False)
    look_at((0, 0.3, 2.5), (0.3, -3, 0.9), lens=60)


def two_materials() -> None:
    """A box that glows in two colours on two of its faces, and reflects with the others."""
    box = stage(location=(0.2, -0.2, 0.8))
    for k, colour in enumerate([(1, 0.2, 0.1, 1), (0.1, 0.3, 1, 1)]):
        box.data.materials.append(emission(4.0 * (k + 1), colour))
        box.data.polygons[2 * k].material_index = k + 1
    lamp('POINT', (-2, -2, 3), energy=30, shadow_soft_size=0)


def emission_and_diffuse() -> None:
    """A material that adds emission to Lambert reflection; in no plane of the axes."""
    box = stage(location=(0.2, -0.2, 0.8), rotation_euler=(0.3, 0.2, 0.5))
    tree = box.data.materials[0].node_tree
    glow, add_shader = (tree.nodes.new(f"ShaderNode{n}") for n in ("Emission", "AddShader"))
    glow.inputs["Strength"].default_value = 2.0
    diffuse = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    output = tree.get_output_node('CYCLES')
    tree.links.new(diffuse.outputs[0], add_shader.inputs[0])
    tree.links.new(glow.outputs[0], add_shader.inputs[1])
    tree.links.new(add_shader.outputs[0], output.inputs["Surface"])
    lamp('POINT', (-2, -2, 3), energy=50, shadow_soft_size=0)


def orthographic() -> None:
    on_box()()
    data = bpy.context.scene.camera.data
    data.type, data.ortho_scale = 'ORTHO', 5.0


def unit_scale() -> None:
    on_box()()
    bpy.context.scene.unit_settings.system = 'METRIC'
    bpy.context.scene.unit_settings.scale_length = 0.01


CASES: dict[str, Callable[[], None]] = {
    "shown-point": shown('POINT', (-1, 0.3, 1.4), shadow_soft_size=0.3),
    "shown-sphere": shown('POINT', (-1, 0.3, 1.4), shadow_soft_size=0.3, use_soft_falloff=False),
    "shown-spot": shown('SPOT', (-1, 0.3, 1.4), shadow_soft_size=0.3, spot_size=1.0),
    "shown-spot-sphere": shown(
        'SPOT', (-1, 0.3, 1.4), shadow_soft_size=0.3, spot_size=0.9, use_soft_falloff=False
    ),
    "shown-area": shown('AREA', (-1, 0.3, 1.4), size=0.7),
    "shown-area-spread": shown('AREA', (-1, 0.3, 1.4), size=0.7, spread=1.2, shape='DISK'),
    "shown-area-hidden-in-part": shown('AREA', (0.6, 1.4, 0.6), size=1.2),
    "shown-sun": shown('SUN', (-0.5, 10, 1.0), angle=0.3),
    "no-camera-rays": on_box(visible_camera=False),
    "no-shadow-rays": on_box(visible_shadow=False),
    "no-diffuse-rays": on_box(visible_diffuse=False),
    "no-shadow-area": on_box({"kind": 'AREA', "use_shadow": False}),
    "no-shadow-sun": on_box({"kind": 'SUN', "use_shadow": False, "shadow_soft_size": 0}),
    "negative": on_box({"energy": -50.0}),
    "emitter": emitter({}),
    "emitter-scaled": emitter({"scale": (0.8, -0.1, 3), "rotation_euler": (0.5, 0.6, 0.2)}),
    "emitter-copies": emitter({}, copies=3),
    "emitter-instances": instanced_emitter,
    "emitter-under-ceiling": emitter_under_ceiling,
    "emitter-two-materials": two_materials,
    "emitter-and-diffuse": emission_and_diffuse,
    "emitter-no-camera-rays": emitter({}, visible_camera=False),
    "emitter-no-shadow-rays": emitter({}, visible_shadow=False),
    "emitter-no-diffuse-rays": emitter({}, copies=2, visible_diffuse=False),
    "orthographic": orthographic,
    "transparent": rendered(film_transparent=True),
    "border": rendered(
        use_border=True, border_min_x=0.2, border_max_x=0.9, border_min_y=0.1, border_max_y=0.8
    ),
    "aspect": rendered(pixel_aspect_x=1.6),
    "unit-scale": unit_scale,
    "world": sky(),
    "world-no-camera-rays": sky(camera=False),
    "world-no-diffuse-rays": sky(diffuse=False),
}


def made_by_nodes() -> None:
    """Bodies without a material that geometry nodes make: one of their own, others as instances."""
    on_box()()
    tree = bpy.data.node_groups.new("Make", 'GeometryNodeTree')
    tree.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    ball, cube, line, copies, join = (
        tree.nodes.new(f"GeometryNode{kind}")
        for kind in ("MeshUVSphere", "MeshCube", "MeshLine", "InstanceOnPoints", "JoinGeometry")
    )
    end = tree.nodes.new("NodeGroupOutput")
    ball.inputs["Radius"].default_value = 0.5
    cube.inputs["Size"].default_value = (0.3, 0.3, 0.3)
    line.inputs["Count"].default_value = 3
    line.inputs["Start Location"].default_value = (0.8, -0.5, -0.3)
    line.inputs["Offset"].default_value = (0.3, 0.3, 0.2)
    tree.links.new(line.outputs[0], copies.inputs["Points"])
    tree.links.new(cube.outputs[0], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], join.inputs[0])
    tree.links.new(ball.outputs[0], join.inputs[0])
    tree.links.new(join.outputs[0], end.inputs[0])
    host = add("Host", bpy.data.meshes.new("Host"), location=(-1, -0.4, 0.6))
    host.modifiers.new("Make", 'NODES').node_group = tree


def agrees(sides: Sides) -> None:
    assert not sides.film.excluded.any()
    off, error = sides.tiles()
    assert error.max() < NOISE_OF_TILES
    assert (np.abs(off) < TILES + 3 * error).all(), off
    whole, error = sides.energy()
    assert error < NOISE_OF_ENERGY
    assert abs(whole) < ENERGY + 3 * error
    np.testing.assert_allclose(sides.film.alpha, sides.seeds[..., 3].mean(axis=0), atol=ALPHA)


@pytest.mark.parametrize("name", CASES)
def test_feature_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    agrees(both_sides(SIZE))


def test_what_geometry_nodes_make_turns_to_clay() -> None:
    made_by_nodes()
    agrees(both_sides(SIZE, shading="clay"))
