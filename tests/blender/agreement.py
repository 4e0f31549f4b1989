# SPDX-License-Identifier: GPL-3.0-or-later
"""Stages, our picture of the open scene, Cycles' pictures of it, and how far they are apart."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from blender_rad.bpy_io.materials import Shading
from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.film import Film
from blender_rad.rendering import Settings, render
from blender_rad.scene import Scene

from .reading import CUBE, SQUARE, add, aimed, camera, empty_scene, light, material, node, polygons

Array = NDArray[np.float64]
SIZE, TILE, COLUMNS = (48, 32), 16, 12
DARK = 0.05  # of the picture's mean: what tiles are measured against at least
PICTURE = "picture: tiles 1 %, energy 0.2 %"  # relative, what `agrees` asks for
TILES, ENERGY = 0.01, 0.002
NOISE_OF_TILES, NOISE_OF_ENERGY = 0.015, 0.006  # at most, so that the test means something
ALPHA = 0.2  # of a pixel, at edges
FINE = {"ours": 128, "seeds": 8}  # for noisy pictures
TINT = (0.9, 0.5, 0.2)


def cases(table: Collection[str], quick: Collection[str]) -> list[Any]:
    """The names of a table for `parametrize`; those that are not quick are slow."""
    return [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in table]


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
    size: tuple[int, int] = SIZE,
    *,
    shading: Shading = "full",
    ours: int = 64,
    seeds: int = 4,
    samples: int = 64,
    per_light: bool = True,
) -> Sides:
    """Render the open scene with both, with fixed samples a pixel."""
    scene = read_scene(bpy.context.scene, shading=shading, resolution=size, ask=True)
    film = render(scene, Settings(samples=ours, threads=2, per_light=per_light))
    witness = CyclesWitness(bpy.context.scene, resolution=size, shading=shading, threads=2)
    witness.prepare()
    return Sides(scene, film, np.stack([witness.render(s + 1, samples) for s in range(seeds)]))


def agrees(sides: Sides) -> None:
    assert not sides.film.excluded.any()
    off, error = sides.tiles()
    assert error.max() < NOISE_OF_TILES
    assert (np.abs(off) < TILES + 3 * error).all(), off
    whole, error = sides.energy()
    assert error < NOISE_OF_ENERGY
    assert abs(whole) < ENERGY + 3 * error
    np.testing.assert_allclose(sides.film.alpha, sides.seeds[..., 3].mean(axis=0), atol=ALPHA)


# --- stages ---------------------------------------------------------------------------------------


def look_at(
    target: tuple[float, float, float], eye: tuple[float, float, float], **lens: Any
) -> Any:
    return aimed(camera(**lens), eye, target)


def lamp(
    kind: str,
    location: tuple[float, float, float] = (0, 0, 3),
    towards: tuple[float, float, float] = (0, 0, 0),
    **properties: Any,
) -> Any:
    energy = 3.0 if kind == 'SUN' else 100.0
    made = light(kind, kind.title(), **{"energy": energy, **properties})
    return aimed(made, location, towards)


def stage(eye: tuple[float, float, float] = (0.5, -6, 3), **box: Any) -> Any:
    """A floor and a box, seen from the front; the box is returned."""
    empty_scene()
    add("Floor", polygons("Floor", *SQUARE), scale=(3, 3, 1))
    look_at((0, 0, 0.6), eye, lens=40)
    place = {"location": (0.4, 0.2, 0.5), "scale": (0.4,) * 3}
    return add("Box", polygons("Box", *CUBE), **{**place, **box})


def square(name: str, shown: Any = None, **properties: Any) -> Any:
    """Add a square of a material, of Lambert without any."""
    return add(name, polygons(name, *SQUARE, shown), **properties)


def glow(strength: float = 5.0, colour: tuple[float, ...] = (1, 0.7, 0.4)) -> Any:
    return material("Glow", "Emission", Color=colour, Strength=strength)


def tiles_of(
    names: Sequence[str], show: Callable[[str, Any], Any], *, noise: float, **options: Any
) -> dict[str, float]:
    """Show squares of 1 at places in rows of 12, seen from above, a tile each.

    Return by how much both sides differ on each, less three times the error, that `noise` limits.
    """
    rows = -(-len(names) // COLUMNS)
    for k, name in enumerate(names):
        show(name, (k % COLUMNS + 0.5, rows - k // COLUMNS - 0.5, 0))
    middle = (0.5 * COLUMNS, 0.5 * rows)
    look_at((*middle, 0), (*middle, 5), type='ORTHO', ortho_scale=float(max(COLUMNS, rows)))
    bpy.context.scene.camera.rotation_euler = (0, 0, 0)
    few = {"ours": 32, "seeds": 2, "samples": 32}
    sides = both_sides((TILE * COLUMNS, TILE * rows), **{**few, **options})
    assert not sides.scene.unsupported
    off, error = sides.tiles()
    assert error[: len(names)].max() < noise
    return dict(zip(names, np.abs(off) - 3 * error, strict=False))


def panes(count: int = 3) -> None:
    """A stage behind panes, and under others, of 30 % Lambert, the rest coloured and clear."""
    stage()
    tinted = material("Pane", lambda tree: node(
        tree, "MixShader", 0.3, node(tree, "BsdfTransparent", Color=TINT), node(tree, "BsdfDiffuse")
    ))  # fmt: skip
    for k in range(count):
        turned = {"scale": (0.7, 0.7, 1), "rotation_euler": (1.3, 0.1 * k, 0.1)}
        square(f"Pane {k}", tinted, location=(-0.3, -1 - 0.3 * k, 0.6), **turned)
        turned["rotation_euler"] = (0.1, 0.1 * k, 0.1)
        square(f"Roof {k}", tinted, location=(-0.6, 0.1, 1.3 + 0.15 * k), **turned)
