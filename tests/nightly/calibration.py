# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.calibration``: what the verdict promises, counted on Cycles' pictures.

Every trial compares fresh samples of ours with fresh seeds of Cycles, by `Check`, twice: the scene
as it is, and with one light, each in turn, 2 % stronger in the witness. Promised are at most 1
`differ` in 100 for the scene as it is, and at least 99 in 100 for the other, the light named and
its factor within three standard errors. Errors of factors are calibrated where z = (factor − 1) /
error has mean 0 and the deviation of Student's t, 1.07 for 16 seeds. Exits with 1 where a promise
is broken.
"""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from blender_rad.bpy_io.open import open_scene
from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.checking import Check, Result, Terms, Witness
from blender_rad.compare.result import MIN_ENERGY
from tests.blender.reading import CUBE, SQUARE, add, camera, empty_scene, light, material, polygons

STRONGER = 1.02
SEEDS_A_CHECK = 1000  # more than one check can buy
ERRORS = 3.0
# Four lights of four kinds over two boxes on a floor: quick to render, and no light is faint.
LIGHTS: dict[str, tuple[tuple[float, float, float], dict[str, Any]]] = {
    'AREA': ((-1.5, 0.6, 2.0), {"energy": 42, "color": (1.0, 0.8, 0.6), "size": 0.6}),
    'SPOT': ((1.4, 0.5, 2.4), {"energy": 200, "color": (0.5, 0.7, 1.0), "spot_size": 0.9}),
    'POINT': ((0.3, -1.0, 1.0), {"energy": 24, "color": (1.0, 0.5, 0.6), "shadow_soft_size": 0.1}),
    'SUN': ((0.0, 0.0, 3.0), {"energy": 1.0, "color": (0.9, 1.0, 0.9), "angle": 0.05}),
}


def build() -> Any:
    bl_scene, grey = empty_scene(), material("Grey", "BsdfDiffuse", Color=(0.7,) * 3)
    add("Floor", polygons("Floor", *SQUARE, grey), scale=(4, 4, 1))
    for x, y, half in ((-0.6, 0.2, 0.25), (0.9, -0.1, 0.2)):
        add("Box", polygons("Box", *CUBE, grey), location=(x, y, half), scale=(half,) * 3)
    for kind, (place, properties) in LIGHTS.items():
        turned = (0.6, 0.5, 0.0) if kind == 'SUN' else (0.0, 0.0, 0.0)
        light(kind, kind.title(), location=place, rotation_euler=turned, **properties)
    camera(location=(0, -3.4, 3.4), rotation_euler=(0.78, 0, 0))
    return bl_scene


@dataclass
class FreshSeeds:
    """A witness whose seeds start after `first`."""

    witness: Witness
    first: int

    def render(
        self, seed: int, samples: int, progress: Callable[[float], None] | None = None
    ) -> Any:
        return self.witness.render(self.first + seed, samples, progress)


@dataclass
class Tally:
    """What came of all trials.

    Attributes
    ----------
    unchanged, stronger : verdicts.
    found : how often the stronger light was named.
    factors : (factor, error) of each light in the unchanged scene, by light.
    """

    unchanged: Counter[str] = field(default_factory=Counter)
    stronger: Counter[str] = field(default_factory=Counter)
    found: int = 0
    factors: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    @property
    def kept(self) -> bool:
        """Whether the promises were kept: 1 in 100, and one for the luck of fewer."""
        trials = self.unchanged.total()
        allowed = max(1, trials // 100)
        return self.unchanged["differ"] <= allowed and trials - self.found <= allowed


class Bench:
    """A scene with both its engines, and the lights that can be made stronger."""

    def __init__(
        self, bl_scene: Any, resolution: tuple[int, int], threads: int | None = None
    ) -> None:
        self.bl_scene = bl_scene
        self.scene = read_scene(bl_scene, resolution=resolution)
        self.witness = CyclesWitness(bl_scene, resolution=resolution, threads=threads)
        self.witness.prepare()
        self.terms = Terms(threads=threads)
        layers = Check(self.scene, self.terms).film.lights
        energy = {name: float(layer.sum()) for name, layer in layers.items()}
        native = [o.name for o in bl_scene.objects if o.type == 'LIGHT']
        self.lights = [n for n in native if energy[n] >= MIN_ENERGY * sum(energy.values())]

    def compare(self, number: int) -> Result:
        """Return comparison `number`, of which no sample was taken before."""
        witness = FreshSeeds(self.witness, number * SEEDS_A_CHECK)
        return Check(self.scene, self.terms, seed=number + 1).against(witness)

    def trial(self, number: int, tally: Tally) -> None:
        same = self.compare(2 * number).comparison
        tally.unchanged[same.verdict] += 1
        for row in same.lights:
            if row.energy_fraction >= MIN_ENERGY:
                known = (row.scale_in_witness, row.standard_error)
                tally.factors.setdefault(row.name, []).append(known)
        stronger = self.lights[number % len(self.lights)]
        light = self.bl_scene.objects[stronger].data
        before, light.energy = light.energy, light.energy * STRONGER
        other = self.compare(2 * number + 1)
        light.energy = before
        tally.stronger[other.comparison.verdict] += 1
        tally.found += names(other, stronger)


def names(result: Result, light: str) -> bool:
    """Return whether a comparison finds `light`, and no other, stronger, by the right factor."""
    rows = [row for row in result.comparison.lights if row.energy_fraction >= MIN_ENERGY]
    off = [row for row in rows if row.verdict == "differ"]
    return [row.name for row in off] == [light] and (
        abs(off[0].scale_in_witness - STRONGER) <= ERRORS * off[0].standard_error
    )


def binomial_interval(count: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson for a chance, from P(at least k)."""
    tail, p, n = (1.0 - confidence) / 2.0, np.linspace(0.0, 1.0, 20_001), trials

    def crossing(k: int, level: float) -> float:
        chance = sum(float(math.comb(n, i)) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))
        return float(np.interp(level, chance, p))

    lower = 0.0 if count == 0 else crossing(count, tail)
    return lower, 1.0 if count == trials else crossing(count + 1, 1.0 - tail)


