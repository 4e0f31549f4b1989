# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees against Cycles: each node alone, textured surfaces, and lamps with textures."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.textures.arithmetic import OF_NUMBERS, OF_VECTORS
from blender_rad.textures.colours import BLENDS

from .agreement import FINE, PICTURE, agrees, both_sides, cases, lamp, square, stage, tiles_of
from .reading import add, empty_scene, material, node, put, sphere, with_nodes

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


def textured(tree: Any, to: Any, place: Any, image: Any, **settings: Any) -> None:
    """Put an image that lies at a `place`, or by the UV map, into a socket."""
    found = node(tree, "TexImage", *[place] * (place is not None), image=image, **settings)
    tree.links.new(found.outputs[0], to)


def colour_of(thing: Any) -> tuple[Any, Any]:
    """Return the node tree of what is of Lambert, and the socket of its colour."""
    tree = thing.data.materials[0].node_tree
    return tree, tree.nodes["Diffuse BSDF"].inputs["Color"]


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
        made = put(node(tree, kind), **settings)
        open_sockets = [s for s in made.inputs if s.enabled and (s.name in names or not names)]
        for k, socket in enumerate(open_sockets):
            place = node(tree, "Mapping", uv)
            place.inputs["Rotation"].default_value = (0.3 * k, 0.2, 0.7 + 0.9 * k)
            place.inputs["Location"].default_value = (lift, lift - 0.3 + 0.3 * k, lift)
            tree.links.new(place.outputs[0], socket)
        outputs = [s for s in made.outputs if s.enabled]
        named = [s for s in outputs if s.identifier == output]
        return named[0] if named else outputs[output]

    return wire


def ramp(interpolation: str) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        made = node(tree, "ValToRGB", uv)
        made.color_ramp.interpolation = interpolation
        made.color_ramp.elements.new(0.4).color = (0.9, 0.2, 0.1, 1)
        return made

    return wire


def curve(kind: str, socket: str) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        made = node(tree, kind)
        for k, each in enumerate(made.mapping.curves):
            each.points.new(0.3 + 0.1 * k, 0.6)
        made.mapping.update()
        tree.links.new(uv.outputs[0], made.inputs[socket])
        return made

    return wire


def source(kind: str, output: str, **settings: Any) -> Wiring:
    return varied(kind, "none", output=output, **settings)


def interpolated(interpolation: str, extension: str, **options: Any) -> Wiring:
    def wire(tree: Any, uv: Any) -> Any:
        place = node(tree, "Mapping", uv, Location=(-0.6, -0.7, 0), Scale=(2.3, 2.1, 1))
        settings = {"interpolation": interpolation, "extension": extension}
        return node(tree, "TexImage", place, image=picture(4, **options), **settings)

    return wire


NODES: dict[str, Wiring] = {
    **{f"math {o}": varied("Math", operation=o) for o in OF_NUMBERS},
    **{f"vector {o}": varied("VectorMath", operation=o) for o in [*OF_VECTORS, "SCALE"]},
    **{f"mix {b}": varied("Mix", data_type='RGBA', blend_type=b) for b in BLENDS},
    "mix float": varied("Mix", clamp_factor=False),
    "mix vector": varied("Mix", data_type='VECTOR', factor_mode='NON_UNIFORM'),
    **{
        f"range {t} {d}": varied("MapRange", interpolation_type=t, data_type=d)
        for t in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")
        for d in ("FLOAT", "FLOAT_VECTOR")
    },
    **{
        f"mapping {t}": varied("Mapping", vector_type=t)
        for t in ("POINT", "TEXTURE", "VECTOR", "NORMAL")
    },
    **{
        f"gradient {t}": varied("TexGradient", gradient_type=t)
        for t in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE")
    },
    **{f"ramp {i}": ramp(i) for i in ("LINEAR", "EASE", "CONSTANT", "B_SPLINE")},
    "rgb curves": curve("RGBCurve", "Color"),
    "vector curves": curve("VectorCurve", "Vector"),
    "float curve": curve("FloatCurve", "Value"),
    "checker": varied("TexChecker", "Vector"),
    "hue": varied("HueSaturation"),
    "gamma": varied("Gamma"),
    "bright": varied("BrightContrast"),
    "invert": varied("Invert"),
    "grey": varied("RGBToBW"),
    "clamp": varied("Clamp"),
    "clamp range": varied("Clamp", clamp_type='RANGE'),
    "normal": varied("Normal", output="Dot"),
    **{
        f"{way} {mode}": varied(f"{way}Color", mode=mode, output=k)
        for way, k in (("Separate", 0), ("Separate", 1), ("Separate", 2), ("Combine", 0))
        for mode in ("RGB", "HSV")
    },
    "separate": varied("SeparateXYZ", output="Y"),
    "combine": varied("CombineXYZ"),
    "blackbody": lambda tree, _: node(tree, "Blackbody", Temperature=3400.0),
    "fresnel": varied("Fresnel", "IOR"),
    "layer fresnel": varied("LayerWeight", "Blend", output="Fresnel"),
    "layer facing": varied("LayerWeight", "Blend", output="Facing"),
    **{f"geometry {o}": source("NewGeometry", o) for o in ("Position", "Incoming")},
    **{f"side {o}": source("NewGeometry", o) for o in ("Normal", "Parametric")},
    **{
        f"coordinate {o}": source("TexCoord", o)
        for o in ("Generated", "Normal", "UV", "Object", "Reflection")
    },
    "uv map": source("UVMap", "UV", uv_map="Map"),
    "uv as attribute": source("Attribute", "Vector", attribute_name="Map"),
    "colours": source("VertexColor", "Color", layer_name="Paint"),
    "colour of a name": source("Attribute", "Fac", attribute_name="Paint"),
    "no attribute": source("Attribute", "Color", attribute_name="None"),
    "location": source("ObjectInfo", "Location"),
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
    "no image": lambda tree, uv: node(tree, "TexImage", uv),
}  # fmt: skip


