# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees read as expressions: where a socket's value comes from, and what computes it."""

import warnings
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import bpy
import numpy as np
from numpy.typing import NDArray

from ..arrays import Singles
from ..textures import SOURCES, TEXTURES, Expression, constant
from ..textures.arithmetic import OF_NUMBERS, OF_VECTORS
from ..textures.colours import BLENDS
from ..working_space import WORKING_SPACES, luminance_weights
from .arrays import matrix
from .open import working_space

Groups = tuple[Any, ...]
Known = dict[tuple[int, ...], Expression]
Pixels = NDArray[np.uint8] | Singles
# Pixels by image and tile, of one reading.
IMAGES: WeakValueDictionary[tuple[str, int, int], Any] = WeakValueDictionary()

TABLE = 256  # samples that Cycles takes of ramps and curves
NUMBERS = {"VALUE", "INT", "BOOLEAN"}
_COPIED = {"BOOLEAN", "INT", "FLOAT", "ENUM"}
_NAMES = {"uv_map", "layer_name", "attribute_name"}
_LINEAR = {"Non-Color", "Linear Rec.709", "Raw", "Linear"}
_OUTPUTS = {  # of nodes that have others too, which are not known
    "ShaderNodeTexCoord": {"UV", "Generated", "Object", "Normal", "Reflection"},
    "ShaderNodeNewGeometry": {
        *("Position", "Normal", "True Normal", "Incoming", "Parametric", "Backfacing", "Tangent")
    },
    "ShaderNodeObjectInfo": {"Location"},
}


class Source(NamedTuple):
    """What a socket gets: the output that feeds it, or the socket whose own value counts."""

    socket: Any  # the last input followed
    output: Any | None  # None when nothing is linked
    groups: Groups  # group nodes that were entered on the way, outermost first
    types: tuple[str, ...] = ()  # of the sockets passed, the first one's first


class UnknownNodeError(Exception):
    """A node is not known; its message names it to users."""


def source(socket: Any, groups: Groups = ()) -> Source:
    """Follow `socket` through reroutes, groups and muted nodes to what gives its value."""
    types: tuple[str, ...] = ()
    while True:
        types += (socket.type,)
        link = next((link for link in socket.links if not link.is_muted), None)
        if link is None:
            return Source(socket, None, groups, types)
        output, node = link.from_socket, link.from_node
        if node.mute:
            through = (i.from_socket for i in node.internal_links if i.to_socket == output)
            behind = next(through, None)
        elif node.bl_idname == "NodeReroute":
            behind = node.inputs[0]
        elif node.bl_idname == "NodeGroupInput" and groups:
            behind, groups = _same(groups[-1].inputs, output), groups[:-1]
        elif node.bl_idname == "ShaderNodeGroup":
            inside = node.node_tree.nodes if node.node_tree else ()
            ends = (n for n in inside if n.bl_idname == "NodeGroupOutput" and n.is_active_output)
            behind = next((_same(end.inputs, output) for end in ends), None)
            groups = (*groups, node)
        else:
            return Source(socket, output, groups, types)
        if behind is None:
            return Source(socket, None, groups, types)
        socket = behind


def behind(socket: Any, groups: Groups = ()) -> Iterator[tuple[Any, Groups]]:
    """Yield each output that `socket` depends on, with the groups that lead to it."""
    waiting, seen = [(socket, groups)], set[tuple[int, str, int]]()
    while waiting:
        found = source(*waiting.pop())
        output, groups = found.output, found.groups
        if output is not None:
            key = (output.node.as_pointer(), output.identifier, len(groups))
            if key not in seen:
                seen.add(key)
                yield output, groups
                waiting += [(each, groups) for each in output.node.inputs]


def _same(sockets: Any, wanted: Any) -> Any | None:
    return next((s for s in sockets if s.identifier == wanted.identifier), None)


def expression(socket: Any, groups: Groups = (), known: Known | None = None) -> Expression:
    """Return what computes the value that `socket` gets; `UnknownNodeError` names what is not."""
    known = {} if known is None else known
    end, output, groups, types = source(socket, groups)
    if output is None:
        value = getattr(end, "default_value", None)
        if value is None or isinstance(value, str):
            raise UnknownNodeError(f"{end.name} of {end.node.bl_label}")
        found, kind, types = default(end), end.type, types[:-1]
    else:
        place = (output.as_pointer(), *(group.as_pointer() for group in groups))
        if place not in known:
            known[place] = _output(output, groups, known)
        found, kind = known[place], output.type
    for wanted in reversed(types):
        found, kind = _converted(found, kind, wanted), wanted
    return found


