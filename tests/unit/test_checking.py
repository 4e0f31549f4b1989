# SPDX-License-Identifier: GPL-3.0-or-later
"""Buying samples: whose, how many, and when no budget would do. The witness is ours with noise."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from blender_rad import checking
from blender_rad.checking import FIRST_SEEDS, MAX_SEEDS, Check, Terms
from blender_rad.lights.point import PointLight
from blender_rad.rendering import Settings, render
from blender_rad.scene import Instance, Scene
from tests.handmade import ball, moved, scene, square

QUIET, LOUD, LOUDER, HOPELESS = 0.5, 2.5, 10.0, 100.0
KEY = PointLight(name="Key", rgb=np.array([300.0, 250.0, 200.0]), position=np.array([2.0, -3, 4]))
FILL = PointLight(name="Fill", rgb=np.array([90.0, 120.0, 200.0]), position=np.array([-2.0, 1, 3]))


def balls(fill: float = 1.0, radius: float = 0.0) -> Scene:
    """Balls on a floor under two lights; penumbras make our own side noisy."""
    instances = [Instance("floor", 0, np.eye(4), (0,))]
    instances += [Instance(f"ball {x}", 1, moved(x, 0.0, 1.0, 0.4), (0,)) for x in (-1.0, 0.2, 1.2)]
    lights = [replace(KEY, radius=radius), replace(FILL, rgb=FILL.rgb * fill, radius=radius)]
    return scene([square(), ball(16, 32)], instances, lights, resolution=(32, 32))


@pytest.fixture(scope="module")
def pictures() -> dict[float, np.ndarray]:
    """The scene almost without noise, by the factor on its fill light."""
    return {f: render(balls(f), Settings(samples=256, seed=9)).radiance for f in (1.0, 1.02)}


@dataclass
class Noisy:
    """A picture with white noise, relative to its radiance `noise` for one sample a pixel."""

    picture: np.ndarray
    noise: float
    seeds: list[int] = field(default_factory=list)

    def render(self, seed: int, samples: int, progress: Any = None) -> np.ndarray:
        self.seeds.append(seed)
        z = np.random.default_rng(seed).normal(size=self.picture.shape)
        return (self.picture * (1.0 + self.noise / samples**0.5 * z)).astype(np.float32)


@pytest.mark.parametrize("noise", [QUIET, LOUD])
def test_seeds_are_bought_until_it_agrees(pictures, noise):
    witness = Noisy(pictures[1.0], noise)
    result = Check(balls(), Terms()).against(witness)
    assert result.comparison.verdict == "agree"
    assert witness.seeds == list(range(1, len(result.pictures) + 1))
    assert (len(witness.seeds) > FIRST_SEEDS) == (noise == LOUD)
    assert len(witness.seeds) <= MAX_SEEDS


def test_a_light_that_is_two_percent_off_is_bought_until_it_is_named(pictures):
    found = Check(balls(), Terms()).against(Noisy(pictures[1.02], LOUD)).comparison
    assert found.verdict == "differ"
    assert [light.name for light in found.lights if light.verdict == "differ"] == ["Fill"]


def test_what_no_budget_decides_is_said_at_once(pictures):
    witness = Noisy(pictures[1.0], HOPELESS)
    found = Check(balls(), Terms()).against(witness).comparison
    assert found.verdict == "undecided"
    assert len(witness.seeds) == FIRST_SEEDS
    (finding,) = [f for f in found.findings if f.code == "noise-too-high"]
    assert finding.object in {"Key", "Fill", ""}
    assert found.least_factor * FIRST_SEEDS > MAX_SEEDS


def test_samples_are_bought_from_the_side_that_lacks_them(monkeypatch):
    monkeypatch.setattr(checking, "OUR_FIRST_SAMPLES", 4)
    soft = balls(radius=0.8)
    witness = Noisy(render(soft, Settings(samples=256, seed=9)).radiance, QUIET / 5.0)
    result = Check(soft, Terms(tolerance=0.004)).against(witness)
    assert result.film.samples.min() > 4
    assert len(witness.seeds) < 2 * FIRST_SEEDS


def test_fixed_samples_are_kept(pictures):
    witness = Noisy(pictures[1.0], LOUD)
    result = Check(balls(), Terms(samples=24)).against(witness)
    assert result.comparison.verdict == "undecided"
    assert (result.film.samples == 24).all()
    assert len(witness.seeds) == FIRST_SEEDS
    assert "noise-too-high" in {f.code for f in result.comparison.findings}


def test_a_time_limit_takes_the_place_of_the_limits_of_samples(pictures):
    """What is `undecided` without one is decided where there is time for more."""
    kept, timed = Noisy(pictures[1.0], LOUDER), Noisy(pictures[1.0], LOUDER)
    assert Check(balls(), Terms()).against(kept).comparison.verdict == "undecided"
    result = Check(balls(), Terms(time_limit=600.0)).against(timed)
    assert result.comparison.verdict == "agree"
    assert len(kept.seeds) <= MAX_SEEDS < len(timed.seeds)


def test_what_no_time_is_left_for_is_said(pictures):
    witness = Noisy(pictures[1.0], QUIET)
    found = Check(balls(), Terms(time_limit=0.0)).against(witness).comparison
    assert found.verdict == "undecided"
    assert len(witness.seeds) == 2
    assert "out-of-time" in {f.code for f in found.findings}