def lit_by(tree: Any, value: Any) -> Any:
    """Emission of 1 + 0.3 of what a node gives."""
    scaled = node(tree, "VectorMath", value, operation='MULTIPLY_ADD')
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.3,) * 3, (1.0,) * 3
    return node(tree, "Emission", scaled)


def show(name: str, place: Any) -> None:
    """A square that shows what a node gives."""
    wire = NODES[name]
    shown = material("Show", lambda tree: lit_by(tree, wire(tree, node(tree, "UVMap"))))
    at = {"location": place, "scale": (0.5, 0.5, 1)}
    made = square("Square", shown, **at, visible_diffuse=False)
    paint = with_uv(made.data).color_attributes.new("Paint", 'BYTE_COLOR', 'POINT')
    colours = np.random.default_rng(3).random((4, 4)).astype(np.float32)
    paint.data.foreach_set("color", colours.ravel())


@pytest.mark.feature("each node: tile 0.4 %", area="Shader nodes", rows=NODES)
@pytest.mark.slow
def test_every_node_is_that_of_cycles() -> None:
    empty_scene()
    off = tiles_of(tuple(NODES), show, noise=NODE)
    assert not {name: each for name, each in off.items() if each > NODE}


# --- surfaces -------------------------------------------------------------------------------------


def floor() -> None:
    stage()
    made = bpy.data.objects["Floor"]
    with_uv(made.data)
    textured(*colour_of(made), None, picture(2))
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


def panel(*, one_sided: bool = False, reflects: bool = False) -> None:
    """A textured square that glows, from its back alone where it is one-sided."""

    def shown(tree: Any) -> Any:
        glows = node(tree, "Emission", Strength=20)
        textured(tree, glows.inputs["Color"], None, picture(4), interpolation='Closest')
        if not one_sided:
            return glows
        side = node(tree, "NewGeometry").outputs["Backfacing"]
        grey = (0.3,) * 3 if reflects else (0.0,) * 3
        dark = node(tree, "BsdfDiffuse" if reflects else "Emission", Color=grey)
        return node(tree, "MixShader", side, dark, glows)

    stage()
    place = {"location": (-0.3, 0.3, 1.6), "rotation_euler": (0.5, 0.2, 0.3)}
    with_uv(square("Panel", material("Glow", shown), **place, scale=(0.5, 0.4, 1)).data)


def laid(thing: Any, **settings: Any) -> None:
    """Put an image on a thing by its generated coordinates."""
    tree, colour = colour_of(thing)
    place = node(tree, "TexCoord").outputs["Generated"]
    textured(tree, colour, place, picture(3), **settings)


def projected(projection: str, blend: float = 0.0) -> None:
    """A turned box, and a ball, with an image projected on them."""
    box = stage(rotation_euler=(0.3, 0.2, 0.5))
    ball = add("Ball", sphere("Ball"), location=(-0.6, 0.1, 0.5), scale=(0.5, 0.4, 0.5))
    for each in (box, ball):
        laid(each, projection=projection, projection_blend=blend)
    lamp('AREA', (-1, -1.2, 2.5))


