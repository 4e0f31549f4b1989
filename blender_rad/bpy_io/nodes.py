# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader node trees: the closures that reach an output, with their weights and inputs."""

import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..arrays import Floats
from ..scene import BLACK, RGB
from ..textures import Expression, constant, folded
from .expressions import Groups, UnknownNodeError, expression, source

Weight = Expression | None
Ask = Callable[[Any, Groups], Expression | None]  # Blender for a socket's value, None for no way
WHOLE, NOTHING = constant(1.0), constant(0.0)


class Leaf(NamedTuple):
    """A closure node with the factor that Mix Shaders put before it, None when not known."""

    node: Any
    weight: Weight
    groups: Groups

    @property
    def share(self) -> float | None:
        """The factor, None where it is not constant."""
        value = self.weight and self.weight.value
        return None if value is None else float(value[0, 0])

    @property
    def everywhere(self) -> Weight:
        """The factor, None also where it is known only in view."""
        return None if self.weight and self.weight.measured else self.weight


def read(socket: Any, groups: Groups = (), ask: Ask | None = None) -> Expression | None:
    """Return what computes the value that `socket` gets, None where a node is not known."""
    try:
        return expression(socket, groups)
    except UnknownNodeError:
        return ask(socket, groups) if ask else None


def number(socket: Any, groups: Groups = ()) -> float | None:
    """Return the constant number that `socket` gets, None when it is not constant."""
    found = read(socket, groups)
    value = found and found.value
    return None if value is None or value.size > 1 else float(value[0, 0])


def colour(socket: Any, groups: Groups = ()) -> RGB | None:
    """Return the constant colour that `socket` gets, None when it is not constant."""
    found = read(socket, groups)
    return None if found is None or found.value is None else triple(found.value)


def leaves(
    socket: Any, groups: Groups = (), weight: Weight = WHOLE, ask: Ask | None = None
) -> Iterator[Leaf]:
    """Yield the closures behind `socket`; branches that a constant factor of 0 or 1 cuts are out.

    Add Shader adds; Mix Shader weighs with its factor clipped to [0, 1], as Cycles does.
    """
    output, groups = source(socket, groups)[1:3]
    if output is None:
        return
    node = output.node
    if node.bl_idname == "ShaderNodeAddShader":
        for branch in node.inputs:
            yield from leaves(branch, groups, weight, ask)
    elif node.bl_idname == "ShaderNodeMixShader":
        factor = read(node.inputs[0], groups, ask)
        second = factor and folded(Expression("CLIP", inputs={"a": factor}))
        first = second and second * constant(-1.0) + WHOLE
        for branch, share in ((node.inputs[1], first), (node.inputs[2], second)):
            product = share and weight and weight * share
            if not is_zero(product):
                yield from leaves(branch, groups, product, ask)
    else:
        yield Leaf(node, weight, groups)


def is_zero(found: Expression | None) -> bool:
    """Return whether an expression is known to be 0 everywhere."""
    return found is not None and found.value is not None and not found.value.any()


def input_number(leaf: Leaf, name: str) -> float | None:
    """Return the constant of the leaf's input `name`; 0 where the node has none such."""
    return number(leaf.node.inputs[name], leaf.groups) if name in leaf.node.inputs else 0.0


def leaf_emission(leaf: Leaf, strength: str = "Strength", tint: str = "Color") -> Expression | None:
    """Return weight · colour · strength of an emitting leaf, None where a node is not known.

    What is surely nothing is 0 even where the other factors are not known.
    """
    power, rgb = (read(leaf.node.inputs[name], leaf.groups) for name in (strength, tint))
    if is_zero(power) or is_zero(rgb):
        return NOTHING
    weight = leaf.everywhere
    return None if power is None or rgb is None or weight is None else weight * power * rgb


def grey(value: float) -> RGB:
    """Return `value` in all three channels."""
    return (value, value, value)


def triple(value: Floats) -> RGB:
    """Return a constant, (1, 1) or (1, 3), as a colour."""
    red, green, blue = np.broadcast_to(value, (1, 3))[0].tolist()
    return (red, green, blue)


def split(parts: Iterable[Expression]) -> tuple[RGB, Expression | None]:
    """Return the sum of the constant parts, and that of those that vary, None without any."""
    total, varying = NOTHING, None
    for part in parts:
        if part.value is not None:
            total = total + part
        else:
            varying = part if varying is None else varying + part
    return triple(np.asarray(total.value)), varying


def emission(tree: Any, kinds: set[str]) -> tuple[RGB, Expression | None, str | None]:
    """Return the emission of a world's or a light's `tree`: constant, varying, what is unknown.

    `kinds` are the closure nodes that emit here; any other closure is named as unsupported.
    """
    output = tree.get_output_node("CYCLES")
    if output is None:
        return BLACK, None, None
    parts: list[Expression] = []
    for leaf in leaves(output.inputs["Surface"]):
        part = leaf_emission(leaf) if leaf.node.bl_idname in kinds else None
        if part is None:
            return BLACK, None, feature(leaf)
        parts.append(part)
    return *split(parts), None


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
