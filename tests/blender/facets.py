# SPDX-License-Identifier: GPL-3.0-or-later
"""Closure nodes as Cycles shows them on little quads, under a sun without extent.

A pixel is a quad with a normal of its own, seen along −z: its radiance is f |cosθ_i| × 1 W/m².
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.bsdfs import Inputs, lobes
from blender_rad.bsdfs.principled import emitted

from .reading import add, camera, empty_scene, light, material, node, polygons

Array = NDArray[np.float64]
HALF = 0.05  # of a quad's side, in pixels
GRAZING = 0.1  # least cosine: flatter quads miss their pixel, and single precision loses more
VECTORS = {"Tangent", "Coat Normal"}
VIEW = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Closure:
    """A shader node: what its sockets get, its settings, and how far around its peak to look."""

    kind: str
    values: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    spread: float = 1.0

    def shader(self, tree: Any) -> Any:
        typed = {name: value for name, value in self.values.items() if name not in VECTORS}
        made = node(tree, self.kind, **self.settings, **typed)
        for name in VECTORS & self.values.keys():  # which are the surface's own unless linked
            fixed = node(tree, "CombineXYZ", *self.values[name])
            tree.links.new(fixed.outputs[0], made.inputs[name])
        return made

    def frames(self, wi: Array, count: int, rng: np.random.Generator) -> Array:
        """Return frames (count, 3, 3) of quads, z about what mirrors or refracts wi to the view."""
        ior = self.values.get("IOR", 1.0)
        bends = np.ndim(ior) == 0 and wi[2] < 0.0
        ways = [VIEW + ior * wi, -VIEW - wi / ior] if bends else [VIEW + wi]
        found = np.concatenate([around(way, self.spread, 8 * count, rng) for way in ways])
        cosines = found[:, :, 2] @ np.stack([VIEW, wi], axis=1)
        kept = np.abs(cosines).min(axis=1) > GRAZING
        if "Coat Normal" in self.values:  # which by itself does not know of light from behind
            kept &= cosines.prod(axis=1) > 0.0
        return rng.permutation(found[kept])[:count]

    def ours(self, normals: Array, wi: Array) -> Array:
        """Return f |cosθ_i| (k, 3) at quads seen along −z; normals (k, 3) of their fronts."""
        back = normals[:, 2] < 0.0
        seen = np.where(back[:, None], -normals, normals)
        wo, many = np.tile(VIEW, (len(seen), 1)), np.tile(wi, (len(seen), 1))
        tree = bpy.data.node_groups.new("Values", 'ShaderNodeTree')
        sockets = {s.name: getattr(s, "default_value", 0.0) for s in self.shader(tree).inputs}
        values = {n: np.atleast_2d(np.ravel(v)[:3]).astype(float) for n, v in sockets.items()}
        fixed = {n: np.tile(self.values[n], (len(seen), 1)) for n in VECTORS & self.values.keys()}
        inputs = Inputs(
            {**values, "Coat Normal": fixed.get("Coat Normal", seen)}, self.settings,
            np.ones_like(seen), seen, seen, wo, fixed.get("Tangent"), back, bpy.app.version,
        )  # fmt: skip
        glow = 0.0
        if "Emission Strength" in self.values:
            glow = emitted(inputs) * values["Emission Color"] * values["Emission Strength"]
        return glow + sum(lobe.weight * lobe.evaluate(many)[0] for lobe in lobes(self.kind, inputs))


def around(middle: Array, spread: float, count: int, rng: np.random.Generator) -> Array:
    """Return frames (count, 3, 3) with z at slopes of a few times `spread` to a vector."""
    slope = spread * 10.0 ** rng.uniform(-1.5, 0.8, count)
    start = Vector(middle).to_track_quat('Z', 'X').to_matrix()
    turn, spin = 2 * np.pi * rng.random((2, count))
    return np.array([
        start @ Matrix.Rotation(t, 3, 'Z') @ Matrix.Rotation(a, 3, 'X') @ Matrix.Rotation(s, 3, 'Z')
        for t, a, s in zip(turn, np.arctan(slope), spin, strict=True)
    ])  # fmt: skip


def shot(closures: Sequence[Closure], frames: Sequence[Array], wi: Array) -> Array:
    """Return what Cycles shows of closures at quads of frames, (closures, quads, 3)."""
    scene = empty_scene()
    rows, columns = len(closures), len(frames[0])
    corners = [(-HALF, -HALF, 0), (HALF, -HALF, 0), (HALF, HALF, 0), (-HALF, HALF, 0)]
    for row, (closure, rotations) in enumerate(zip(closures, frames, strict=True)):
        shown = material(closure.kind, closure.shader)
        mesh = polygons("Quad", corners, [(0, 1, 2, 3)], shown)  # shared, so its normal stays exact
        for column, rotation in enumerate(rotations):
            place = Matrix.Translation((column + 0.5, rows - row - 0.5, 0.0))
            add("Quad", mesh, matrix_world=place @ Matrix(rotation.tolist()).to_4x4())
    sun = light('SUN', angle=0.0, energy=1.0, use_shadow=False)
    sun.rotation_euler = Vector(wi).to_track_quat('Z', 'Y').to_euler()
    eye = camera(type='ORTHO', ortho_scale=max(rows, columns))
    eye.location, eye.rotation_euler = (columns / 2, rows / 2, 10.0), (0.0, 0.0, 0.0)
    witness = CyclesWitness(scene, resolution=(columns, rows), threads=1)
    witness.prepare()
    return witness.render(1, 1)[..., :3].astype(float)
