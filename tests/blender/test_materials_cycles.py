# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees of surfaces against Cycles: what is measured, bent, mixed, grouped and see-through."""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from .agreement import (
    FINE,
    PICTURE,
    agrees,
    both_sides,
    cases,
    lamp,
    look_at,
    square,
    stage,
    tiles_of,
)
from .reading import CUBE, add, empty_scene, material, node, polygons, put, shows, sphere
from .test_textures_cycles import lit_by, picture, with_uv

DIFFUSE, GLOSSY = "BsdfDiffuse", "BsdfAnisotropic"
PRINCIPLED, TRANSPARENT = "BsdfPrincipled", "BsdfTransparent"
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


def scene(wire: Wiring, *, alone: bool = False) -> Any:
    """A ball of a material on a floor, of the same unless the ball is `alone` in it."""
    box = stage(location=(0.1, 0.0, 0.8), scale=(0.8,) * 3)
    box.data = mapped("Ball")
    box.data.materials[0] = shown = material("Shown", wire)
    floor = with_uv(bpy.data.objects["Floor"].data)
    floor.materials[0] = material("Plain", DIFFUSE) if alone else shown
    lamp('POINT', (-1.5, -2.2, 2.9), shadow_soft_size=0.15)
    return shown


def noise(tree: Any, scale: float = 3.0, kind: str = "Noise") -> Any:
    return node(tree, f"Tex{kind}", Scale=scale)


def checks(tree: Any) -> Any:
    return noise(tree, 6.0, "Checker")


def closure(kind: str, socket: str = "", source: Wiring = noise) -> Wiring:
    """A closure, of which a socket gets what a function of the tree gives."""

    def wire(tree: Any) -> Any:
        made = node(tree, kind)
        if socket:
            given = source(tree)
            tree.links.new(getattr(given, "outputs", [given])[0], made.inputs[socket])
        return made

    return wire


def bumped(tree: Any, height: Wiring = noise) -> Any:
    bump = node(tree, "Bump", Distance=0.3)
    tree.links.new(height(tree).outputs[0], bump.inputs["Height"])
    return bump


def normal_map(space: str = 'TANGENT', strength: float = 0.6, convention: str = "") -> Wiring:
    def wire(tree: Any) -> Any:
        image = node(tree, "TexImage", image=picture(2, 3, 2, is_data=True))
        made = node(tree, "NormalMap", Strength=strength, space=space)
        if convention and bpy.app.version >= (5, 0):
            made.convention = convention
        tree.links.new(image.outputs[0], made.inputs["Color"])
        return made

    return wire


def tangent(direction: str, axis: str = 'X') -> Wiring:
    return lambda tree: node(tree, "Tangent", direction_type=direction, axis=axis)


def mixed(tree: Any) -> Any:
    first, second = node(tree, DIFFUSE), node(tree, GLOSSY, Roughness=0.4)
    return node(tree, "MixShader", noise(tree), first, second)


def grouped(tree: Any) -> Any:
    """One group twice, noisy in its own way each time."""
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    group.interface.new_socket("Scale", in_out='INPUT', socket_type='NodeSocketFloat')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    pattern = node(group, "TexNoise")
    group.links.new(node(group, "NodeGroupInput").outputs[0], pattern.inputs["Scale"])
    paint = node(group, DIFFUSE)
    group.links.new(pattern.outputs[1], paint.inputs["Color"])
    node(group, "NodeGroupOutput", paint)
    both = [node(tree, "Group", node_tree=group, Scale=scale) for scale in (2.0, 5.0)]
    return node(tree, "MixShader", 0.5, *both)


def displaced(build: Callable[[], Any]) -> None:
    """What bends normals by displacement alone."""
    tree = build().node_tree
    shows(tree, node(tree, "Displacement", noise(tree), Scale=0.3), "Displacement")


def leaf(tree: Any, alpha: bool = True) -> Any:
    """Principled with an image for its alpha, or transparent with one for its colour."""
    image = node(tree, "TexImage", image=picture(3, 6, 6, alpha=True))
    made = node(tree, PRINCIPLED if alpha else TRANSPARENT)
    tree.links.new(image.outputs[alpha], made.inputs["Alpha" if alpha else "Color"])
    return made


def leaves(alpha: bool) -> None:
    """See-through squares behind each other, before the camera and before the lamp."""
    stage()
    shown = material("Shown", partial(leaf, alpha=alpha))
    for k in range(2):
        place = {"location": (-0.4 - 0.2 * k, -0.9 + 0.6 * k, 0.9 + 0.4 * k)}
        turned = {"scale": (0.6, 0.6, 1), "rotation_euler": (0.6, 0.2 * k, 0)}
        with_uv(square(f"Leaf {k}", shown, **place, **turned).data)
    lamp('POINT', (-1, -1.2, 2.9), shadow_soft_size=0.1)


def coated_glow(tree: Any) -> Any:
    glow = {"Emission_Strength": 0.4, "Emission_Color": (1, 0.6, 0.3), "Base_Color": (0, 0, 0)}
    return node(tree, PRINCIPLED, Coat_Weight=0.8, Coat_Tint=(0.4, 0.8, 0.6), **glow)


