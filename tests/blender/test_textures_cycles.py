# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees against Cycles: each node alone, textured surfaces, and lamps with textures."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.textures.arithmetic import OF_NUMBERS, OF_VECTORS
from blender_rad.textures.colours import BLENDS

from .agreement import TILE, both_sides, lamp, look_at
from .reading import SQUARE, add, empty_scene, material, node, polygons, sphere
from .test_features_cycles import agrees, stage

COLUMNS = 12
NODE = 0.004  # of a tile's mean: what is left are edges of steps, which both sides sample
GOBO = 0.005  # of energy
Wiring = Callable[[Any, Any], Any]


def picture(seed: int = 1, width: int = 5, height: int = 4, **options: Any) -> Any:
    """An image of noise."""
    image = bpy.data.images.new(f"Noise {seed}", width, height, **options)
    pixels = np.random.default_rng(seed).random((height, width, 4))
    pixels[..., 3] = np.where(options.get("alpha"), pixels[..., 3], 1.0)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.update()
    return image


def textured(tree: Any, to: Any, place: Any, image: Any = None, **settings: Any) -> None:
    """Put an image that lies at a `place` into a socket."""
    found = node(tree, "ShaderNodeTexImage", *[place] * (place is not None))
    found.image = image or picture()
    for name, value in settings.items():
        setattr(found, name, value)
    tree.links.new(found.outputs[0], to)


def with_uv(mesh: Any) -> Any:
    """Give a square a UV map from 0 to 1."""
    layer = mesh.uv_layers.new(name="Map")
    corners = np.array([mesh.vertices[loop.vertex_index].co[:2] for loop in mesh.loops])
    layer.data.foreach_set("uv", (0.5 + 0.5 * corners).astype(np.float32).ravel())
    return mesh


# --- nodes ----------------------------------------------------------------------------------------


POLES = ("DIVIDE", "TANGENT", "TEXTURE")  # kept away from


def varied(kind: str, *names: str, output: int | str = 0, **settings: Any) -> Wiring:
    """A node whose inputs `names` vary over the square, all in their own way."""
    lift = 2.5 if any(value in POLES for value in settings.values()) else 0.7

    def wire(tree: Any, uv: Any) -> Any:
        made = tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(made, name, value)
        open_sockets = [s for s in made.inputs if s.enabled and (s.name in names or not names)]
        for k, socket in enumerate(open_sockets):
            place = node(tree, "ShaderNodeMapping", uv)
            place.inputs["Rotation"].default_value = (0.3 * k, 0.2, 0.7 + 0.9 * k)
            place.inputs["Location"].default_value = (lift, lift - 0.3 + 0.3 * k, lift)
            tree.links.new(place.outputs[0], socket)
        outputs = [s for s in made.outputs if s.enabled]
        named = [s for s in outputs if s.identifier == output]
        return named[0] if named else outputs[output]

    return wire


def ramp(interpolation: str) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        made = node(tree, "ShaderNodeValToRGB", uv)
        made.color_ramp.interpolation = interpolation
        made.color_ramp.elements.new(0.4).color = (0.9, 0.2, 0.1, 1)
        return made.outputs[0]

    return wire


def curve(kind: str, socket: str) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        made = tree.nodes.new(kind)
        for k, each in enumerate(made.mapping.curves):
            each.points.new(0.3 + 0.1 * k, 0.6)
        made.mapping.update()
        tree.links.new(uv.outputs[0], made.inputs[socket])
        return made.outputs[0]

    return wire


def blackbody(tree: Any, uv: Any) -> Any:
    return node(tree, "ShaderNodeBlackbody", Temperature=3400.0).outputs[0]


def source(kind: str, output: str, **settings: Any) -> Wiring:
    return varied(kind, "none", output=output, **settings)


def interpolated(interpolation: str, extension: str, **options: Any) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        place = node(tree, "ShaderNodeMapping", uv, Location=(-0.6, -0.7, 0), Scale=(2.3, 2.1, 1))
        image = picture(4, **options)
        made = node(tree, "ShaderNodeTexImage", place)
        made.image, made.interpolation, made.extension = image, interpolation, extension
        return made.outputs[0]

    return wire