def tiled() -> None:
    """Four squares on tiles 1001, 1002, 1011 and 1012, of which the third has no picture."""
    stage()
    pattern = Path(bpy.app.tempdir) / "tile.<UDIM>.png"
    numbers = (1001, 1002, 1012)
    for number in numbers:
        path = str(pattern).replace("<UDIM>", str(number))
        put(picture(number), file_format='PNG', filepath_raw=path).save()
    image = bpy.data.images.load(str(pattern).replace("<UDIM>", "1001"))
    image.source, image.filepath = 'TILED', str(pattern)
    for number in numbers[1:]:
        image.tiles.new(number)
    ground = bpy.data.objects["Floor"]
    textured(*colour_of(ground), None, image)
    for k in range(4):
        column, row = k % 2, k // 2
        place = {"location": (2 * column - 1, 2 * row - 1, 0.01)}
        mesh = with_uv(square(f"Square {k}", ground.data.materials[0], **place).data)
        for each in mesh.uv_layers[0].data:
            each.uv = (column + 0.9 * each.uv[0], row + 0.1 + 0.8 * each.uv[1])
    lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0.1)


def deformed() -> None:
    """A box that is bent, with colours by where its vertices were."""
    box = stage(scale=(0.4, 0.4, 0.6))
    bend = box.modifiers.new("Bend", 'SIMPLE_DEFORM')
    bend.deform_method, bend.angle, bend.deform_axis = 'TWIST', 1.5, 'Z'
    for kind in ("Simple", "Moved"):
        put(box.modifiers.new(kind, 'SUBSURF'), subdivision_type='SIMPLE', render_levels=1)
    box.modifiers.new("Wave", 'CAST').factor = 0.6
    laid(box)
    lamp('AREA', (-1, -1.2, 2.5))


ONE_SIDED = partial(panel, one_sided=True)
BOTH = partial(panel, one_sided=True, reflects=True)
SURFACES: dict[str, Callable[[], None]] = {
    "albedo": floor,
    "emission": panel,
    "generated-before-modifiers": deformed,
    "box-projection": partial(projected, 'BOX', 0.4),
    "udim-tiles": tiled,
    "box-without-blend": partial(projected, 'BOX'),
    "sphere-projection": partial(projected, 'SPHERE'),
    "tube-projection": partial(projected, 'TUBE'),
    "one-sided": ONE_SIDED,
    "one-diffuse": BOTH,
    "clay": BOTH,
}
QUICK = tuple(SURFACES)[:5]


@pytest.mark.feature(PICTURE, area="Textured surfaces")
@pytest.mark.parametrize("name", cases(SURFACES, QUICK))
def test_textured_surfaces_are_those_of_cycles(name: str) -> None:
    build = SURFACES[name]
    build()
    noisy = {"ours": 384, "seeds": 12, "samples": 128} if build in (ONE_SIDED, BOTH) else FINE
    more = {} if name in QUICK else noisy
    agrees(both_sides(shading="clay" if name == "clay" else "full", **more))


# --- lamps ----------------------------------------------------------------------------------------


def at(kind: str, output: str, **settings: Any) -> Wiring:
    """A lamp's colour from an image that lies at an output of a node."""

    def wire(tree: Any, glow: Any) -> None:
        place = node(tree, kind).outputs[output]
        textured(tree, glow.inputs["Color"], place, picture(7), **settings)

    return wire


def falls(output: str, smooth: float) -> Wiring:
    def wire(tree: Any, glow: Any) -> None:
        fall = node(tree, "LightFalloff", Strength=0.7, Smooth=smooth)
        tree.links.new(fall.outputs[output], glow.inputs["Strength"])

    return wire


COORDINATE, GEOMETRY = "TexCoord", "NewGeometry"
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
SIMPLE = ("gobo", "point", "panel", "fall")


@pytest.mark.feature("picture: tiles 1 %, energy 0.5 %", area="Lights with nodes")
@pytest.mark.parametrize("name", cases(LAMPS, SIMPLE))
def test_lamps_with_trees_are_those_of_cycles(name: str) -> None:
    kind, properties, wire = LAMPS[name]
    stage()
    placed = lamp(kind, (-0.6, -1, 2.6), (0.4, 0.2, 0.3), **properties, scale=(1, 1.3, 0.8))
    tree = with_nodes(placed.data)
    wire(tree, tree.nodes["Emission"])
    sides = both_sides(ours=128)
    agrees(sides)
    whole, error = sides.energy()
    assert abs(whole) < GOBO and error < GOBO / 2
