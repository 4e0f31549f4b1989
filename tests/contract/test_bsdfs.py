# SPDX-License-Identifier: GPL-3.0-or-later
"""What every lobe must keep, held against quadrature over all directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from inspect import isabstract

import numpy as np
import pytest

from blender_rad.bsdfs import BSDFS, Frame, Lobe, Mixture

Array = np.ndarray
COSINES = {"normal": 1.0, "steep": 0.75, "slant": 0.3, "grazing": 0.02}
CELLS, ORDERS = 15, (16, 10)  # a side, and of Gauss' rules in a cell, which tell their error
SAMPLES, PILOT = 16_000, 2000
LEAST = 10.0  # samples expected in a cell that is judged by itself
SIGMAS = 4.3  # one in 100 000, of about a thousand comparisons; all seeds are fixed
QUADRATURE = 0.01  # error of the whole, for the tests to mean something
ROUGH = 3e-4  # error where both rules err alike
ENERGY = 2e-3  # beyond 1: fits of lost energy


def lobe_classes() -> list[type[Lobe]]:
    len(BSDFS)  # loads all files
    found: list[type[Lobe]] = []
    rest: list[type[Lobe]] = [Lobe]
    while rest:
        rest += (found_now := rest.pop(0)).__subclasses__()
        found.append(found_now)
    ours = [c for c in found if c.__module__.startswith("blender_rad.") and not isabstract(c)]
    return sorted(ours, key=lambda c: c.__name__)


def frame_of(n: int, tilted: bool = True, flipped: bool = False) -> Frame:
    """Return one frame n times: the world's own, or one along none of its axes."""
    axes = np.eye(3)
    if tilted:
        axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    if flipped:
        axes = axes * [1.0, -1.0, -1.0]
    return Frame(*(np.asfortranarray(np.tile(axis, (n, 1))) for axis in axes.T))


def directions(cosine: Array, turn: Array, frame: Frame) -> Array:
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    return frame.world(np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine]).T)


@dataclass(frozen=True)
class Case:
    """An example of a class at a ω_o; k = −1 is the mixture of all examples."""

    cls: type[Lobe]
    k: int
    cosine: float

    def wo(self, n: int) -> tuple[Array, Frame]:
        frame = frame_of(n, tilted=self.cosine < 1.0)
        return directions(np.full(n, self.cosine), np.full(n, 0.7), frame), frame

    def at(self, n: int) -> Lobe | Mixture:
        parts = self.cls.examples(*self.wo(n))
        return Mixture.of(parts) if self.k < 0 else parts[self.k]


@dataclass(frozen=True)
class Sphere:
    """All directions, in cells of polar angle and azimuth with edges at quantiles of samples."""

    frame: Frame
    edges: tuple[Array, Array]

    @classmethod
    def of(cls, samples: Array, frame: Frame) -> Sphere:
        quantiles = np.linspace(0.0, 1.0, CELLS)
        theta, phi = (np.quantile(angle, quantiles) for angle in angles(samples, frame))
        theta = np.union1d(theta, [0.0, 0.5 * np.pi, np.pi])  # with the horizon
        return cls(frame, (theta, np.union1d(phi, [0.0, 2.0 * np.pi])))

    def counts(self, samples: Array) -> Array:
        """Return how many samples are in each cell, flat."""
        return np.histogram2d(*angles(samples, self.frame), self.edges)[0].ravel()

    def integrals(self, function: Callable[[Array], Array], order: int) -> Array:
        """Return integrals over each cell of a function (k, m) of directions, by Gauss' rule."""
        nodes, weights = np.polynomial.legendre.leggauss(order)
        (theta, a), (phi, b) = (
            ((edge[:-1, None] + np.outer(np.diff(edge), 0.5 + 0.5 * nodes)).ravel(),
             np.outer(np.diff(edge), weights))
            for edge in self.edges
        )  # fmt: skip
        grid = np.meshgrid(np.cos(theta), phi, indexing="ij")
        values = function(directions(grid[0].ravel(), grid[1].ravel(), self.frame))
        values = values.reshape(len(a), order, len(b), order, -1)
        a = a * np.sin(theta).reshape(a.shape)
        cells = np.einsum("iajbm,ia,jb->ijm", values, 0.5 * a, 0.5 * b, optimize=True)
        return cells.reshape(-1, values.shape[-1])


def angles(samples: Array, frame: Frame) -> tuple[Array, Array]:
    x, y, z = frame.local(samples).T
    return np.arccos(np.clip(z, -1.0, 1.0)), np.arctan2(y, x) % (2.0 * np.pi)


def cases() -> Iterator[object]:
    for cls in lobe_classes():
        count = len(cls.examples(*Case(cls, 0, 1.0).wo(1)))
        for k in range(-1 if count > 1 else 0, count):
            for name, cosine in COSINES.items():
                if k < 0 and cosine > 0.5:
                    continue
                yield pytest.param(Case(cls, k, cosine), id=f"{cls.__name__}-{k}-{name}")


