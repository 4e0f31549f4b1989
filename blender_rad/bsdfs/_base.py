# SPDX-License-Identifier: GPL-3.0-or-later
"""What every BSDF offers to the estimator, and how the closures of a material become some.

A shader node is a sum of lobes, each with a weight by channel and a normal of its own. Directions
are unit vectors away from the surface, in world axes: ω_o to the viewer, ω_i to the light. A lobe
is made for n points and their ω_o, so that what depends on these alone is worked out once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, ClassVar, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..registry import Registry

Array = NDArray[np.float64]
T = TypeVar("T")
TINY = 1e-300
UNKNOWN = 0.02  # albedos are approximate: a lobe that may be there must be sampled


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products (n,) of vectors (n, 3)."""
    return np.sum(a * b, axis=1)


def picked(value: T, rows: NDArray[np.int64]) -> T:
    """Return the rows (k,) of an array, or of all arrays in a tuple or a dataclass."""
    if isinstance(value, np.ndarray):
        return cast("T", value[rows])
    if isinstance(value, Frame):
        return cast("T", Frame(*(axis[rows] for axis in value)))
    if is_dataclass(value) and not isinstance(value, type):
        parts = {part.name: picked(getattr(value, part.name), rows) for part in fields(value)}
        return replace(value, **parts)
    return value


class Frame(NamedTuple):
    """An orthonormal frame at each point: three (n, 3) by column, z along the normal."""

    x: Array
    y: Array
    z: Array

    @classmethod
    def around(cls, normal: Array, tangent: Array | None = None) -> Frame:
        """Return the frame of unit normals (n, 3), x as near to `tangent` (n, 3) as can be."""
        if tangent is None:
            least = np.argmin(np.abs(normal), axis=1)
            tangent = np.eye(3)[least]
        across = np.cross(normal, tangent)
        length = np.sqrt(np.sum(across * across, axis=1, keepdims=True))
        free = length[:, 0] < 1e-12
        if free.any():
            across[free] = cls.around(normal[free]).y
            length[free] = 1.0
        y = np.asfortranarray(across / length)
        return cls(np.asfortranarray(np.cross(y, normal)), y, np.asfortranarray(normal))

    def local(self, vectors: Array) -> Array:
        """Return world vectors (n, 3) in the frame, by column."""
        return np.stack([np.sum(vectors * axis, axis=1) for axis in self]).T

    def world(self, vectors: Array) -> Array:
        """Return vectors (n, 3) of the frame in world axes, by column."""
        out = np.zeros(vectors.shape, order="F")
        for k, axis in enumerate(self):
            out += vectors[:, k, None] * axis
        return out


class Lobe(ABC):
    """One reflecting or transmitting closure at n points, seen from their ω_o.

    Attributes
    ----------
    weight : (n, 3) factor on `evaluate` by channel, of node colours, mixes and layers above.
    frame : z along its normal, on the viewer's side.
    reciprocal : whether f(i, o) = f(o, i) is promised; the laws of the others say why not.
    conserves : whether ∫ f cosθ dω ≤ 1 is promised.
    transmits : whether it sends light through the surface.
    ray : what Blender's ray visibility takes it for: diffuse, glossy or transmission.
    """

    reciprocal: ClassVar[bool] = True
    conserves: ClassVar[bool] = True
    transmits: ClassVar[bool] = False
    ray: ClassVar[str] = "glossy"
    weight: Array
    frame: Frame

    @abstractmethod
    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        """Return f |cosθ_i| [1/sr], (n, 1) or (n, 3), and the density (n,) [1/sr] of `sample`.

        `weight` is not in it. Both are 0 where the lobe has nothing.
        """

    @abstractmethod
    def sample(self, u: Array) -> Array:
        """Return ω_i (n, 3) of `u` (n, 2) in [0, 1); 0 where the sample fails.

        Failed samples count: the densities integrate to 1 less their share.
        """

    def albedo(self) -> Array:
        """Return about ∫ f |cosθ_i| dω_i, (n, 1) or (n, 3), which sampling is shared out by."""
        return np.ones((1, 1))

    def at(self, rows: NDArray[np.int64]) -> Lobe:
        """Return the lobe of the points `rows` (k,), of a dataclass of (n, …) arrays."""
        return picked(self, rows)

    @classmethod
    @abstractmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Lobe]:
        """Return lobes for the contract tests, seen from `wo` (n, 3) on the frame's upper side."""


