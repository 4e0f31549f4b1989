# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.calibration``: what the verdict promises, counted on Cycles' pictures.

Every trial compares fresh samples of ours with fresh seeds of Cycles, by `Check`, twice: the scene
as it is, and with one light, each in turn, 2 % stronger in the witness. Promised are at most 1
`differ` in 100 for the scene as it is, and at least 99 in 100 for the other, the light named and
its factor within three standard errors. Errors of factors are calibrated where z = (factor − 1) /
error has mean 0 and the deviation of Student's t, 1.07 for 16 seeds. Exits with 1 where a promise
is broken.
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
import time
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
from blender_rad.compare import LightResult
from blender_rad.compare.result import MIN_ENERGY

from . import calibration_scene

STRONGER = 1.02
SEEDS_A_CHECK = 1000  # more than one check can buy
ERRORS = 3.0
log = logging.getLogger("calibration")


@dataclass
class FreshSeeds:
    """A witness whose seeds start after `first`."""

    witness: Witness
    first: int
    bought: int = 0

    def render(
        self, seed: int, samples: int, progress: Callable[[float], None] | None = None
    ) -> Any:
        self.bought += samples
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
    def trials(self) -> int:
        return self.unchanged.total()

    @property
    def kept(self) -> bool:
        """Whether the promises were kept: 1 in 100, and one for the luck of fewer."""
        allowed = max(1, self.trials // 100)
        return self.unchanged["differ"] <= allowed and self.trials - self.found <= allowed


class Bench:
    """A scene with both its engines, and the lights that can be made stronger.

    Parameters
    ----------
    bl_scene : what both engines read.
    resolution : (width, height) in pixels.
    threads : None for all.
    """

    def __init__(
        self, bl_scene: Any, resolution: tuple[int, int], threads: int | None = None
    ) -> None:
        self.bl_scene = bl_scene
        self.scene = read_scene(self.bl_scene, resolution=resolution)
        self.witness = CyclesWitness(self.bl_scene, resolution=resolution, threads=threads)
        self.witness.prepare()
        self.threads = threads
        film = self._check(0).film
        energy = {name: float(layer.sum()) for name, layer in film.lights.items()}
        native = [o.name for o in self.bl_scene.objects if o.type == 'LIGHT']
        self.lights = [n for n in native if energy[n] >= MIN_ENERGY * sum(energy.values())]

    def _check(self, seed: int) -> Check:
        return Check(self.scene, Terms(threads=self.threads), seed=seed)

    def compare(self, number: int, stronger: str | None = None) -> Result:
        """Return comparison `number`, of which no sample was taken before."""
        check = self._check(number + 1)
        witness = FreshSeeds(self.witness, number * SEEDS_A_CHECK)
        if stronger is None:
            return check.against(witness)
        light = self.bl_scene.objects[stronger].data
        before = light.energy
        light.energy = before * STRONGER
        try:
            return check.against(witness)
        finally:
            light.energy = before

    def trial(self, number: int, tally: Tally) -> None:
        """Do both comparisons of one trial."""
        same = self.compare(2 * number)
        tally.unchanged[same.comparison.verdict] += 1
        for row in judged(same):
            known = (row.scale_in_witness, row.standard_error)
            tally.factors.setdefault(row.name, []).append(known)
        stronger = self.lights[number % len(self.lights)]
        other = self.compare(2 * number + 1, stronger)
        tally.stronger[other.comparison.verdict] += 1
        tally.found += names(other, stronger)


def judged(result: Result) -> list[LightResult]:
    """Return the rows of lights with enough energy to be judged."""
    return [row for row in result.comparison.lights if row.energy_fraction >= MIN_ENERGY]


def names(result: Result, light: str) -> bool:
    """Return whether a comparison finds `light`, and no other, stronger, by the right factor."""
    off = [row for row in judged(result) if row.verdict == "differ"]
    return [row.name for row in off] == [light] and (
        abs(off[0].scale_in_witness - STRONGER) <= ERRORS * off[0].standard_error
    )


def binomial_interval(count: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson for a chance, by bisection."""
    tail = (1.0 - confidence) / 2.0

    def at_most(k: int, p: float) -> float:
        return sum(math.comb(trials, i) * p**i * (1 - p) ** (trials - i) for i in range(k + 1))

    def crossing(k: int, level: float) -> float:
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if at_most(k, middle) > level else (low, middle)
        return low

    lower = 0.0 if count == 0 else crossing(count - 1, 1.0 - tail)
    return lower, 1.0 if count == trials else crossing(count, tail)


def summary(tally: Tally) -> str:
    """Return the counts with their 95 % intervals, and how the errors of factors are calibrated."""
    rows = [("unchanged", "differ", tally.unchanged["differ"])]
    rows += [("unchanged", verdict, tally.unchanged[verdict]) for verdict in ("agree", "undecided")]
    rows += [("one light 2 % stronger", v, n) for v, n in sorted(tally.stronger.items())]
    rows.append(("one light 2 % stronger", "found", tally.found))
    lines = [f"{tally.trials} trials"]
    for scene, what, count in rows:
        low, high = binomial_interval(count, tally.trials)
        lines.append(f"{scene:24}{what:10}{count:5}   {100 * low:5.1f} to {100 * high:5.1f} %")
    lines.append(f"{'light':12}{'factor − 1, mean':>18}{'its error':>11}{'z mean':>8}{'z sd':>6}")
    for name, known in tally.factors.items():
        factor, error = np.array(known).T
        z = (factor - 1.0) / error
        sd = np.std(z, ddof=1) if len(z) > 1 else math.nan
        lines.append(
            f"{name:12}{factor.mean() - 1:18.1e}{error.mean() / len(z) ** 0.5:11.1e}"
            f"{z.mean():8.2f}{sd:6.2f}"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--scene", type=Path, help="a .blend file (default: four lights)")
    parser.add_argument("--resolution", type=int, nargs=2, default=(48, 36), metavar=("W", "H"))
    parser.add_argument("--threads", type=int)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    started = time.perf_counter()
    width, height = options.resolution
    bl_scene = open_scene(options.scene) if options.scene else calibration_scene.build()
    bench, tally = Bench(bl_scene, (width, height), options.threads), Tally()
    for number in range(options.trials):
        bench.trial(number, tally)
        log.info("%d %.0f s %s", number + 1, time.perf_counter() - started, tally)
    print(summary(tally))
    print("kept" if tally.kept else "broken")
    return 0 if tally.kept else 1


if __name__ == "__main__":
    sys.exit(main())