def sample(case: Case, n: int, seed: int) -> tuple[Array, Array]:
    """Return directions found (k, 3), and f |cosθ_i|/p of all (n, 3)."""
    lobe = case.at(n)
    wi = lobe.sample(np.random.default_rng(seed).random((n, 2)))
    length = np.linalg.norm(wi, axis=1)
    hit = length > 0.0
    assert np.allclose(length[hit], 1.0, atol=1e-9)
    value, density = lobe.evaluate(wi)
    assert (density[hit] > 0.0).all(), "a density where it samples"
    ratio = np.broadcast_to(value / np.maximum(density, 1e-300)[:, None], (n, 3))
    return wi[hit], ratio * hit[:, None]


@pytest.mark.parametrize("case", list(cases()))
def test_samples_follow_the_density_and_find_the_albedo(case):
    sphere = Sphere.of(sample(case, PILOT, 1)[0], case.wo(1)[1])

    def density_and_value(wi: Array) -> Array:
        value, density = case.at(len(wi)).evaluate(wi)
        assert (value >= 0.0).all() and (density >= 0.0).all(), "positivity"
        assert (density[(value > 0.0).any(axis=1)] > 0.0).all(), "what is never sampled is missing"
        return np.concatenate([density[:, None], np.broadcast_to(value, (len(wi), 3))], axis=1)

    integrals, rougher = (sphere.integrals(density_and_value, order) for order in ORDERS)
    errors = np.abs(integrals - rougher)
    whole, slack = integrals.sum(axis=0), errors.sum(axis=0) + ROUGH
    assert (slack < QUADRATURE).all()
    wi, ratio = sample(case, SAMPLES, 2)
    failed = 1.0 - len(wi) / SAMPLES
    spread = np.sqrt(failed * (1.0 - failed) / SAMPLES)
    assert abs(whole[0] - 1.0 + failed) < SIGMAS * spread + slack[0], "1 less failures"
    expected, error = SAMPLES * integrals[:, 0], SAMPLES * errors[:, 0]
    counts, own = sphere.counts(wi), expected > LEAST
    off = np.append((counts - expected)[own], (counts - expected)[~own].sum())
    variance = np.append((expected + error**2)[own], (expected + error**2)[~own].sum() + 1.0)
    assert normal_deviate(float(np.sum(off**2 / variance)), len(off)) < SIGMAS
    allowed = SIGMAS * ratio.std(axis=0) / np.sqrt(SAMPLES) + slack[1:]
    assert (np.abs(ratio.mean(axis=0) - whole[1:]) < allowed).all()
    if case.cls.conserves and case.k >= 0:
        assert (whole[1:] < 1.0 + ENERGY + slack[1:]).all()


def normal_deviate(chi_squared: float, degrees: int) -> float:
    """Return the normal deviate of the same probability (Wilson and Hilferty, 1931)."""
    step = 2.0 / (9.0 * degrees)
    return ((chi_squared / degrees) ** (1.0 / 3.0) - 1.0 + step) / np.sqrt(step)


@pytest.mark.parametrize("cls", lobe_classes())
def test_lobes_are_reciprocal_finite_and_sliced(cls, rng):
    n = 2000
    frame, back = frame_of(n), frame_of(n, flipped=cls.transmits)
    a, b = (directions(np.sqrt(rng.random(n)), 6.283 * rng.random(n), f) for f in (frame, back))
    rows = rng.permutation(n)[:300]
    u = rng.random((n, 2))
    for there, again in zip(cls.examples(a, frame), cls.examples(b, back), strict=True):
        whole, whole_density = there.evaluate(b)
        part, part_density = there.at(rows).evaluate(b[rows])
        assert np.array_equal(part, whole[rows]) and np.array_equal(
            part_density, whole_density[rows]
        )
        assert np.array_equal(there.at(rows).sample(u[rows]), there.sample(u)[rows])
        assert np.array_equal(there.at(rows).weight, there.weight[rows])
        assert np.isfinite(there.albedo()).all() and (there.albedo() >= 0.0).all()
        f_there = there.weight * whole / np.abs(np.sum(b * frame.z, axis=1))[:, None]
        f_again = again.weight * again.evaluate(a)[0] / np.abs(np.sum(a * frame.z, axis=1))[:, None]
        alike = np.allclose(f_there, f_again, rtol=1e-7, atol=1e-9 * f_there.max())
        assert alike == cls.reciprocal, "what is not promised must be seen to fail"


@pytest.mark.parametrize("cls", lobe_classes())
@pytest.mark.parametrize("cosine", [1.0, 0.5, 1e-4, 1e-9])
def test_lobes_are_finite_everywhere(cls, cosine, rng):
    n = 64
    wo, frame = Case(cls, 0, cosine).wo(n)
    mirrored = 2.0 * np.sum(wo * frame.z, axis=1)[:, None] * frame.z - wo
    edge = rng.choice([0.0, 1e-300, 1e-12, 1e-4, -1e-12], n)
    around = directions(edge, 6.283 * rng.random(n), frame)
    corners = [np.zeros(2), np.array([0.0, 1.0 - 2**-53]), np.full(2, 1.0 - 2**-53)]
    for lobe in cls.examples(wo, frame):
        for wi in (wo, -wo, mirrored, frame.z, -frame.z, frame.x, around, np.zeros_like(wo)):
            value, density = lobe.evaluate(wi)
            assert np.isfinite(value).all() and np.isfinite(density).all()
            assert (value >= 0.0).all() and (density >= 0.0).all()
        for corner in corners:
            assert np.isfinite(lobe.sample(np.tile(corner, (n, 1)))).all()
