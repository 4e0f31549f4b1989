# SPDX-License-Identifier: GPL-3.0-or-later
"""One comparison from start to end: our film, the witness's pictures, the verdict.

Neither side sees the other: the witness is a function from a seed to a picture. While the verdict
is open, samples are bought from the side whose noise keeps it open, up to a budget.
"""

import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from .arrays import Floats, Singles
from .coincidence import coincident_faces, left_out
from .compare import Comparison, LightInfo, judge, judge_pictures
from .direct import DirectLight
from .emitters import emitters
from .errors import Finding
from .film import Film
from .progress import bar
from .rendering import Settings, render
from .scene import Scene

Pictures = Singles

FIRST_SEEDS = 16  # with 8, one error bar in 50 is missed by three of its lengths
FIRST_SAMPLES = 32  # a pixel and seed of the witness
MAX_SEEDS = 128
MOST_VALUES = 1 << 27  # of the witness's pictures together, where a time limit allows more
OUR_FIRST_SAMPLES = 32  # a pixel, the same for all: samples that follow the noise bias the mean
OUR_FIRST_MOST, OUR_MAX_SAMPLES = 512, 2048
OUR_FIRST_ERROR = 0.1  # relative, of pixels: factors then hardly feel what noise our layers have
MAX_GROWTH = 8.0  # of the samples from one round to the next
MAX_ROUNDS = 4
OUR_TIME = 0.5  # of what is left of a time limit


class Witness(Protocol):
    """Somebody else's picture of the same view."""

    def render(
        self, seed: int, samples: int, progress: Callable[[float], None] | None = None
    ) -> Singles:
        """Return (h, w, 4) radiance and alpha, row 0 at the top; seeds are independent."""
        ...


@dataclass(frozen=True)
class Terms:
    """What is asked of a comparison."""

    tolerance: float = 0.01
    confidence: float = 0.99
    samples: int | None = None  # a pixel, and a seed of the witness's; None buys until decided
    threads: int | None = None
    film_exposure: float | None = None  # of the pictures, where it is not 1
    # [s] after which no more is rendered, but for a picture in work. It takes the place of our own
    # limits on samples; None keeps to these:
    time_limit: float | None = None


@dataclass
class Result:
    """A verdict with the pictures that it rests on."""

    film: Film
    pictures: Pictures  # (s, h, w, 3) of the witness, a seed or a file each
    comparison: Comparison
    witness_samples: int | None  # a pixel and seed, None for pictures that existed
    seconds: dict[str, float] = field(default_factory=dict)  # by step

    @property
    def witness(self) -> Floats:
        """The witness's mean picture (h, w, 3)."""
        return np.asarray(self.pictures.mean(axis=0, dtype=np.float64))

    @property
    def witness_variance(self) -> Floats | None:
        """Variance (h, w, 3) of the mean picture, None with one picture."""
        count = len(self.pictures)
        if count < 2:
            return None
        return np.asarray(self.pictures.var(axis=0, ddof=1, dtype=np.float64) / count)


def light_rows(scene: Scene) -> list[LightInfo]:
    """Return the rows of the light table: name, type and count of each emitting object."""
    found, _ = emitters(scene)
    kinds = {e.light.name: e.light.kind for e in found if e.cause is None}
    native = [light.name for light in scene.lights]
    placed = [instance.name for instance in scene.instances]
    return [
        LightInfo(name, kind, max((placed if kind == "MESH" else native).count(name), 1))
        for name, kind in kinds.items()
    ]