def default(socket: Any) -> Expression:
    """Return the value that a socket has by itself."""
    value = socket.default_value
    return constant(value if isinstance(value, int | float) else tuple(value)[:3])


def _converted(found: Expression, kind: str, wanted: str) -> Expression:
    """Return the value of a socket of one type as a socket of another type has it."""
    if (kind in NUMBERS) == (wanted in NUMBERS):
        return found
    weights = (1.0,) if kind in NUMBERS else _weights() if kind == "RGBA" else (1 / 3,) * 3
    return Expression("CONVERT", settings={"weights": weights}, inputs={"a": found})


def _weights() -> tuple[float, float, float]:
    """Return the luminance weights of the open file's working space."""
    return luminance_weights(WORKING_SPACES[working_space()])


def _output(output: Any, groups: Groups, known: Known) -> Expression:
    """Return what computes an output of a node that is not muted."""
    node, name = output.node, output.identifier
    kind = node.bl_idname
    if kind in {"ShaderNodeValue", "ShaderNodeRGB"}:
        return default(output)
    modes = {"ShaderNodeMath": OF_NUMBERS, "ShaderNodeVectorMath": {*OF_VECTORS, "SCALE"}}
    operation = getattr(node, "operation", None)
    blended = kind == "ShaderNodeMixRGB" or getattr(node, "data_type", "") == "RGBA"
    if (
        (kind not in TEXTURES and kind not in SOURCES)
        or name not in _OUTPUTS.get(kind, {name})
        or (kind in modes and operation not in modes[kind])
        or (kind.startswith("ShaderNodeMix") and blended and node.blend_type not in BLENDS)
        or getattr(node, "mode", "") == "HSL"
        or getattr(node, "from_instancer", False)
        or getattr(node, "attribute_type", "GEOMETRY") != "GEOMETRY"
    ):
        raise UnknownNodeError(node.bl_label)
    inputs = {s.identifier: _input(s, groups, known) for s in node.inputs}
    settings = plain_properties(node) | (_EXTRAS[kind](node) if kind in _EXTRAS else {})
    found = Expression(kind, name, settings, inputs)
    if kind == "ShaderNodeBlackbody" and inputs["Temperature"].value is None:
        raise UnknownNodeError(f"{node.bl_label} of a temperature that varies")
    return found


def _input(socket: Any, groups: Groups, known: Known) -> Expression:
    """Return an input of a node; without a link some are those of the surface."""
    kind = socket.node.bl_idname
    if not socket.enabled:
        return constant(0.0)
    if source(socket, groups).output is None:
        if socket.name == "Vector" and kind == "ShaderNodeTexEnvironment":
            return Expression("ShaderNodeNewGeometry", "Position")
        if socket.name == "Vector" and kind.startswith("ShaderNodeTex"):
            image = kind == "ShaderNodeTexImage"
            return Expression("ShaderNodeTexCoord", "UV" if image else "Generated")
        if socket.name == "Normal" and kind in {"ShaderNodeFresnel", "ShaderNodeLayerWeight"}:
            return Expression("ShaderNodeNewGeometry", "Normal")
    return expression(socket, groups, known)


