# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees of surfaces against Cycles: what is measured, bent, mixed, grouped and see-through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest

from .agreement import both_sides, lamp, look_at
from .reading import SQUARE, add, empty_scene, material, node, polygons, sphere
from .test_features_cycles import SIZE, agrees, stage
from .test_textures_cycles import picture, with_uv

DIFFUSE, GLOSSY = "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfAnisotropic"
PRINCIPLED, TRANSPARENT = "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfTransparent"
SLOW = pytest.mark.slow
SIDE = 24  # pixels a ball
NORMALS = 0.0035  # median over a shape's pixels, of vectors: its outline is sampled by both sides
Wiring = Callable[[Any], Any]  # from a node tree to the shader that it is to show


def mapped(name: str) -> Any:
    """A coarse smooth ball with a bent UV map."""
    mesh = sphere(name)
    layer = mesh.uv_layers.new(name="Map")
    x, y, z = np.array([mesh.vertices[loop.vertex_index].co[:] for loop in mesh.loops]).T
    uv = np.stack([0.5 + 0.4 * x + 0.1 * z * z, 0.5 + 0.4 * z + 0.1 * x * y], axis=1)
    layer.data.foreach_set("uv", uv.astype(np.float32).ravel())
    return mesh


def shows(wire: Wiring) -> Any:
    """A material of what `wire` returns."""
    created = material("Shown", DIFFUSE)
    tree = created.node_tree
    tree.links.new(wire(tree).outputs[0], tree.get_output_node('CYCLES').inputs[0])
    return created


def scene(wire: Wiring, *, alone: bool = False) -> Any:
    """A ball of a material on a floor, of the same unless the ball is `alone` in it."""
    box = stage(location=(0.1, 0.0, 0.8), scale=(0.8,) * 3)
    box.data = mapped("Ball")
    box.data.materials[0] = shown = shows(wire)
    floor = with_uv(bpy.data.objects["Floor"].data)
    floor.materials[0] = material("Plain", DIFFUSE) if alone else shown
    lamp('POINT', (-1.5, -2.2, 2.9), shadow_soft_size=0.15)
    return shown


def noise(tree: Any, scale: float = 3.0, kind: str = "Noise") -> Any:
    made = node(tree, f"ShaderNodeTex{kind}")
    made.inputs["Scale"].default_value = scale
    return made


def linked(kind: str, **sources: Callable[[Any], Any]) -> Wiring:
    """A closure whose sockets get what functions of the tree give."""

    def wire(tree: Any) -> Any:
        made = node(tree, kind)
        for name, source in sources.items():
            tree.links.new(source(tree), made.inputs[name.replace("_", " ")])
        return made

    return wire