NODES: dict[str, Wiring] = {
    **{f"math {o}": varied("ShaderNodeMath", operation=o) for o in OF_NUMBERS},
    **{f"vector {o}": varied("ShaderNodeVectorMath", operation=o) for o in [*OF_VECTORS, "SCALE"]},
    **{f"mix {b}": varied("ShaderNodeMix", data_type='RGBA', blend_type=b) for b in BLENDS},
    "mix float": varied("ShaderNodeMix", clamp_factor=False),
    "mix vector": varied("ShaderNodeMix", data_type='VECTOR', factor_mode='NON_UNIFORM'),
    **{
        f"range {t} {d}": varied("ShaderNodeMapRange", interpolation_type=t, data_type=d)
        for t in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")
        for d in ("FLOAT", "FLOAT_VECTOR")
    },
    **{
        f"mapping {t}": varied("ShaderNodeMapping", vector_type=t)
        for t in ("POINT", "TEXTURE", "VECTOR", "NORMAL")
    },
    **{
        f"gradient {t}": varied("ShaderNodeTexGradient", gradient_type=t)
        for t in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE")
    },
    **{f"ramp {i}": ramp(i) for i in ("LINEAR", "EASE", "CONSTANT", "B_SPLINE")},
    "rgb curves": curve("ShaderNodeRGBCurve", "Color"),
    "vector curves": curve("ShaderNodeVectorCurve", "Vector"),
    "float curve": curve("ShaderNodeFloatCurve", "Value"),
    "checker": varied("ShaderNodeTexChecker", "Vector"),
    "hue": varied("ShaderNodeHueSaturation"),
    "gamma": varied("ShaderNodeGamma"),
    "bright": varied("ShaderNodeBrightContrast"),
    "invert": varied("ShaderNodeInvert"),
    "grey": varied("ShaderNodeRGBToBW"),
    "clamp": varied("ShaderNodeClamp"),
    "clamp range": varied("ShaderNodeClamp", clamp_type='RANGE'),
    "normal": varied("ShaderNodeNormal", output="Dot"),
    **{
        f"{way} {mode}": varied(f"ShaderNode{way}Color", mode=mode, output=k)
        for way, k in (("Separate", 0), ("Separate", 1), ("Separate", 2), ("Combine", 0))
        for mode in ("RGB", "HSV")
    },
    "separate": varied("ShaderNodeSeparateXYZ", output="Y"),
    "combine": varied("ShaderNodeCombineXYZ"),
    "blackbody": blackbody,
    "fresnel": varied("ShaderNodeFresnel", "IOR"),
    "layer fresnel": varied("ShaderNodeLayerWeight", "Blend", output="Fresnel"),
    "layer facing": varied("ShaderNodeLayerWeight", "Blend", output="Facing"),
    **{f"geometry {o}": source("ShaderNodeNewGeometry", o) for o in ("Position", "Incoming")},
    **{f"side {o}": source("ShaderNodeNewGeometry", o) for o in ("Normal", "Parametric")},
    **{
        f"coordinate {o}": source("ShaderNodeTexCoord", o)
        for o in ("Generated", "Normal", "UV", "Object", "Reflection")
    },
    "uv map": source("ShaderNodeUVMap", "UV", uv_map="Map"),
    "uv as attribute": source("ShaderNodeAttribute", "Vector", attribute_name="Map"),
    "colours": source("ShaderNodeVertexColor", "Color", layer_name="Paint"),
    "colour of a name": source("ShaderNodeAttribute", "Fac", attribute_name="Paint"),
    "no attribute": source("ShaderNodeAttribute", "Color", attribute_name="None"),
    "location": source("ShaderNodeObjectInfo", "Location"),
    **{
        f"image {i} {e}": interpolated(i, e)
        for i, e in (
            ("Closest", "REPEAT"), ("Linear", "EXTEND"), ("Cubic", "MIRROR"),
            ("Linear", "CLIP"), ("Cubic", "CLIP"), ("Cubic", "REPEAT"), ("Linear", "MIRROR"),
        )
    },
    "image alpha": interpolated("Linear", "REPEAT", alpha=True),
    "image float": interpolated("Linear", "REPEAT", float_buffer=True),
    "image data": interpolated("Linear", "REPEAT", is_data=True),
    "no image": lambda tree, uv: node(tree, "ShaderNodeTexImage", uv).outputs[0],
}  # fmt: skip


