# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.highlights``: sharp and broad highlights, ours against Cycles.

A ball and a floor of GGX under a spot, and of metal under an environment image with a small sun, at
roughness 0.05, 0.3 and 1: how far the pictures' energies are apart, with the error of that, and
relMSE (CONTRACT.md's) of both at the same samples a pixel, against the mean of what both have
converged to.
"""

from __future__ import annotations

import argparse
from typing import Any

import bpy
import numpy as np

from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.compare.metrics.relative import relmse
from blender_rad.rendering import Settings, render
from tests.blender.agreement import Sides, lamp, look_at
from tests.blender.reading import (
    SQUARE,
    add,
    empty_scene,
    material,
    node,
    polygons,
    sphere,
    world,
)
from tests.blender.test_world_cycles import picture

ROUGHNESSES = (0.05, 0.3, 1.0)
FEW = 16  # samples a pixel, of the pictures whose relMSE is told
SEEDS = 8


def build(kind: str, roughness: float) -> Any:
    """Open a new scene with the highlight in it."""
    empty_scene()
    glossy, principled = "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfPrincipled"
    if kind == "spot":
        shown = material("Shown", glossy, Roughness=roughness)
        lamp('SPOT', (-1.0, -1.2, 2.5), (0.1, 0.0, 0.7), shadow_soft_size=0.1, spot_size=1.0)
    else:
        shown = material("Shown", principled, Metallic=1.0, Roughness=roughness)
        tree = world().node_tree
        image = node(tree, "ShaderNodeTexEnvironment")
        image.image = picture((128, 64), (90, 45))
        tree.links.new(image.outputs[0], tree.nodes["Background"].inputs[0])
    for name, mesh, place in (
        ("Floor", polygons("Floor", *SQUARE), {"scale": (3, 3, 1)}),
        ("Ball", sphere("Ball", 32, 20), {"location": (0.1, 0, 0.8), "scale": (0.8,) * 3}),
    ):
        add(name, mesh, **place).data.materials[0] = shown
    look_at((0, 0, 0.6), (0.5, -6, 3), lens=40)
    return bpy.context.scene


def compare(kind: str, roughness: float, size: tuple[int, int], samples: int) -> str:
    """Return a line about one highlight."""
    bl_scene = build(kind, roughness)
    scene = read_scene(bl_scene, resolution=size, ask=True)
    film = render(scene, Settings(samples=4 * samples, per_light=False))
    witness = CyclesWitness(bl_scene, resolution=size)
    witness.prepare()
    seeds = np.stack([witness.render(s + 1, samples) for s in range(SEEDS)])
    off, error = Sides(scene, film, seeds).energy()
    mean = 0.5 * (seeds[..., :3].mean(axis=0, dtype=np.float64) + film.radiance)
    ours = render(scene, Settings(samples=FEW, per_light=False, seed=5)).radiance
    theirs = witness.render(SEEDS + 1, FEW)[..., :3].astype(np.float64)
    return (
        f"{kind:12}{roughness:10}{100 * off:12.3f} ± {100 * error:.3f} %"
        f"{relmse(ours, mean):14.2e}{relmse(theirs, mean):14.2e}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--samples", type=int, default=4096, help="a pixel and seed of Cycles")
    parser.add_argument("--resolution", type=int, nargs=2, default=(64, 48), metavar=("W", "H"))
    options = parser.parse_args()
    print(f"{'light':12}{'roughness':>10}{'Cycles over ours':>24}{'relMSE ours':>14}{'Cycles':>14}")
    for kind in ("spot", "environment"):
        for roughness in ROUGHNESSES:
            print(compare(kind, roughness, tuple(options.resolution), options.samples), flush=True)


if __name__ == "__main__":
    main()
