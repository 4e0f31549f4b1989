# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader node trees: where a socket's value comes from, and the closures that reach an output."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import bpy

Groups = tuple[Any, ...]
Triple = tuple[float, float, float]
BLACK: Triple = (0.0, 0.0, 0.0)


class Source(NamedTuple):
    """What a socket gets: the output that feeds it, or the socket whose own value counts.

    Attributes
    ----------
    socket : the last input followed.
    output : the node output behind it, None when nothing is linked.
    groups : the group nodes that were entered on the way, outermost first.
    """

    socket: Any
    output: Any | None
    groups: Groups


class Leaf(NamedTuple):
    """A closure node with the factor that Mix Shaders put before it, None when not constant."""

    node: Any
    weight: float | None
    groups: Groups


def source(socket: Any, groups: Groups = ()) -> Source:
    """Follow `socket` through reroutes, groups and muted nodes to what gives its value."""
    while True:
        link = next((link for link in socket.links if not link.is_muted), None)
        if link is None:
            return Source(socket, None, groups)
        output, node = link.from_socket, link.from_node
        if node.mute:
            inside = (i.from_socket for i in node.internal_links if i.to_socket == output)
            behind = next(inside, None)
        elif node.bl_idname == "NodeReroute":
            behind = node.inputs[0]
        elif node.bl_idname == "NodeGroupInput" and groups:
            behind, groups = _same(groups[-1].inputs, output), groups[:-1]
        elif node.bl_idname == "ShaderNodeGroup":
            behind, groups = _group_result(node, output), (*groups, node)
        else:
            return Source(socket, output, groups)
        if behind is None:
            return Source(socket, None, groups)
        socket = behind


def _same(sockets: Any, wanted: Any) -> Any | None:
    return next((s for s in sockets if s.identifier == wanted.identifier), None)


def _group_result(group: Any, output: Any) -> Any | None:
    nodes = group.node_tree.nodes if group.node_tree else ()
    ends = (n for n in nodes if n.bl_idname == "NodeGroupOutput" and n.is_active_output)
    return next((_same(end.inputs, output) for end in ends), None)


def number(socket: Any, groups: Groups = ()) -> float | None:
    """Return the constant number that `socket` gets, None when it is not constant."""
    value = _constant(socket, groups)
    return float(value) if isinstance(value, int | float) else None


def colour(socket: Any, groups: Groups = ()) -> Triple | None:
    """Return the constant colour that `socket` gets, None when it is not constant."""
    value = _constant(socket, groups)
    if value is None or isinstance(value, int | float):
        return None if value is None else grey(float(value))
    return (float(value[0]), float(value[1]), float(value[2]))


def _constant(socket: Any, groups: Groups) -> Any:
    end, output, _ = source(socket, groups)
    if output is None:
        return getattr(end, "default_value", None)
    if output.node.bl_idname in {"ShaderNodeValue", "ShaderNodeRGB"}:
        return output.default_value
    return None


def leaves(socket: Any, groups: Groups = (), weight: float | None = 1.0) -> Iterator[Leaf]:
    """Yield the closures behind `socket`; branches that a constant factor of 0 or 1 cuts are out.

    Add Shader adds; Mix Shader weighs with its factor clipped to [0, 1], as Cycles does.
    """
    output, groups = source(socket, groups)[1:]
    if output is None:
        return
    node = output.node
    if node.bl_idname == "ShaderNodeAddShader":
        for branch in node.inputs:
            yield from leaves(branch, groups, weight)
    elif node.bl_idname == "ShaderNodeMixShader":
        factor = number(node.inputs[0], groups)
        second = None if factor is None else min(max(factor, 0.0), 1.0)
        first = None if second is None else 1.0 - second
        for branch, share in ((node.inputs[1], first), (node.inputs[2], second)):
            if share != 0.0:
                product = None if share is None or weight is None else weight * share
                yield from leaves(branch, groups, product)
    else:
        yield Leaf(node, weight, groups)


def input_number(leaf: Leaf, name: str, missing: float = 0.0) -> float | None:
    """Return the constant of the leaf's input `name`; `missing` where the node has none such."""
    return number(leaf.node.inputs[name], leaf.groups) if name in leaf.node.inputs else missing


def leaf_emission(leaf: Leaf, strength: str = "Strength", tint: str = "Color") -> Triple | None:
    """Return weight · colour · strength of an emitting leaf (3,), None when it is not constant.

    What is surely nothing is 0 even where the other factors are not constant.
    """
    power = input_number(leaf, strength)
    rgb = colour(leaf.node.inputs[tint], leaf.groups)
    if power == 0.0 or rgb == BLACK:
        return BLACK
    if power is None or rgb is None or leaf.weight is None:
        return None
    return scaled(rgb, leaf.weight * power)


def grey(value: float) -> Triple:
    """Return `value` in all three channels."""
    return (value, value, value)


def scaled(rgb: Triple, factor: float) -> Triple:
    """Return a colour times a number."""
    return (factor * rgb[0], factor * rgb[1], factor * rgb[2])


def total(parts: Iterable[Triple]) -> Triple:
    """Return the sum of colours."""
    red, green, blue = zip(BLACK, *parts, strict=True)
    return (sum(red), sum(green), sum(blue))


def uniform_emission(tree: Any, kinds: set[str]) -> tuple[Triple, str | None]:
    """Return the constant emission of a world's or a light's `tree`, and what in it is not.

    `kinds` are the closure nodes that emit here; any other closure is named as unsupported.
    """
    output = tree.get_output_node("CYCLES")
    if output is None:
        return BLACK, None
    parts: list[Triple] = []
    for leaf in leaves(output.inputs["Surface"]):
        part = leaf_emission(leaf) if leaf.node.bl_idname in kinds else None
        if part is None:
            return BLACK, feature(leaf)
        parts.append(part)
    return total(parts), None


def feature(leaf: Leaf) -> str:
    """Return how a closure is named to a user."""
    return str(leaf.node.bl_label)


def uses_nodes(block: Any) -> bool:
    """Return whether Cycles looks at the node tree of a material, world or light.

    From Blender 5 on the switch counts for lights alone.
    """
    if block.node_tree is None:
        return False
    if bpy.app.version >= (5, 0) and not isinstance(block, bpy.types.Light):
        return True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return bool(block.use_nodes)