def square(place: tuple[int, int], wire: Wiring) -> None:
    """A square that shows 1 + 0.3 of what a node gives."""
    mesh = with_uv(polygons("Square", *SQUARE))
    paint = mesh.color_attributes.new("Paint", 'BYTE_COLOR', 'POINT')
    colours = np.random.default_rng(3).random((4, 4)).astype(np.float32)
    paint.data.foreach_set("color", colours.ravel())
    mesh.materials[0] = created = material("Show", "ShaderNodeEmission")
    tree = created.node_tree
    uv = tree.nodes.new("ShaderNodeUVMap")
    shown = node(tree, "ShaderNodeVectorMath", wire(tree, uv))
    shown.operation = 'MULTIPLY_ADD'
    shown.inputs[1].default_value, shown.inputs[2].default_value = (0.3,) * 3, (1.0,) * 3
    glow = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    tree.links.new(shown.outputs[0], glow.inputs["Color"])
    x, y = place
    add("Square", mesh, location=(x + 0.5, y + 0.5, 0), scale=(0.5, 0.5, 1), visible_diffuse=False)


@pytest.mark.feature("each node: tile 0.4 %", area="Shader nodes", rows=NODES)
@pytest.mark.slow
def test_every_node_is_that_of_cycles() -> None:
    """A square a node, a tile a square, seen from above."""
    empty_scene()
    rows = -(-len(NODES) // COLUMNS)
    for k, wire in enumerate(NODES.values()):
        square((k % COLUMNS, rows - 1 - k // COLUMNS), wire)
    middle = (0.5 * COLUMNS, 0.5 * rows)
    look_at((*middle, 0), (*middle, 5), type='ORTHO', ortho_scale=float(max(COLUMNS, rows)))
    bpy.context.scene.camera.rotation_euler = (0, 0, 0)
    sides = both_sides((TILE * COLUMNS, TILE * rows), ours=32, seeds=2, samples=32)
    assert not sides.scene.unsupported
    off = dict(zip(NODES, np.abs(sides.tiles()[0]), strict=False))
    assert not {name: each for name, each in off.items() if each > NODE}


# --- surfaces -------------------------------------------------------------------------------------


def floor(**image: Any) -> None:
    stage()
    paint = with_uv(bpy.data.objects["Floor"].data).materials[0].node_tree
    diffuse = next(n for n in paint.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    textured(paint, diffuse.inputs["Color"], None, picture(2, **image))
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


def panel(*, one_sided: bool = False, reflects: bool = False) -> None:
    """A textured square that glows, from its back alone where it is one-sided."""
    stage()
    mesh = with_uv(polygons("Panel", *SQUARE))
    mesh.materials[0] = created = material("Glow", "ShaderNodeEmission", Strength=20)
    tree = created.node_tree
    glow = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    textured(tree, glow.inputs["Color"], None, picture(4), interpolation='Closest')
    if one_sided:
        side = tree.nodes.new("ShaderNodeNewGeometry")
        dark = node(tree, "ShaderNodeBsdfDiffuse") if reflects else node(tree, "ShaderNodeEmission")
        dark.inputs[0].default_value = (0.3, 0.3, 0.3, 1) if reflects else (0, 0, 0, 1)
        mixed = node(tree, "ShaderNodeMixShader", side.outputs["Backfacing"], dark, glow)
        tree.links.new(mixed.outputs[0], tree.get_output_node('CYCLES').inputs[0])
    place = {"location": (-0.3, 0.3, 1.6), "rotation_euler": (0.5, 0.2, 0.3)}
    add("Panel", mesh, **place, scale=(0.5, 0.4, 1))


def projected(projection: str, blend: float = 0.0) -> Callable[[], None]:
    """A turned box, and a ball, with an image projected on them."""

    def build() -> None:
        box = stage(rotation_euler=(0.3, 0.2, 0.5))
        ball = add("Ball", sphere("Ball"), location=(-0.6, 0.1, 0.5), scale=(0.5, 0.4, 0.5))
        for each in (box, ball):
            tree = each.data.materials[0].node_tree
            diffuse = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
            place = tree.nodes.new(COORDINATE).outputs["Generated"]
            settings = {"projection": projection, "projection_blend": blend}
            textured(tree, diffuse.inputs["Color"], place, picture(3), **settings)
        lamp('AREA', (-1, -1.2, 2.5))

    return build


def tiled() -> None:
    """Four squares on tiles 1001, 1002, 1011 and 1012, of which the third has no picture."""
    stage()
    pattern = Path(bpy.app.tempdir) / "tile.<UDIM>.png"
    numbers = (1001, 1002, 1012)
    for number in numbers:
        one = picture(number)
        one.file_format, one.filepath_raw = 'PNG', str(pattern).replace("<UDIM>", str(number))
        one.save()
    image = bpy.data.images.load(str(pattern).replace("<UDIM>", "1001"))
    image.source, image.filepath = 'TILED', str(pattern)
    for number in numbers[1:]:
        image.tiles.new(number)
    paint = bpy.data.objects["Floor"].data.materials[0]
    diffuse = next(n for n in paint.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    textured(paint.node_tree, diffuse.inputs["Color"], None, image)
    for k in range(4):
        column, row = k % 2, k // 2
        mesh = with_uv(polygons(f"Square {k}", *SQUARE))
        mesh.materials[0] = paint
        for each in mesh.uv_layers[0].data:
            each.uv = (column + 0.9 * each.uv[0], row + 0.1 + 0.8 * each.uv[1])
        add(f"Square {k}", mesh, location=(2 * column - 1, 2 * row - 1, 0.01))
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


def deformed() -> None:
    """A box that is bent, with colours by where its vertices were."""
    box = stage(scale=(0.4, 0.4, 0.6))
    bend = box.modifiers.new("Bend", 'SIMPLE_DEFORM')
    bend.deform_method, bend.angle, bend.deform_axis = 'TWIST', 1.5, 'Z'
    for kind in ("Simple", "Moved"):
        cut = box.modifiers.new(kind, 'SUBSURF')
        cut.subdivision_type, cut.render_levels = 'SIMPLE', 1
    box.modifiers.new("Wave", 'CAST').factor = 0.6
    tree = box.data.materials[0].node_tree
    diffuse = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    place = tree.nodes.new(COORDINATE).outputs["Generated"]
    textured(tree, diffuse.inputs["Color"], place, picture(3))
    lamp('AREA', (-1, -1.2, 2.5))


SLOW = pytest.mark.slow


@pytest.mark.feature("picture: tiles 1 %, energy 0.2 %", area="Textured surfaces")
@pytest.mark.parametrize(
    ("build", "shading"),
    [
        pytest.param(floor, "full", id="albedo"),
        pytest.param(panel, "full", id="emission"),
        pytest.param(deformed, "full", id="generated-before-modifiers"),
        pytest.param(projected('BOX', 0.4), "full", id="box-projection"),
        pytest.param(tiled, "full", id="udim-tiles"),
        pytest.param(projected('BOX'), "full", id="box-without-blend", marks=SLOW),
        pytest.param(projected('SPHERE'), "full", id="sphere-projection", marks=SLOW),
        pytest.param(projected('TUBE'), "full", id="tube-projection", marks=SLOW),
        pytest.param(lambda: panel(one_sided=True), "full", id="one-sided", marks=SLOW),
        pytest.param(
            lambda: panel(one_sided=True, reflects=True), "full", id="one-diffuse", marks=SLOW
        ),
        pytest.param(lambda: panel(one_sided=True, reflects=True), "clay", id="clay", marks=SLOW),
    ],
)
def test_textured_surfaces_are_those_of_cycles(build: Callable[[], None], shading: Any) -> None:
    build()
    noisy = build.__name__ == "<lambda>"  # one-sided
    more = {"ours": 384, "seeds": 12, "samples": 128} if noisy else {}
    agrees(both_sides((48, 32), shading=shading, **more))


# --- lamps ----------------------------------------------------------------------------------------


def at(kind: str, output: str, **settings: Any) -> Wiring:
    """A lamp's colour from an image that lies at an output of a node."""

    def wire(tree: Any, glow: Any) -> None:
        place = tree.nodes.new(kind).outputs[output]
        textured(tree, glow.inputs["Color"], place, picture(7), **settings)

    return wire


def falls(output: str, smooth: float) -> Wiring:
    def wire(tree: Any, glow: Any) -> None:
        fall = node(tree, "ShaderNodeLightFalloff", Strength=0.7, Smooth=smooth)
        tree.links.new(fall.outputs[output], glow.inputs["Strength"])

    return wire


COORDINATE, GEOMETRY = "ShaderNodeTexCoord", "ShaderNodeNewGeometry"
SOFT = {"shadow_soft_size": 0.2}
BALL = {"shadow_soft_size": 0.3, "use_soft_falloff": False}
LAMPS: dict[str, tuple[str, dict[str, Any], Wiring]] = {
    "gobo": ('SPOT', {"shadow_soft_size": 0, "spot_size": 1.2}, at(COORDINATE, "UV")),
    "point": ('POINT', {"shadow_soft_size": 0}, at(COORDINATE, "Normal")),
    "panel": ('AREA', {"shape": 'RECTANGLE', "size": 1, "size_y": 0.5}, at(COORDINATE, "UV")),
    "fall": ('POINT', SOFT, falls("Linear", 0.0)),
    "gobo-soft": ('SPOT', {**SOFT, "spot_size": 1.2}, at(COORDINATE, "UV", extension='CLIP')),
    "gobo-ball": ('SPOT', {**BALL, "spot_size": 1.2}, at(COORDINATE, "UV")),
    "soft": ('POINT', {"shadow_soft_size": 0.4}, at(COORDINATE, "Normal")),
    "ball": ('POINT', BALL, at(COORDINATE, "Normal")),
    "ball-uv": ('POINT', BALL, at(COORDINATE, "UV")),
    "incoming": ('POINT', {"shadow_soft_size": 0.4}, at(GEOMETRY, "Incoming")),
    "position": ('POINT', {"shadow_soft_size": 0.4}, at(GEOMETRY, "Position")),
    "generated": ('POINT', {"shadow_soft_size": 0.3}, at(COORDINATE, "Generated")),
    "disc": ('AREA', {"shape": 'DISK', "size": 1}, at(GEOMETRY, "Parametric")),
    "beam": ('AREA', {"size": 1, "spread": 2.0}, at(COORDINATE, "Object")),
    "sun": ('SUN', {"angle": 0.8}, at(COORDINATE, "UV")),
    "sun-position": ('SUN', {"angle": 0.8}, at(GEOMETRY, "Position")),
    "fall-area": ('AREA', {}, falls("Constant", 0.5)),
    "fall-sun": ('SUN', {}, falls("Constant", 2.0)),
}
QUICK = ("gobo", "point", "panel", "fall")


@pytest.mark.feature("picture: tiles 1 %, energy 0.5 %", area="Lights with nodes")
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=SLOW) for n in LAMPS])
def test_lamps_with_trees_are_those_of_cycles(name: str) -> None:
    kind, properties, wire = LAMPS[name]
    stage()
    placed = lamp(kind, (-0.6, -1, 2.6), (0.4, 0.2, 0.3), **properties)
    placed.scale = (1, 1.3, 0.8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        placed.data.use_nodes = True
    tree = placed.data.node_tree
    wire(tree, next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission"))
    sides = both_sides((48, 32), seeds=4)
    agrees(sides)
    whole, error = sides.energy()
    assert abs(whole) < GOBO and error < GOBO / 2
