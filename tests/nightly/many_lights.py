# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.many_lights``: what a thousand lights cost, ours against Cycles.

A hall of pillars under 10, 100 and 1000 lights of the same power in all: points, downlights and
panels. Both engines render on one thread; the seconds are the processor's, those of the choice of
lights are counted, and the product with the relMSE that is reached is what a given error costs.
The error is the spread of pictures over seeds, so that the reference, which it is relative to, adds
none of its own. A few pixels beside lights that almost touch a pillar
hold most of it: what it is without the worst hundredth is printed too. Cycles has its light tree,
and persistent data after a first render.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

KINDS = ('POINT', 'SPOT', 'AREA')
POWER = 4000.0


def hall(count: int) -> object:
    """Build the scene with `count` lights, and return it."""
    from tests.blender.agreement import lamp, look_at
    from tests.blender.reading import CUBE, SQUARE, add, empty_scene, polygons

    bl_scene, rng = empty_scene(), np.random.default_rng(1)
    add("Floor", polygons("Floor", *SQUARE), scale=(10, 10, 1))
    cube = polygons("Cube", *CUBE)
    for x, y in np.ndindex(9, 9):
        turned = {"scale": (0.2, 0.2, 1), "rotation_euler": (0, 0, x + y)}
        add("Pillar", cube, location=(2 * x - 7.5, 2 * y - 7.7, 1), **turned)
    for k in range(count):
        x, y, z = rng.uniform((-9, -9, 1.2), (9, 9, 3.5))
        kind = KINDS[k % len(KINDS)]
        size = {"size": 0.2} if kind == 'AREA' else {"shadow_soft_size": 0.03}
        if kind == 'SPOT':
            size["spot_size"] = 2.0
        energy = POWER / count * rng.lognormal(0, 0.7)
        lamp(kind, (x, y, z), (x, y, 0), energy=energy, color=rng.uniform(0.3, 1, 3), **size)
    look_at((0, -1, 0.5), (0, -11, 6), lens=30)
    return bl_scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--size", type=int, nargs=2, default=(320, 240))
    parser.add_argument("--reference", type=int, default=128, help="our samples a pixel")
    parser.add_argument("--seeds", type=int, default=4, help="pictures of 16 samples a pixel")
    parser.add_argument("--counts", type=int, nargs="+", default=(10, 100, 1000))
    options = parser.parse_args()
    size = tuple(options.size)
    from blender_rad.bpy_io.read import read_scene
    from blender_rad.bpy_io.witness import CyclesWitness
    from blender_rad.direct import DirectLight
    from blender_rad.rendering import Settings, render

    for count in options.counts:
        bl_scene = hall(count)
        scene = read_scene(bl_scene, resolution=size)
        light = DirectLight(scene)
        settings = Settings(samples=options.reference, seed=7, per_light=False)
        reference = render(scene, settings, light=light).radiance
        witness = CyclesWitness(bl_scene, resolution=size, threads=1)
        witness.prepare()
        bl_scene.cycles.use_light_tree = True
        witness.render(1, 1)
        signal = reference**2 + 0.01 * reference.mean(axis=(0, 1)) ** 2

        def ours(seed: int, scene=scene, settings=settings, light=light) -> np.ndarray:
            settings = replace(settings, samples=16, threads=1, seed=seed)
            return render(scene, settings, light=light).radiance

        def cycles(seed: int, witness=witness) -> np.ndarray:
            return witness.render(seed + 1, 16)[..., :3].astype(float)

        for name, make in (("ours", ours), ("Cycles", cycles)):
            start = time.process_time()
            pictures = np.array([make(seed) for seed in range(options.seeds)])
            spent = (time.process_time() - start) / options.seeds
            error = np.sort((pictures.var(axis=0, ddof=1) / signal).mean(axis=-1).ravel())
            most = error[: int(0.99 * error.size)].mean()
            print(
                f"{count} lights, {name}: {spent:.2f} s, relMSE {error.mean():.2e}"
                f" ({most:.2e} without 1 %), product {spent * error.mean():.3g}",
                flush=True,
            )


if __name__ == "__main__":
    main()