class Check:
    """A comparison of our picture of `scene` with a witness's; `seed` is that of our samples."""

    def __init__(self, scene: Scene, terms: Terms, seed: int = 0) -> None:
        self.scene, self.terms = scene, terms
        self.seconds: dict[str, float] = {}  # spent on each step
        limit = math.inf if terms.time_limit is None else terms.time_limit
        self._deadline = time.perf_counter() + limit
        self._settings = Settings(
            samples=terms.samples or OUR_FIRST_SAMPLES,
            threads=terms.threads,
            per_light=True,
            seed=seed,
        )
        with self._timed("ours"):
            self._light = DirectLight(scene)
            self._coincident = coincident_faces(self._light)
        self.film = self._render_ours()
        excess = (self.film.relative_standard_error / OUR_FIRST_ERROR) ** 2
        if terms.samples is None and excess > 1.0:
            self._sample_ours(min(math.ceil(excess * self._our_samples), OUR_FIRST_MOST))

    @contextmanager
    def _timed(self, step: str) -> Generator[None]:
        start = time.perf_counter()
        yield
        self.seconds[step] = self.seconds.get(step, 0.0) + time.perf_counter() - start

    def _sample_ours(self, samples: int) -> None:
        self._settings = replace(self._settings, samples=samples)
        self.film = self._render_ours()

    def _render_ours(self, other: Scene | None = None) -> Film:
        left = self._left * OUR_TIME
        settings = replace(self._settings, time_limit=left if self._is_timed else None)
        with self._timed("ours"), bar("ours") as progress:
            scene, light = (other, None) if other else (self.scene, self._light)
            film = render(scene, settings, light=light, progress=progress)
            return left_out(film, self._coincident)

    def against_pictures(self, pictures: Pictures) -> Result:
        """Judge pictures (k, h, w, 3) that exist."""
        pictures = pictures / np.float32(self.terms.film_exposure or 1.0)
        comparison = self._decide(partial(judge_pictures, self.film, pictures))
        return Result(self.film, pictures, comparison, None, self.seconds)

    def against(self, witness: Witness, samples: int | None = None) -> Result:
        """Judge a witness that can be asked for more; `samples` a pixel and seed if it is fixed."""
        each = samples or self.terms.samples or FIRST_SAMPLES
        pictures = self._ask_witness(witness, range(1, FIRST_SEEDS + 1), each)
        round_index, fixed = 0, self.terms.samples is not None
        while True:
            last = round_index == MAX_ROUNDS - 1
            budget = math.inf if fixed else 1.0 if last else self._budget(len(pictures))
            judged = partial(judge, self.film, pictures, round_index=round_index, budget=budget)
            comparison = self._decide(judged)
            if len(pictures) < FIRST_SEEDS:
                comparison = self._out_of_time(comparison, len(pictures))
                break
            if comparison.needed_factor is None:
                break
            most = max(MAX_SEEDS, MOST_VALUES // pictures[0].size if self._is_timed else 0)
            ours, seeds = self._wanted(comparison, len(pictures), each, most)
            if last or fixed or (ours == self._our_samples and seeds == len(pictures)):
                comparison = self._too_noisy(comparison)
                break
            if ours > self._our_samples:
                self._sample_ours(ours)
            if seeds > len(pictures):
                more = self._ask_witness(witness, range(len(pictures) + 1, seeds + 1), each)
                pictures = np.concatenate([pictures, more])
            round_index += 1
        return Result(self.film, pictures, comparison, each, self.seconds)

    @property
    def _our_samples(self) -> int:
        return self._settings.samples or OUR_FIRST_SAMPLES

    @property
    def _is_timed(self) -> bool:
        return math.isfinite(self._deadline)

    @property
    def _left(self) -> float:
        return self._deadline - time.perf_counter()

    def _budget(self, seeds: int) -> float:
        """Return how many times the samples there could be."""
        if not self._is_timed:
            return MAX_SEEDS / seeds
        spent = self.seconds["ours"] + self.seconds["cycles"]
        return 1.0 + max(self._left, 0.0) / spent

    def _wanted(self, comparison: Comparison, seeds: int, each: int, most: int) -> tuple[int, int]:
        """Return our samples and the witness's seeds for the next round; no more if in vain.

        With s our share of the variance and r our samples over the witness's, variance falls to 1/f
        for the fewest samples when ours grow by f (s + √(s(1−s)/r)), its by f (1−s + √(s(1−s)r)).
        """
        have, spent = self._our_samples, self.seconds
        share = min(max(comparison.our_noise_share, 0.0), 1.0)
        both, ratio = math.sqrt(share * (1.0 - share)), math.sqrt(have / (seeds * each))
        growth = np.array([share + both / ratio, 1.0 - share + both * ratio])
        ours_most = math.inf if self._is_timed else OUR_MAX_SAMPLES

        def grown(factor: float) -> tuple[int, int, float]:
            ours, theirs = factor * growth * (have, seeds)
            ours = max(have, math.ceil(min(ours, ours_most)))
            theirs = max(seeds, math.ceil(min(theirs, most)))
            cost = spent["ours"] * ours / have + spent["cycles"] * (theirs / seeds - 1)
            return ours, theirs, cost

        factor, least = min(comparison.needed_factor or 1.0, MAX_GROWTH), comparison.least_factor
        at_best = share * have / ours_most + (1.0 - share) * seeds / most
        if least * at_best > 1.0 or grown(least)[2] > self._left:
            return have, seeds
        ours, theirs, cost = grown(factor)
        if cost > self._left:
            ours, theirs, _ = grown(max(factor * self._left / cost, least))
        return ours, theirs

    def _out_of_time(self, comparison: Comparison, seeds: int) -> Comparison:
        """Return the comparison without a verdict: too few seeds tell too little of their noise."""
        message = f"the time limit came after {seeds} of the first {FIRST_SEEDS} pictures"
        finding = Finding("out-of-time", "warning", "", message)
        return replace(comparison, verdict="undecided", findings=(*comparison.findings, finding))

    def _too_noisy(self, comparison: Comparison) -> Comparison:
        """Return the comparison with what holds it up, and what would settle it."""
        about = comparison.held_up_by
        times = max(comparison.needed_factor or 0.0, comparison.least_factor)
        message = (
            f"the noise of {about} is {comparison.held_up_error:.2g} times its tolerance, too much "
            f"to decide: about {times:.2g} times the samples would"
        )
        lights = {light.group or light.name for light in comparison.lights}
        finding = Finding("noise-too-high", "warning", about if about in lights else "", message)
        return replace(comparison, findings=(*comparison.findings, finding))

    def _decide(self, judged: Callable[..., Comparison]) -> Comparison:
        """Return the judgment; where it differs, knowing the pictures that causes would make."""
        known = partial(
            judged,
            lights=light_rows(self.scene),
            tolerance=self.terms.tolerance,
            confidence=self.terms.confidence,
            unit_scale_m=self.scene.unit_scale_m,
            film_exposure=self.terms.film_exposure,
        )
        with self._timed("compare"):
            comparison = known()
        if comparison.verdict != "differ":
            return comparison
        alternatives = self._alternatives()
        with self._timed("compare"):
            return known(alternatives=alternatives)

    def _alternatives(self) -> dict[str, dict[str, Any]]:
        """Return the layers that lights with a radius would have with the other fall-off."""
        switched = {
            light.name: replace(light, soft_falloff=not light.soft_falloff)  # type: ignore[call-arg]
            for light in self.scene.lights
            if getattr(light, "radius", 0.0) > 0.0
        }
        if not switched:
            return {}
        lights = tuple(switched.get(light.name, light) for light in self.scene.lights)
        film = self._render_ours(replace(self.scene, lights=lights))
        both = switched.keys() & self.film.lights.keys() & film.lights.keys()
        return {name: {"soft-falloff": film.lights[name]} for name in both}

    def _ask_witness(self, witness: Witness, seeds: Sequence[int], samples: int) -> Pictures:
        pictures: list[Pictures] = []
        with self._timed("cycles"), bar("witness") as progress:
            for number, seed in enumerate(seeds):
                if number > 1 and self._left < 0.0:
                    break

                def part(share: float, done: int = number) -> None:
                    progress((done + share) / len(seeds))

                pictures.append(witness.render(seed, samples, part)[..., :3])
            return np.stack(pictures)