def brushed(tree: Any) -> Any:
    made = node(tree, GLOSSY, Roughness=0.5, Anisotropy=0.7)
    tree.links.new(tangent('UV_MAP')(tree).outputs[0], made.inputs["Tangent"])
    return made


def cut() -> None:
    """A border that leaves a sliver of the ball in a dark tile."""
    scene(closure(PRINCIPLED, "Normal", bumped))
    put(bpy.context.scene.render, use_border=True, border_max_x=0.9, border_max_y=0.8)


def bare() -> None:
    """Empty slots."""
    stage()
    for name in ("Box", "Floor"):
        bpy.data.objects[name].data.materials[0] = None
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


NOISY = closure(DIFFUSE, "Color", lambda tree: noise(tree).outputs[1])
SCENES: dict[str, Callable[[], object]] = {
    "colour": partial(scene, NOISY),
    "bump": partial(scene, closure(PRINCIPLED, "Normal", bumped)),
    "steps": partial(scene, closure(GLOSSY, "Normal", partial(bumped, height=checks))),
    "normal map": partial(scene, closure(PRINCIPLED, "Normal", normal_map())),
    "leaves": partial(leaves, alpha=True),
    "roughness": partial(scene, closure(GLOSSY, "Roughness", lambda t: noise(t, 4.0, "Voronoi"))),
    "diffuse bump": partial(scene, closure(DIFFUSE, "Normal", bumped)),
    "displacement bump": partial(displaced, partial(scene, closure(DIFFUSE))),
    "displacement gloss": partial(displaced, partial(scene, closure(PRINCIPLED))),
    "mix": partial(scene, mixed),
    "groups": partial(scene, grouped),
    "coloured panes": partial(leaves, alpha=False),
    "glow under a coat": partial(scene, coated_glow, alone=True),
    "brushed": partial(scene, brushed),
    "empty slots": bare,
    "border": cut,
}
QUICK = ("colour", "steps", "leaves", "empty slots")


def wiring() -> dict[str, Any]:
    return {
        m.name: [(n.name, [s.is_linked for s in n.inputs]) for n in m.node_tree.nodes]
        for m in bpy.data.materials
    }


@pytest.mark.feature(PICTURE, area="Materials")
@pytest.mark.parametrize("name", cases(SCENES, QUICK))
def test_surfaces_are_those_of_cycles(name: str) -> None:
    SCENES[name]()
    before = wiring()
    sides = both_sides(**({"seeds": 8, "samples": 32} if name in QUICK else FINE))
    assert not sides.scene.unsupported
    agrees(sides)
    assert wiring().items() >= before.items()


def test_what_is_measured_is_known_where_the_camera_looks_first() -> None:
    """Behind glass and out of focus it is left out."""
    scene(NOISY)
    place = {"location": (0.5, -2.0, 1.5), "scale": (0.4, 0.4, 1), "rotation_euler": (1.2, 0, 0)}
    square("Pane", material("Pane", TRANSPARENT), **place)
    film = both_sides(ours=2, seeds=1, samples=1).film
    (behind,) = film.excluded_by
    assert behind.feature == "Measured sockets behind transparent surfaces"
    assert 0.02 < film.excluded.mean() < 0.5
    bpy.context.scene.camera.data.dof.use_dof = True
    (unknown,) = both_sides(ours=2, seeds=1, samples=1).scene.unsupported
    assert unknown.feature == "Diffuse BSDF"


# --- materials one by one -------------------------------------------------------------------------


def group_of(source: Wiring, **inputs: Any) -> Any:
    """A group of Lambert whose colour is what a function of its tree gives."""
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    for name in inputs:
        group.interface.new_socket(name, in_out='INPUT', socket_type='NodeSocketColor')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    node(group, "NodeGroupOutput", node(group, DIFFUSE, source(group)))
    return group


def painted(tree: Any, **muted: bool) -> Any:
    """A group through a reroute, whose colour has a link that may be muted, less muted light."""
    group = group_of(lambda inner: node(inner, "NodeGroupInput"), Tint=RED)
    made = node(tree, "Group", node_tree=group, Tint=RED)
    rgb = node(tree, "RGB")
    rgb.outputs[0].default_value = (0.1, 0.2, 0.3, 1)
    tree.links.new(rgb.outputs[0], made.inputs[0]).is_muted = "link" in muted
    shown = node(tree, "AddShader", node(tree, "NodeReroute", made), node(tree, GLOW))
    shown.mute = "node" in muted
    return shown


def mix(first: str, second: str, factor: float | None = None, **values: Any) -> Wiring:
    """A mix of two closures, by the side that is seen unless by a number."""

    def wire(tree: Any) -> Any:
        side = node(tree, "NewGeometry").outputs["Backfacing"] if factor is None else factor
        return node(tree, "MixShader", side, node(tree, first), node(tree, second, **values))

    return wire


def bare(tree: Any) -> Any:
    """Nothing: a node that is linked to no output."""
    return put(node(tree, "Emission"), mute=True)


