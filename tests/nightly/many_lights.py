# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.many_lights``: what a thousand lights cost, ours against Cycles.

Halls of pillars under 10, 100 and 1000 lights of the same power in all: points, downlights and
panels, some of which almost touch a pillar. Each engine renders on one thread. The seconds are the
processor's, with those of the choice of lights; our pictures of all counts take turns, so that what
else the machine does falls on all of them alike. The error is the spread of pictures over seeds, so
that the reference, which it is relative to, adds none of its own; seconds times relMSE is what a
given error costs. Cycles has its light tree, and persistent data after a first render.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

KINDS = ('POINT', 'SPOT', 'AREA')
POWER = 4000.0


def hall(count: int, seed: int = 1) -> object:
    """Build the scene with `count` lights, where `seed` has them, and return it."""
    from tests.blender.agreement import lamp, look_at
    from tests.blender.reading import CUBE, SQUARE, add, empty_scene, polygons

    bl_scene, rng = empty_scene(), np.random.default_rng(seed)
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


def pictures(make: Callable[[int], np.ndarray], seeds: range) -> tuple[float, list[np.ndarray]]:
    """Return the processor's seconds for a picture, and the pictures."""
    start = time.process_time()
    found = [make(seed) for seed in seeds]
    return (time.process_time() - start) / len(seeds), found


def cost(name: str, seconds: float, found: list[np.ndarray], reference: np.ndarray) -> float:
    """Tell and return the seconds for a relMSE of 1."""
    signal = reference**2 + 0.01 * reference.mean(axis=(0, 1)) ** 2
    error = float((np.var(found, axis=0, ddof=1) / signal).mean())
    print(f"{name}: {seconds:.2f} s, relMSE {error:.2e}, product {seconds * error:.3g}", flush=True)
    return seconds * error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--size", type=int, nargs=2, default=(320, 240))
    parser.add_argument("--reference", type=int, default=64, help="our samples a pixel")
    parser.add_argument("--seeds", type=int, default=4, help="pictures of 16 samples a pixel")
    parser.add_argument("--halls", type=int, nargs="+", default=(1, 2, 3))
    parser.add_argument("--counts", type=int, nargs="+", default=(10, 100, 1000))
    options = parser.parse_args()
    size, seeds = tuple(options.size), range(options.seeds)
    from blender_rad.bpy_io.read import read_scene
    from blender_rad.bpy_io.witness import CyclesWitness
    from blender_rad.direct import DirectLight
    from blender_rad.rendering import Settings, render

    ratios = []
    for number in options.halls:
        read, theirs = {}, {}
        for count in options.counts:
            bl_scene = hall(count, number)
            bl_scene.cycles.use_light_tree = True
            read[count] = read_scene(bl_scene, resolution=size)
            witness = CyclesWitness(bl_scene, resolution=size, threads=1)
            witness.prepare()
            witness.render(1, 1)

            def cycles(seed: int, witness: CyclesWitness = witness) -> np.ndarray:
                return witness.render(seed + 1, 16)[..., :3].astype(float)

            theirs[count] = pictures(cycles, seeds)
        ready = {count: (scene, DirectLight(scene)) for count, scene in read.items()}

        def ours(count: int, seed: int, samples: int = 16, ready: dict = ready) -> np.ndarray:
            settings = Settings(samples=samples, threads=1, seed=seed, per_light=False)
            return render(ready[count][0], settings, light=ready[count][1]).radiance

        rounds = {count: [] for count in read}
        for seed in seeds:
            for count, found in rounds.items():
                found.append(pictures(partial(ours, count), range(seed, seed + 1)))
        costs = []
        for count, found in rounds.items():
            reference = ours(count, 1 << 16, options.reference)
            seconds = float(np.mean([each for each, _ in found]))
            name = f"hall {number}, {count} lights"
            own = cost(f"{name}, ours", seconds, [each for _, (each,) in found], reference)
            cycles_cost = cost(f"{name}, Cycles", *theirs[count], reference)
            print(f"  Cycles costs {cycles_cost / own:.1f} times as much")
            costs.append(own)
        ratios.append(costs[-1] / costs[0])
        print(f"  {options.counts[-1]} lights cost {ratios[-1]:.2f} times {options.counts[0]}")
    mean = float(np.exp(np.log(ratios).mean()))
    print(f"{options.counts[-1]} lights cost {mean:.2f} times {options.counts[0]}: mean of halls")


if __name__ == "__main__":
    main()