@dataclass(frozen=True)
class Inputs:
    """What a shader node gets at n points.

    Attributes
    ----------
    values : (n, 1) or (n, 3) by the name of the socket; a single row where nothing varies.
    settings : the node's own properties by Blender's names.
    weight : (n, 3) of the mixes before it.
    normal, geometric : (n, 3) unit, on the viewer's side; the shading normal, or what the node's
        Normal input says instead.
    tangent : (n, 3) of the Tangent input, None without.
    wo : (n, 3) unit, towards the viewer.
    backfacing : (n,) bool, where the back is seen.
    version : Blender's.
    """

    values: Mapping[str, Array]
    settings: Mapping[str, Any]
    weight: Array
    normal: Array
    geometric: Array
    wo: Array
    tangent: Array | None = None
    backfacing: NDArray[np.bool_] | None = None
    version: tuple[int, int, int] = (5, 2, 0)

    def number(self, name: str, missing: float = 0.0) -> Array:
        """Return the numbers (n,) of a socket; `missing` where the node has none such."""
        found = self.values.get(name)
        n = len(self.wo)
        return np.full(n, missing) if found is None else np.broadcast_to(found[:, 0], (n,))

    def colour(self, name: str) -> Array:
        """Return the colours (n, 3) of a socket."""
        return np.broadcast_to(self.values[name], (len(self.wo), 3))

    def glossy(self, normal: Array | None = None) -> Array:
        """Return a unit normal (n, 3), the node's without one, as glossy lobes take it.

        Where it would mirror the viewer below the surface, Cycles turns it towards the geometric
        normal, in their plane, until the mirrored direction r has r·g = t = min(0.9 o·g, 0.01).
        With n = x sinα + g cosα and o = x o_x + g o_z + …, that is o_x sin2α + o_z cos2α = t, so
        that 2α = φ + arccos(t/√(o_x² + o_z²)) with tan φ = o_x/o_z.
        """
        normal, g = self.normal if normal is None else normal, self.geometric
        if not self.settings.get("use_bump_map_correction", True):
            return normal
        height, rise = dot(self.wo, g), dot(normal, g)
        least = np.minimum(0.9 * height, 0.01)
        low = np.flatnonzero(2.0 * dot(normal, self.wo) * rise - height < least)
        x = normal[low] - rise[low, None] * g[low]
        x /= np.maximum(np.sqrt(dot(x, x)), TINY)[:, None]
        across, height = dot(self.wo[low], x), height[low]
        slope = least[low] / np.maximum(np.hypot(across, height), TINY)
        turn = 0.5 * (np.arctan2(across, height) + np.arccos(np.clip(slope, 0.0, 1.0)))
        found = normal.copy(order="K")
        found[low] = np.sin(turn)[:, None] * x + np.cos(turn)[:, None] * g[low]
        return found


Node = Callable[[Inputs], Sequence[Lobe]]
BSDFS: Registry[Node] = Registry(__name__.rpartition(".")[0], "BSDF")


def lobes(kind: str, inputs: Inputs) -> Sequence[Lobe]:
    """Return what the shader node `kind`, by Blender's name of it, is made of."""
    return BSDFS[kind](inputs)


@dataclass(frozen=True)
class Mixture:
    """The sum of lobes at the same n points; each is sampled by its share of the light.

    Attributes
    ----------
    parts : the lobes.
    share : (parts, n) chances.
    """

    parts: Sequence[Lobe]
    share: Array

    @classmethod
    def of(cls, parts: Sequence[Lobe], diffuse: float = 1.0) -> Mixture:
        """Return the sum of lobes, at least one; `diffuse` is a factor on the chances of such."""
        known = [part.weight * np.maximum(part.albedo(), UNKNOWN) for part in parts]
        wanted = [diffuse if part.ray == "diffuse" else 1.0 for part in parts]
        size = [np.mean(np.abs(w * each), axis=1) for w, each in zip(wanted, known, strict=True)]
        strength = np.stack(size)
        total = strength.sum(axis=0)
        even = np.full_like(strength, 1.0 / len(parts))
        return cls(parts, np.divide(strength, total, out=even, where=total > 0.0))

    def evaluate(
        self, wi: Array, rays: Sequence[str] = ("diffuse", "glossy", "transmission")
    ) -> tuple[Array, Array]:
        """Return f |cosθ_i| (n, 3) with all weights, and the density (n,) of `sample`.

        Lobes that are none of `rays` count in the density alone.
        """
        value, density = np.zeros((len(wi), 3), order="F"), np.zeros(len(wi))
        for part, share in zip(self.parts, self.share, strict=True):
            own, pdf = part.evaluate(wi)
            if part.ray in rays:
                value += part.weight * own
            density += share * pdf
        return value, density

    def sample(self, u: Array) -> Array:
        """Return ω_i (n, 3) of `u` (n, 2), 0 where the sample fails."""
        ends = np.cumsum(self.share, axis=0)
        chosen = np.minimum((u[:, 0] >= ends).sum(axis=0), len(self.parts) - 1)
        wi = np.zeros((len(u), 3), order="F")
        for k, part in enumerate(self.parts):
            rows = np.flatnonzero(chosen == k)
            if len(rows):
                share = np.maximum(self.share[k, rows], TINY)
                again = (u[rows, 0] - (ends[k, rows] - self.share[k, rows])) / share
                pair = np.stack([np.clip(again, 0.0, 1.0 - 1e-9), u[rows, 1]], axis=1)
                wi[rows] = part.at(rows).sample(pair)
        return wi