RED, GLOW = (0.8, 0.2, 0.1), "Emission"
BRIGHT = {"Emission_Strength": 2.0, "Emission_Color": (0.5, 1, 0.2)}
FLAT: dict[str, Wiring] = {
    "lambert": partial(node, kind=DIFFUSE, Color=RED),
    "rough diffuse": partial(node, kind=DIFFUSE, Roughness=0.5),
    "bent diffuse": closure(DIFFUSE, "Normal", partial(node, kind="Bump")),
    "light": partial(node, kind=GLOW, Color=(1, 0.5, 0.25), Strength=4),
    "no light": partial(node, kind=GLOW, Strength=0),
    "no node": bare,
    "mix": mix(DIFFUSE, GLOW, 0.25),
    "mix below": mix(DIFFUSE, GLOW, -3.0),
    "mix above": mix(DIFFUSE, GLOW, 7.0),
    "light behind": mix(DIFFUSE, GLOW),
    "gloss": mix(DIFFUSE, GLOSSY, 0.25, Roughness=0.3),
    "half clear": mix(DIFFUSE, TRANSPARENT, 0.3),
    "clear behind": mix(DIFFUSE, TRANSPARENT, Color=RED),
    "glass": partial(node, kind="BsdfGlass"),
    "sum": lambda tree: node(tree, "AddShader", node(tree, DIFFUSE), node(tree, GLOW)),
    "group": painted,
    "muted link": partial(painted, link=True),
    "muted node": partial(painted, node=True),
    "noise in a group": lambda tree: node(tree, "Group", node_tree=group_of(noise)),
    "principled": partial(node, kind=PRINCIPLED),
    "alpha": partial(node, kind=PRINCIPLED, Alpha=0.5),
    "glow": partial(node, kind=PRINCIPLED, **BRIGHT),
    "glow of a coat": partial(node, kind=PRINCIPLED, **BRIGHT, Coat_Weight=1.0),
    "glow and alpha": partial(node, kind=PRINCIPLED, **BRIGHT, Alpha=0.25),
}
TILE_OFF, TILE_NOISE = 0.002, 0.01


@pytest.mark.feature("a tile each, from both sides, 0.2 %", area="Materials", rows=FLAT)
@pytest.mark.parametrize("shading", ["full", "clay"])
def test_materials_are_those_of_cycles(shading: Any) -> None:
    """Squares above a floor under a sun."""

    def show(name: str, place: Any) -> None:
        wire, back = FLAT[name.removesuffix(" (back)")], name.endswith(" (back)")
        turned = {"rotation_euler": (0, np.pi * back, 0), "scale": (0.5, 0.5, 1)}
        square(name, material(name, wire), location=place, **turned, visible_diffuse=False)

    empty_scene()
    square("Floor", location=(0, 0, -1), scale=(50, 50, 1))
    lamp('SUN', (0.3, 0.2, 1), angle=0.0)
    names = [name + side for name in FLAT for side in ("", " (back)")]
    off = tiles_of(names, show, noise=TILE_NOISE, shading=shading)
    assert not {name: each for name, each in off.items() if each > TILE_OFF}


# --- normals and tangents -------------------------------------------------------------------------


VECTORS: dict[str, Wiring] = {
    "tangent": normal_map(),
    "without a map": tangent('UV_MAP'),
    "map in one point": normal_map(),
    "across the seam": tangent('UV_MAP'),
    "tangent mirrored": normal_map(strength=1.6, convention='DIRECTX'),
    "object": normal_map('OBJECT', 1.0),
    "world": normal_map('WORLD', 0.5),
    "Blender's object": normal_map('BLENDER_OBJECT', 0.7),
    "Blender's world": normal_map('BLENDER_WORLD', 1.3),
    **{f"around {axis}": tangent('RADIAL', axis) for axis in "XYZ"},
    "along the map": tangent('UV_MAP'),
    "of the surface": lambda tree: node(tree, "NewGeometry").outputs["Tangent"],
}


def show(name: str, wire: Wiring, column: int, row: int) -> None:
    """A ball, flat in the upper row, that shows what a node gives."""
    seam = name == "across the seam"
    mesh = sphere("Ball") if name == "without a map" else mapped("Ball")
    mesh = polygons("Box", *CUBE) if seam else mesh
    if row:
        mesh.shade_flat()
    if name == "map in one point":
        mesh.uv_layers[0].uv.foreach_set("vector", np.zeros(2 * len(mesh.loops), np.float32))
    mesh.materials[0] = material("Show", lambda tree: lit_by(tree, wire(tree)))
    place = {"location": (column + 0.5, row + 0.5, 0), "scale": (0.5, (-1) ** column * 0.5, 0.7)}
    turn = (0.5 + seam, 0.3 * column * (not seam), 0.2)
    add("Ball", mesh, visible_diffuse=False, **place, rotation_euler=turn)


def test_normals_and_tangents_are_those_of_cycles() -> None:
    """A row of smooth balls and one of flat ones, some mirrored, that show 1 + 0.3 of a vector."""
    empty_scene()
    for column, (name, wire) in enumerate(VECTORS.items()):
        for row in (0, 1):
            show(name, wire, column, row)
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