def bumped(tree: Any) -> Any:
    bump = node(tree, "ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.3
    tree.links.new(noise(tree).outputs[0], bump.inputs["Height"])
    return bump.outputs[0]


def normal_map(space: str = 'TANGENT', strength: float = 0.6, convention: str = "") -> Wiring:
    def wire(tree: Any) -> Any:
        image = node(tree, "ShaderNodeTexImage")
        image.image = picture(2, 3, 2, is_data=True)
        made = node(tree, "ShaderNodeNormalMap", Strength=strength)
        made.space = space
        if convention and bpy.app.version >= (5, 0):
            made.convention = convention
        tree.links.new(image.outputs[0], made.inputs["Color"])
        return made.outputs[0]

    return wire


def mixed(tree: Any) -> Any:
    first, second = node(tree, DIFFUSE), node(tree, GLOSSY, Roughness=0.4)
    return node(tree, "ShaderNodeMixShader", noise(tree).outputs[0], first, second)


def grouped(tree: Any) -> Any:
    """One group twice, noisy in its own way each time."""
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    group.interface.new_socket("Scale", in_out='INPUT', socket_type='NodeSocketFloat')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    pattern, start = noise(group), node(group, "NodeGroupInput")
    group.links.new(start.outputs[0], pattern.inputs["Scale"])
    paint = node(group, DIFFUSE)
    group.links.new(pattern.outputs[1], paint.inputs["Color"])
    node(group, "NodeGroupOutput", paint)
    both: list[Any] = []
    for scale in (2.0, 5.0):
        both.append(node(tree, "ShaderNodeGroup"))
        both[-1].node_tree = group
        both[-1].inputs[0].default_value = scale
    half = node(tree, "ShaderNodeValue")
    half.outputs[0].default_value = 0.5
    return node(tree, "ShaderNodeMixShader", half, *both)


def displaced(build: Callable[[], Any]) -> Callable[[], None]:
    """What bends normals by displacement alone."""

    def bend() -> None:
        tree = build().node_tree
        height = node(tree, "ShaderNodeDisplacement", noise(tree).outputs[0], Scale=0.3)
        output = tree.get_output_node('CYCLES')
        tree.links.new(height.outputs[0], output.inputs["Displacement"])

    return bend


def leaf(tree: Any, alpha: bool = True) -> Any:
    """Principled with an image for its alpha, or transparent with one for its colour."""
    image = node(tree, "ShaderNodeTexImage")
    image.image = picture(3, 6, 6, alpha=True)
    made = node(tree, PRINCIPLED if alpha else TRANSPARENT)
    tree.links.new(image.outputs[alpha], made.inputs["Alpha" if alpha else "Color"])
    return made


def leaves(alpha: bool) -> None:
    """See-through squares behind each other, before the camera and before the lamp."""
    stage()
    mesh = with_uv(polygons("Leaf", *SQUARE))
    mesh.materials[0] = shows(lambda tree: leaf(tree, alpha))
    for k in range(2):
        place = {"location": (-0.4 - 0.2 * k, -0.9 + 0.6 * k, 0.9 + 0.4 * k)}
        add(f"Leaf {k}", mesh, **place, scale=(0.6, 0.6, 1), rotation_euler=(0.6, 0.2 * k, 0))
    lamp('POINT', (-1, -1.2, 2.9), shadow_soft_size=0.1)


def coated_glow(tree: Any) -> Any:
    glow = {
        "Emission_Strength": 0.4,
        "Emission_Color": (1, 0.6, 0.3, 1),
        "Base_Color": (0, 0, 0, 1),
    }
    return node(tree, PRINCIPLED, Coat_Weight=0.8, Coat_Tint=(0.4, 0.8, 0.6, 1), **glow)


def brushed(tree: Any) -> Any:
    tangent = node(tree, "ShaderNodeTangent")
    tangent.direction_type = 'UV_MAP'
    made = node(tree, GLOSSY, Roughness=0.5, Anisotropy=0.7)
    tree.links.new(tangent.outputs[0], made.inputs["Tangent"])
    return made


def cut() -> None:
    """A border that leaves a sliver of the ball in a dark tile."""
    scene(linked(PRINCIPLED, Normal=bumped))
    render = bpy.context.scene.render
    render.use_border, render.border_max_x, render.border_max_y = True, 0.9, 0.8


def bare() -> None:
    """Empty slots."""
    stage()
    for name in ("Box", "Floor"):
        bpy.data.objects[name].data.materials[0] = None
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


SCENES: dict[str, Callable[[], object]] = {
    "colour": lambda: scene(linked(DIFFUSE, Color=lambda t: noise(t).outputs[1])),
    "bump": lambda: scene(linked(PRINCIPLED, Normal=bumped)),
    "normal map": lambda: scene(linked(PRINCIPLED, Normal=normal_map())),
    "leaves": lambda: leaves(alpha=True),
    "roughness": lambda: scene(
        linked(GLOSSY, Roughness=lambda t: noise(t, 4.0, "Voronoi").outputs[0])
    ),
    "diffuse bump": lambda: scene(linked(DIFFUSE, Normal=bumped)),
    "displacement bump": displaced(lambda: scene(linked(DIFFUSE))),
    "displacement gloss": displaced(lambda: scene(linked(PRINCIPLED))),
    "mix": lambda: scene(mixed),
    "groups": lambda: scene(grouped),
    "coloured panes": lambda: leaves(alpha=False),
    "glow under a coat": lambda: scene(coated_glow, alone=True),
    "brushed": lambda: scene(brushed),
    "empty slots": bare,
    "border": cut,
}
QUICK = ("colour", "bump", "leaves")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=SLOW) for n in SCENES])
def test_surfaces_are_those_of_cycles(name: str) -> None:
    SCENES[name]()
    trees = {m.name: [(n.name, [s.is_linked for s in n.inputs]) for n in m.node_tree.nodes]
             for m in bpy.data.materials}  # fmt: skip
    sides = both_sides(SIZE, **({"ours": 64, "samples": 32} if name in QUICK else {}))
    assert not sides.scene.unsupported
    agrees(sides)
    for shown, nodes in trees.items():
        now = bpy.data.materials[shown].node_tree.nodes
        assert nodes == [(n.name, [s.is_linked for s in n.inputs]) for n in now]


