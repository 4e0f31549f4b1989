# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.benchmark``: seconds to equal error, ours against Cycles.

Renders the scene of `scenes/bench.py` (640×480, 300 000 triangles, four lights of four kinds) with
both engines at growing effort, measures relMSE (CONTRACT.md's) against a converged reference of
ours, and prints the time that each needs to 3e-3 and 1e-3, by interpolation of the logarithms.
Both are timed without building: Cycles with persistent data, after a first render, ours with the
geometry and BVH of before, whose seconds are printed. The engines take turns, and of each effort's
repetitions the fastest counts, as other work on the machine only ever adds. The better of Cycles'
settings (light tree on or off) is taken for each target. Both write no files but Cycles' own
picture, and keep no layers by light.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from blender_rad.bpy_io.open import open_scene
from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.compare.metrics.relative import relmse
from blender_rad.direct import DirectLight
from blender_rad.rendering import Settings, render

TARGETS = (3e-3, 1e-3)
OURS = (0.06, 0.045, 0.025)  # target relative standard errors
CYCLES = (24, 120)  # samples a pixel
Curve = list[tuple[float, float]]
Engines = dict[str, tuple[tuple[float, ...], Callable[[float], np.ndarray]]]


def seconds_to(target: float, curve: Curve) -> float:
    """Return the time at which a curve of (seconds, relMSE) passes `target`."""
    seconds, error = np.log(np.array(curve)).T
    if not error.min() <= np.log(target) <= error.max():
        return float("nan")
    return float(np.exp(np.interp(-np.log(target), -error, seconds)))


def measure(engines: Engines, reference: np.ndarray, repetitions: int) -> dict[str, Curve]:
    """Return each engine's (seconds, relMSE) for growing effort."""
    best: dict[tuple[str, float], tuple[float, float]] = {}
    for _ in range(repetitions):
        for name, (efforts, make) in engines.items():
            make(efforts[0])
            for effort in efforts:
                start = time.perf_counter()
                image = make(effort)
                found = (time.perf_counter() - start, relmse(image, reference))
                best[name, effort] = min(best.get((name, effort), found), found)
                print(f"  {name} {effort:g}: {found[0]:.2f} s, relMSE {found[1]:.2e}", flush=True)
    return {name: [best[name, effort] for effort in engines[name][0]] for name in engines}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--repetitions", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.blend"
        script = Path(__file__).parents[2] / "scenes" / "bench.py"
        subprocess.run([sys.executable, script, file], check=True, stdout=subprocess.DEVNULL)
        bl_scene = open_scene(file)
        scene = read_scene(bl_scene)
    triangles = sum(len(scene.meshes[i.mesh].triangles) for i in scene.instances)
    print(f"{scene.resolution[0]}×{scene.resolution[1]}, {triangles} triangles")
    start = time.perf_counter()
    light = DirectLight(scene)
    print(f"our building: {time.perf_counter() - start:.2f} s")
    witness = CyclesWitness(bl_scene, threads=options.threads)
    witness.prepare()

    def ours(error: float, **others: int | None) -> np.ndarray:
        return render(scene, Settings(error=error, per_light=False, **others), light=light).radiance

    def cycles(samples: float, tree: bool) -> np.ndarray:
        bl_scene.cycles.use_light_tree = tree
        return witness.render(2, int(samples))[..., :3].astype(float)

    engines: Engines = {
        "ours, target error": (OURS, partial(ours, threads=options.threads)),
        "Cycles with light tree, samples": (CYCLES, partial(cycles, tree=True)),
        "Cycles without, samples": (CYCLES, partial(cycles, tree=False)),
    }
    curves = measure(engines, ours(0.004, seed=77), options.repetitions)
    for target in TARGETS:
        spent = {name: seconds_to(target, points) for name, points in curves.items()}
        listed = ", ".join(f"{name.split(',')[0]} {value:.2f} s" for name, value in spent.items())
        own, *others = spent.values()
        print(f"relMSE {target:g}: {listed}; ours / best Cycles = {own / np.nanmin(others):.3f}")


if __name__ == "__main__":
    main()