def summary(tally: Tally) -> str:
    """Return the counts with their 95 % intervals, and how the errors of factors are calibrated."""
    trials = tally.unchanged.total()
    rows = [("unchanged", v, tally.unchanged[v]) for v in ("differ", "agree", "undecided")]
    rows += [("one light 2 % stronger", v, n) for v, n in sorted(tally.stronger.items())]
    rows.append(("one light 2 % stronger", "found", tally.found))
    lines = [f"{trials} trials"]
    for scene, what, count in rows:
        low, high = binomial_interval(count, trials)
        lines.append(f"{scene:24}{what:10}{count:5}   {100 * low:5.1f} to {100 * high:5.1f} %")
    lines.append(f"{'light':12}{'factor − 1, mean':>18}{'its error':>11}{'z mean':>8}{'z sd':>6}")
    for name, known in tally.factors.items():
        factor, error = np.array(known).T
        z, error = (factor - 1.0) / error, error.mean() / len(error) ** 0.5
        spread = np.std(z, ddof=1)
        lines.append(f"{name:12}{factor.mean() - 1:18.1e}{error:11.1e}{z.mean():8.2f}{spread:6.2f}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--scene", type=Path, help="a .blend file (default: four lights)")
    parser.add_argument("--resolution", type=int, nargs=2, default=(48, 36), metavar=("W", "H"))
    parser.add_argument("--threads", type=int)
    options = parser.parse_args(arguments)
    bl_scene = open_scene(options.scene) if options.scene else build()
    bench, tally = Bench(bl_scene, tuple(options.resolution), options.threads), Tally()
    for number in range(options.trials):
        bench.trial(number, tally)
        print(number + 1, tally.unchanged, tally.stronger, tally.found, file=sys.stderr)
    print(summary(tally))
    print("kept" if tally.kept else "broken")
    return 0 if tally.kept else 1


if __name__ == "__main__":
    sys.exit(main())