def plain_properties(block: Any) -> dict[str, Any]:
    """Return the plain properties of a block by name, vectors as tuples."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        values = {name: getattr(block, name) for name in _plain(type(block))}
    many = {k: tuple(v) for k, v in values.items() if hasattr(v, "__len__") and type(v) is not str}
    return values | many


@cache
def _plain(kind: Any) -> tuple[str, ...]:
    inherited = bpy.types.Node.bl_rna.properties if issubclass(kind, bpy.types.Node) else ()
    return tuple(
        prop.identifier
        for prop in kind.bl_rna.properties
        if (prop.type in _COPIED and prop.identifier not in inherited) or prop.identifier in _NAMES
    )


def _ramp(node: Any) -> dict[str, Any]:
    ramp = node.color_ramp
    table = [tuple(ramp.evaluate(x)) for x in np.linspace(0.0, 1.0, TABLE)]
    return {"table": np.array(table), "step": ramp.interpolation == "CONSTANT"}


def _curves(node: Any) -> dict[str, Any]:
    mapping = node.mapping
    mapping.initialize()
    curves = list(mapping.curves)
    ends = [curve.points for curve in curves]
    low, high = min(p[0].location[0] for p in ends), max(p[-1].location[0] for p in ends)
    places = np.linspace(low, high, TABLE).tolist()
    before = [mapping.evaluate(curves[3], x) for x in places] if len(curves) == 4 else places
    table = np.array([[mapping.evaluate(c, x) for c in curves[:3]] for x in before])
    return {"table": table, "range": (low, high), "beyond": mapping.extend == "EXTRAPOLATED"}


def _coordinates(node: Any) -> dict[str, Any]:
    target = node.object
    return {"object_from_world": np.linalg.inv(matrix(target.matrix_world))} if target else {}


def _image(node: Any) -> dict[str, Any]:
    image, moved = node.image, node.texture_mapping
    if tuple(moved.scale) != (1, 1, 1) or any((*moved.translation, *moved.rotation)):
        raise UnknownNodeError(f"{node.bl_label} with a mapping of its own")
    if image is None:
        return {}
    space = image.colorspace_settings.name
    plain = working_space() == "Linear Rec.709" or space in {"Non-Color", "Raw"}
    known = {'FILE', 'GENERATED'} | ({'TILED'} if node.projection == 'FLAT' else set())
    if image.source not in known or space not in {*_LINEAR, "sRGB"} or not plain:
        raise UnknownNodeError(f"{node.bl_label} ({image.source.lower()}, {space})")
    tiles = {t.number: _pixels(image, t.number) for t in image.tiles if image.source == 'TILED'}
    there = {number: pixels for number, pixels in tiles.items() if pixels is not None}
    pixels = next(iter(there.values())) if there else _pixels(image)
    if pixels is None:
        return {}
    straight = image.alpha_mode in {'STRAIGHT', 'PREMUL'} and space != "Non-Color"
    alpha = node.outputs.get("Alpha")
    return {
        "pixels": pixels,
        "encoded": space == "sRGB" and pixels.dtype == np.uint8,
        "unassociate": straight and alpha is not None and alpha.is_linked,
    } | ({"tiles": there} if there else {})


def _pixels(image: Any, tile: int = 0) -> Pixels | None:
    """Return an image's pixels (h, w, 4) as Cycles stores them; None of one that is missing."""
    place = (image.name_full, image.as_pointer(), tile)
    found = IMAGES.get(place)
    if found is None and tile:  # Blender gives the pixels of the first tile alone
        alone = image.original.copy()
        for other in [each for each in alone.tiles if each.number != tile]:
            alone.tiles.remove(other)
        found = _stored(alone)
        bpy.data.images.remove(alone)
    elif found is None:
        found = _stored(image)
    if found is not None:
        IMAGES[place] = found
    return found


def _stored(image: Any) -> Pixels | None:
    width, height = image.size
    if not width * height or not len(image.pixels):
        return None
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, 4)
    if image.alpha_mode == 'NONE':
        pixels[..., 3] = 1.0
    if not image.is_float:
        whole = np.round(pixels * 255.0).astype(np.uint16)
        if image.alpha_mode == 'STRAIGHT' and image.colorspace_settings.name != "Non-Color":
            whole[..., :3] = whole[..., :3] * whole[..., 3:] // 255
        return whole.astype(np.uint8)
    return pixels


_EXTRAS: dict[str, Callable[[Any], dict[str, Any]]] = {
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeRGBCurve": _curves,
    "ShaderNodeVectorCurve": _curves,
    "ShaderNodeFloatCurve": _curves,
    "ShaderNodeTexImage": _image,
    "ShaderNodeTexEnvironment": _image,
    "ShaderNodeTexCoord": _coordinates,
    "ShaderNodeNormal": lambda node: {"direction": tuple(node.outputs[0].default_value)},
    "ShaderNodeNormalMap": lambda node: {"unit_normal": bpy.app.version >= (5, 0)},
    "ShaderNodeRGBToBW": lambda node: {"weights": _weights()},
    "ShaderNodeBlackbody": lambda node: {"chromaticities": WORKING_SPACES[working_space()]},
}
