# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.benchmark``: seconds to equal error, ours against Cycles.

Renders the scene of `scenes/bench.py` (640×480, 300 000 triangles, four lights of four kinds) with
both engines at growing effort, measures relMSE (CONTRACT.md's) against a converged reference of
ours, and prints the time that each needs to 3e-3 and 1e-3, by interpolation of the logarithms.
Both are timed without building: Cycles with persistent data, after a first render, ours with the
geometry and BVH of before, whose seconds are printed. The better of Cycles' settings (light tree on
or off) is taken for each target. Both write no files but Cycles' own picture, and keep no layers by
light.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

TARGETS = (3e-3, 1e-3)
OURS = (0.08, 0.055, 0.04, 0.03, 0.02)  # target relative standard errors
CYCLES = (4, 8, 16, 32, 64)  # samples a pixel
Curve = list[tuple[float, float]]


def relmse(image: np.ndarray, reference: np.ndarray) -> float:
    """Return mean[(x − r)² / (r² + 0.01·mean(r)²)]."""
    signal = reference**2 + 0.01 * reference.mean(axis=(0, 1)) ** 2
    return float(np.mean((image - reference) ** 2 / signal))


def seconds_to(target: float, curve: Curve) -> float:
    """Return the time at which a curve of (seconds, relMSE) passes `target`."""
    seconds, error = np.log(np.array(curve)).T
    if not error.min() <= np.log(target) <= error.max():
        return float("nan")
    return float(np.exp(np.interp(-np.log(target), -error, seconds)))


def curve(efforts: tuple[float, ...], make: Callable[[float], np.ndarray], reference) -> Curve:
    """Return (seconds, relMSE) for growing effort, printing it as it goes."""
    found: Curve = []
    for effort in efforts:
        start = time.perf_counter()
        image = make(effort)
        seconds = time.perf_counter() - start
        found.append((seconds, relmse(image, reference)))
        print(f"  {effort:8g} {seconds:8.2f} s  relMSE {found[-1][1]:.2e}", flush=True)
    return found


def scene_file(folder: str) -> Path:
    """Build the benchmark's scene."""
    file = Path(folder) / "bench.blend"
    script = Path(__file__).parents[2] / "scenes" / "bench.py"
    subprocess.run([sys.executable, script, file], check=True, stdout=subprocess.DEVNULL)
    return file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--threads", type=int, default=None)
    options = parser.parse_args()
    from blender_rad.bpy_io.open import open_scene
    from blender_rad.bpy_io.read import read_scene
    from blender_rad.bpy_io.witness import CyclesWitness
    from blender_rad.direct import DirectLight
    from blender_rad.rendering import Settings, render

    with tempfile.TemporaryDirectory() as folder:
        bl_scene = open_scene(scene_file(folder))
        scene = read_scene(bl_scene)
    triangles = sum(len(scene.meshes[i.mesh].triangles) for i in scene.instances)
    print(f"{scene.resolution[0]}×{scene.resolution[1]}, {triangles} triangles")
    start = time.perf_counter()
    light = DirectLight(scene)
    print(f"our building: {time.perf_counter() - start:.2f} s")
    reference = render(scene, Settings(error=0.004, seed=77, per_light=False)).radiance

    def ours(error: float) -> np.ndarray:
        settings = Settings(error=error, threads=options.threads, per_light=False)
        return render(scene, settings, light=light).radiance

    print("ours, by target error")
    curves = {"ours": curve(OURS, ours, reference)}
    for tree in (True, False):
        witness = CyclesWitness(bl_scene, threads=options.threads)
        witness.prepare()
        bl_scene.cycles.use_light_tree = tree
        witness.render(1, 1)

        def cycles(samples: float, made: CyclesWitness = witness) -> np.ndarray:
            return made.render(2, int(samples))[..., :3].astype(float)

        name = f"Cycles, light tree {'on' if tree else 'off'}"
        print(f"{name}, by samples a pixel")
        curves[name] = curve(CYCLES, cycles, reference)
    for target in TARGETS:
        spent = {name: seconds_to(target, points) for name, points in curves.items()}
        best = np.nanmin([value for name, value in spent.items() if name != "ours"])
        listed = ", ".join(f"{name} {value:.2f} s" for name, value in spent.items())
        print(f"relMSE {target:g}: {listed}; ours / best Cycles = {spent['ours'] / best:.2f}")


if __name__ == "__main__":
    main()
