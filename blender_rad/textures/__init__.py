# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees as arrays: what nodes compute, and what is known where they are evaluated.

Numbers are (n, 1), vectors and colours (n, 3), so that both broadcast; n is 1 where nothing varies.
Each node is a function of a `Call`, registered under Blender's name of its kind: in `TEXTURES`, or
in `SOURCES` if it looks at where it is. Their arithmetic is Cycles', derived from its kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Floats
from ..registry import Registry

ZERO, ONE = np.zeros((1, 3)), np.ones((1, 3))
UV = ""  # attributes that have no name of their own: the UV map that renders take,
COLOUR = "\0colour"  # the colours,
GENERATED = "\0generated"  # the place in the bounds,
NORMAL = "\0normal"  # and the object's normal, which has no unit length between corners
TANGENT = "\0tangent"  # ends the name of a UV map: its tangent, and 1 or -1 for a mirrored one


@dataclass
class Context:
    """Points (n,) on surfaces, or on lights, and who looks at them."""

    position: Floats = field(default_factory=ZERO.copy)  # in the world [bu]
    normal: Floats = field(default_factory=ZERO.copy)  # unit, on the viewer's side, as is the next
    geometric: Floats = field(default_factory=ZERO.copy)
    incoming: Floats = field(default_factory=ZERO.copy)  # unit, towards the viewer
    distance: Floats = field(default_factory=lambda: np.full((1, 1), np.inf))  # [bu] to the viewer
    backfacing: Floats = field(default_factory=lambda: np.zeros((1, 1)))  # 1 where the back is seen
    parametric: Floats = field(default_factory=ZERO.copy)  # first corner, second, 0; of lights UV
    object_from_world: Floats = field(default_factory=lambda: np.eye(4))
    attribute: Callable[[str], Floats | None] = lambda name: None  # (n, k) by name, if any
    measured: Callable[[int], Floats] = lambda slot: ZERO  # (n, 3) of what Blender was asked
    known: dict[int, Floats] = field(default_factory=dict[int, Floats])

    @property
    def normal_in_object(self) -> Floats:
        """The normals (n, 3) in the object's axes, of any length."""
        return self.normal @ np.linalg.inv(self.object_from_world[:3, :3])


class Call:
    """A node that is evaluated: its inputs by identifier, its settings, and where it is."""

    def __init__(self, node: Expression, context: Context) -> None:
        self.output, self.settings, self.context = node.output, node.settings, context
        self._inputs = node.inputs

    def __getitem__(self, name: str) -> Floats:
        return self._inputs[name].evaluate(self.context)

    def values(self) -> dict[str, Floats]:
        return {name: self[name] for name in self._inputs}

    def columns(self, *names: str) -> Floats:
        """Return inputs (n, 1) side by side."""
        return np.concatenate(np.broadcast_arrays(*(self[name] for name in names)), axis=1)


Function = Callable[[Call], Floats]
TEXTURES: Registry[Function] = Registry(__name__, "texture node")
SOURCES: Registry[Function] = Registry(__name__, "texture source")


def register(functions: Mapping[str, Function]) -> None:
    """Register nodes of `TEXTURES` by their kinds."""
    for kind, function in functions.items():
        TEXTURES.register(kind)(function)


@dataclass(frozen=True, eq=False)
class Expression:
    """One output of a node, with all that it depends on; can be pickled."""

    kind: str  # registered name of the node
    output: str = ""  # identifier, as those of `inputs`
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])  # by Blender's names
    inputs: Mapping[str, Expression] = field(default_factory=dict[str, "Expression"])

    def evaluate(self, context: Context) -> Floats:
        """Return its values, (n, 1) or (n, 3), or a single row for all."""
        found = context.known.get(id(self))
        if found is None:
            table = SOURCES if self.kind in SOURCES else TEXTURES
            with np.errstate(all="ignore"):
                found = table[self.kind](Call(self, context))
            context.known[id(self)] = found = np.nan_to_num(found, nan=0.0)
        return found

    def rgb(self, context: Context, count: int) -> Floats:
        """Return its values as colours, (count, 3)."""
        return np.broadcast_to(self.evaluate(context), (count, 3))

    @cached_property
    def value(self) -> Floats | None:
        """What it is everywhere, (1, 1) or (1, 3); None where it varies."""
        return None if self._varies else self.evaluate(Context())

    @cached_property
    def _varies(self) -> bool:
        return self.kind in SOURCES or any(each._varies for each in self.inputs.values())

    @property
    def measured(self) -> bool:
        """Whether it is known only where the camera looks first."""
        return any(kind == "MEASURED" for kind, _ in self.kinds)

    @cached_property
    def kinds(self) -> frozenset[tuple[str, str]]:
        """Kinds and outputs of all nodes in it."""
        inner = (each.kinds for each in self.inputs.values())
        return frozenset({(self.kind, self.output)}).union(*inner)

    def __mul__(self, other: Expression) -> Expression:
        for one, rest in ((self, other), (other, self)):
            if one.value is not None and not one.value.any():
                return constant(0.0)
            if one.value is not None and (one.value == 1.0).all() and one.value.size == 1:
                return rest
        return folded(Expression("MULTIPLY", inputs={"a": self, "b": other}))

    def __add__(self, other: Expression) -> Expression:
        return folded(Expression("ADD", inputs={"a": self, "b": other}))


def constant(value: Any) -> Expression:
    """Return the expression of a number, or of a triple."""
    return Expression("VALUE", settings={"value": np.array(value, dtype=np.float64).reshape(1, -1)})


def folded(expression: Expression) -> Expression:
    """Return the expression, as a plain value where it does not vary."""
    return expression if expression.value is None else constant(expression.value)


def clip(values: Floats) -> Floats:
    """Return values in [0, 1]."""
    return np.clip(values, 0.0, 1.0)


def smoothstep(values: Floats) -> Floats:
    """Return 3t² − 2t³ of values t, clipped to [0, 1]."""
    t = clip(values)
    return t * t * (3.0 - 2.0 * t)


def divided(a: Floats, b: Floats) -> Floats:
    """Return a/b, 0 where b is 0."""
    return np.where(b == 0.0, 0.0, a / np.where(b == 0.0, 1.0, b))


def dot(a: Floats, b: Floats) -> Floats:
    """Return scalar products (n, 1)."""
    return np.sum(a * b, axis=1, keepdims=True)


def unit(vectors: Floats) -> Floats:
    """Return vectors at unit length, those without length as 0."""
    return divided(vectors, np.sqrt(dot(vectors, vectors)))
