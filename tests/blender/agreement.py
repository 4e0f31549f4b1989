# SPDX-License-Identifier: GPL-3.0-or-later
"""Our picture of the open scene, Cycles' pictures of it, and how far they are apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from blender_rad.bpy_io.materials import Shading
from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.film import Film
from blender_rad.rendering import Settings, render
from blender_rad.scene import Scene

Array = NDArray[np.float64]
TILE = 16
DARK = 0.05  # of the picture's mean: what tiles are measured against at least


@dataclass(frozen=True)
class Sides:
    """Both sides of one view: our film, and (s, h, w, 4) of Cycles, a picture a seed."""

    scene: Scene
    film: Film
    seeds: NDArray[np.float32]

    def tiles(self) -> tuple[Array, Array]:
        """Return the relative difference of each tile, and its standard error."""
        ours, theirs = pooled(self.film.radiance), np.array([pooled(s) for s in self.seeds])
        count = len(theirs)
        scale = np.maximum(np.abs(ours), DARK * abs(ours.mean()))
        variance = theirs.var(axis=0, ddof=1) / count + pooled(self.film.variance) / TILE**2
        return (theirs.mean(axis=0) - ours) / scale, np.sqrt(variance) / scale

    def energy(self) -> tuple[float, float]:
        """Return the relative difference of the whole picture, and its standard error."""
        ours, theirs = self.film.radiance.mean(), self.seeds[..., :3].mean(axis=(1, 2, 3))
        variance = np.var(theirs, ddof=1) / len(theirs)
        variance += self.film.variance.mean() / self.film.samples.size
        return float(theirs.mean() / ours - 1.0), float(np.sqrt(variance) / abs(ours))


def pooled(picture: Array) -> Array:
    """Return the mean of the three channels of each whole tile of (h, w, 3 or 4), flat."""
    grey = picture[..., :3].mean(axis=-1, dtype=np.float64)
    rows, columns = grey.shape[0] // TILE, grey.shape[1] // TILE
    cut = grey[: rows * TILE, : columns * TILE].reshape(rows, TILE, columns, TILE)
    return np.asarray(cut.mean(axis=(1, 3)).ravel())


def both_sides(
    size: tuple[int, int],
    *,
    shading: Shading = "full",
    ours: int = 128,
    seeds: int = 8,
    samples: int = 64,
) -> Sides:
    """Render the open scene with both, with fixed samples a pixel."""
    scene = read_scene(bpy.context.scene, shading=shading, resolution=size, ask=True)
    film = render(scene, Settings(samples=ours, threads=2))
    witness = CyclesWitness(bpy.context.scene, resolution=size, shading=shading, threads=2)
    witness.prepare()
    return Sides(scene, film, np.stack([witness.render(s + 1, samples) for s in range(seeds)]))


def look_at(
    target: tuple[float, float, float], eye: tuple[float, float, float], **lens: Any
) -> Any:
    """Put a camera at `eye`, looking at `target`, z up."""
    from mathutils import Vector

    data = bpy.data.cameras.new("Camera")
    placed = bpy.data.objects.new("Camera", data)
    bpy.context.scene.collection.objects.link(placed)
    placed.location = eye
    placed.rotation_euler = (Vector(target) - Vector(eye)).to_track_quat('-Z', 'Y').to_euler()
    for key, value in lens.items():
        setattr(data, key, value)
    bpy.context.scene.camera = placed
    return placed


def lamp(
    kind: str,
    location: tuple[float, float, float] = (0, 0, 3),
    towards: tuple[float, float, float] = (0, 0, 0),
    **properties: Any,
) -> Any:
    """Add a light of `kind` that looks at `towards`."""
    from mathutils import Vector

    data = bpy.data.lights.new(kind.title(), kind)
    data.energy = 3.0 if kind == 'SUN' else 100.0
    for key, value in properties.items():
        setattr(data, key, value)
    placed = bpy.data.objects.new(kind.title(), data)
    bpy.context.scene.collection.objects.link(placed)
    placed.location = location
    aim = Vector(towards) - Vector(location)
    placed.rotation_euler = aim.to_track_quat('-Z', 'Y').to_euler()
    return placed