def test_what_is_measured_is_known_where_the_camera_looks_first() -> None:
    """Behind glass and out of focus it is left out."""
    scene(linked(DIFFUSE, Color=lambda t: noise(t).outputs[1]))
    clear = polygons("Pane", *SQUARE)
    clear.materials[0] = material("Pane", TRANSPARENT)
    place = {"location": (0.5, -2.0, 1.5), "scale": (0.4, 0.4, 1), "rotation_euler": (1.2, 0, 0)}
    add("Pane", clear, **place)
    film = both_sides(SIZE, ours=2, seeds=1, samples=1).film
    (behind,) = film.excluded_by
    assert behind.feature == "Measured sockets behind transparent surfaces"
    assert 0.02 < film.excluded.mean() < 0.5
    bpy.context.scene.camera.data.dof.use_dof = True
    (unknown,) = both_sides(SIZE, ours=2, seeds=1, samples=1).scene.unsupported
    assert unknown.feature == "Diffuse BSDF"


# --- normals and tangents -------------------------------------------------------------------------


def tangent(direction: str, axis: str = 'X') -> Wiring:
    def wire(tree: Any) -> Any:
        made = node(tree, "ShaderNodeTangent")
        made.direction_type, made.axis = direction, axis
        return made.outputs[0]

    return wire


VECTORS: dict[str, Wiring] = {
    "tangent": normal_map(),
    "without a map": tangent('UV_MAP'),
    "tangent mirrored": normal_map(strength=1.6, convention='DIRECTX'),
    "object": normal_map('OBJECT', 1.0),
    "world": normal_map('WORLD', 0.5),
    "Blender's object": normal_map('BLENDER_OBJECT', 0.7),
    "Blender's world": normal_map('BLENDER_WORLD', 1.3),
    **{f"around {axis}": tangent('RADIAL', axis) for axis in "XYZ"},
    "along the map": tangent('UV_MAP'),
    "of the surface": lambda tree: node(tree, "ShaderNodeNewGeometry").outputs["Tangent"],
}


def test_normals_and_tangents_are_those_of_cycles() -> None:
    """A row of smooth balls and one of flat ones, some mirrored, that show 1 + 0.3 of a vector."""
    empty_scene()
    for k, (name, wire) in enumerate(VECTORS.items()):
        for row in (0, 1):
            mesh = sphere("Ball") if name == "without a map" else mapped("Ball")
            if row:
                mesh.shade_flat()
            mesh.materials[0] = created = material("Show", "ShaderNodeEmission")
            tree = created.node_tree
            shown = node(tree, "ShaderNodeVectorMath", wire(tree))
            shown.operation = 'MULTIPLY_ADD'
            shown.inputs[1].default_value, shown.inputs[2].default_value = (0.3,) * 3, (1.0,) * 3
            tree.links.new(shown.outputs[0], tree.nodes["Emission"].inputs["Color"])
            turned = {"scale": (0.5, (-1) ** k * 0.5, 0.7), "rotation_euler": (0.5, 0.3 * k, 0.2)}
            add("Ball", mesh, location=(k + 0.5, row + 0.5, 0), visible_diffuse=False, **turned)
    middle = (0.5 * len(VECTORS), 1.0)
    look_at((*middle, 0), (*middle, 5), type='ORTHO', ortho_scale=2.0 * middle[0])
    bpy.context.scene.camera.rotation_euler = (0, 0, 0)
    sides = both_sides((SIDE * len(VECTORS), 2 * SIDE), ours=32, seeds=2, samples=32)
    assert not sides.scene.unsupported
    off = np.abs(sides.film.radiance - sides.seeds[..., :3].mean(axis=0)).mean(axis=2) / 0.3
    each = off.reshape(2, SIDE, len(VECTORS), SIDE)
    median = np.median(each.transpose(2, 0, 1, 3).reshape(len(VECTORS), 2, -1), axis=2)
    wrong = {
        name: found for name, found in zip(VECTORS, median, strict=True) if found.max() > NORMALS
    }
    assert not wrong
