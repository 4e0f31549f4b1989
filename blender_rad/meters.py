# SPDX-License-Identifier: GPL-3.0-or-later
"""Lux meters and luminance meters in a scene, and grids of them.

A lux meter is a flat cosine receiver: E = Σ_lights ∫ L V cosθ dω over the half space of its normal.
It is a point of the estimator on an instance without triangles, so that nothing ever hits it. Each
light is sampled in `STREAMS` independent sequences, whose spread is its error, and again where that
is more than its part of what may be left. With E₀ its unoccluded irradiance in closed form, f that
of a sample and V whether it is seen, a sequence's estimate is

    Ê = mean(f V) + c (E₀ - mean f)

with c the share of the *other* sequences' samples that are seen. Rays that agree may all have
missed something: to the spread is added E₀/(n + 2), the standard deviation of a share of which n of
n rays were seen (Laplace's rule of succession).
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .arrays import Bools, Floats, Ints
from .direct import DirectLight
from .emitters import emitters
from .errors import Finding, RadError
from .rendering import Settings, render
from .sampling import MAX_POINTS, Points
from .scene import Camera, Instance, Material, Mesh, Scene, Unsupported
from .surfaces import RAY_OFFSET, Surface, dot

STREAMS = 16
STUDENT_15 = 2.131 / 1.960  # 97.5 % quantile of Student's t, 15 degrees of freedom, over normal's
FIRST_POINTS = 2  # of each stream, at least
BATCH = 16384  # rays at once
MAX_METERS = 1_000_000  # in a grid
DARK = 0.1  # of the unoccluded light: readings below it need its absolute error only
LIFT_M = 1e-4  # how far from the surface that it lies on a meter looks
SPOT, SPOT_PIXELS = 1e-4, 8  # tangent of a luminance meter's half field, and how finely it is seen


class Grid(NamedTuple):
    """Cell centres (rows · columns, 3) [m] row by row, and how many there are."""

    points: Floats
    rows: int
    columns: int


def grid(origin: Floats, u: Floats, v: Floats, spacing: float, margin: float = 0.0) -> Grid:
    """Return the cell centres, `spacing` apart, in the middle of a rectangle less its `margin`.

    Parameters
    ----------
    origin, u, v : (3,) a corner and two edges [m]; columns go along `u`, rows along `v`.
    spacing, margin : [m].

    Raises
    ------
    RadError
        Where the margin leaves nothing, and for more than `MAX_METERS` cells.
    """
    steps: list[Floats] = []
    for edge in (u, v):
        length = float(np.linalg.norm(edge))
        if length <= 2.0 * margin:
            size = f"expected a rectangle with edges above {2.0 * margin:g} m, got {length:g} m"
            raise RadError("no room for a meter", "grid", size)
        count = max(round(min((length - 2.0 * margin) / spacing, MAX_METERS + 1)), 1)
        middle = (np.arange(count) - 0.5 * (count - 1)) * spacing
        steps.append((0.5 + middle / length)[:, None] * edge)
    if len(steps[0]) * len(steps[1]) > MAX_METERS:
        raise RadError("too many meters", "grid", f"expected at most {MAX_METERS}")
    points = origin + steps[1][:, None] + steps[0][None]
    return Grid(points.reshape(-1, 3), *points.shape[:2])


class Readings(NamedTuple):
    """What n lux meters read."""

    irradiance: Floats  # (n, 3) [W/m²]
    lights: Floats  # (n, names) illuminance by light [lx]
    standard_error: Floats  # (n,) of the illuminance [lx], for ±1.96 of it to cover 95 %
    unreached: Bools  # (n,) where the error asked for was not reached
    excluded: dict[Unsupported, Bools]  # (n,) by cause that makes a reading doubtful

    @property
    def illuminance(self) -> Floats:
        """(n,) [lx]."""
        return np.asarray(self.lights.sum(axis=1))

    def times(self, factor: float) -> Readings:
        """Return the readings of lights that many times as bright."""
        scaled = (factor * self.irradiance, factor * self.lights, factor * self.standard_error)
        return Readings(*scaled, self.unreached, self.excluded)

    def findings(self) -> list[Finding]:
        """Return what is doubtful about the readings."""
        n = len(self.unreached)
        found = [_doubt(c, f"{m.sum()} of {n} readings") for c, m in self.excluded.items()]
        if self.unreached.any():
            message = f"{self.unreached.sum()} of {n} readings are noisier than asked for"
            found.append(Finding("error-not-reached", "warning", "", message))
        return found


class LuxMeter:
    """Reads illuminance anywhere in a scene.

    Parameters
    ----------
    efficacy : [lm/W].
    error : relative standard error to reach, of a reading or of `DARK` of what would arrive if
        nothing were in the way, where that is more.
    threads : None for all processors.
    """

    def __init__(
        self, scene: Scene, *, efficacy: float, error: float = 1e-3, threads: int | None = None
    ) -> None:
        self.scene, self.error, self.threads = scene, error, threads
        self._light = DirectLight(_with_receiver(scene))
        self.weights = efficacy * np.array(scene.luminance_weights)
        self.names = self._light.names

    def in_model_of(self, scene: Scene) -> LuxMeter:
        """Return a meter for the same scene, read with other lights."""
        other = copy.copy(self)
        other._light = copy.copy(self._light)
        other._light.scene = _with_receiver(scene)
        other._light.emitters, other.names = emitters(scene)
        return other

    def look(self, start: Floats, towards: Floats) -> Look:
        """Return the radiance that arrives at `start` from `towards`, both (3,) [m].

        It is what a picture's pixel there would hold, in a field of 0.01°.
        """
        z = (start - towards) / np.linalg.norm(start - towards)
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        camera = np.eye(4)
        camera[:3, :3] = np.stack([x / np.linalg.norm(x), np.cross(z, x) / np.linalg.norm(x), z], 1)
        camera[:3, 3] = start / self.scene.unit_scale_m
        view = replace(
            self._light.scene,
            camera=Camera("meter", "perspective", camera, (-SPOT, SPOT, -SPOT, SPOT), (0.0, 1e30)),
            resolution=(SPOT_PIXELS, SPOT_PIXELS),
            border=None,
            film_transparent=False,
        )
        light = copy.copy(self._light)
        light.scene = view
        settings = Settings(error=self.error * SPOT_PIXELS, threads=self.threads)
        film = render(view, settings, light=light)
        return Look(
            film.radiance.mean(axis=(0, 1)),
            film.variance.sum(axis=(0, 1)) / film.inside.size**2,
            {name: np.mean(layer, axis=(0, 1), dtype=float) for name, layer in film.lights.items()},
            tuple(film.excluded_by),
        )

    def read(
        self, points: Floats, normals: Floats, progress: Callable[[float], None] = lambda _: None
    ) -> Readings:
        """Return the readings at `points` (n, 3) [m] with unit `normals` (n, 3)."""
        size = BATCH // (STREAMS * FIRST_POINTS)
        starts = range(0, len(points), size)

        def work(start: int) -> Readings:
            rows = slice(start, start + size)
            place = points[rows] / self.scene.unit_scale_m
            return _Few(self, self._light, place, normals[rows], start).readings()

        parts: list[Readings] = []
        with ThreadPoolExecutor(self.threads or os.cpu_count()) as pool:
            for part in pool.map(work, starts):
                parts.append(part)
                progress(len(parts) / len(starts))
        masks = {cause: np.zeros(len(points), bool) for part in parts for cause in part.excluded}
        for start, part in zip(starts, parts, strict=True):
            for cause, mask in part.excluded.items():
                masks[cause][start : start + size] = mask
        *columns, _ = zip(*parts, strict=True)
        irradiance, lights, error, unreached = map(np.concatenate, columns)
        return Readings(irradiance, lights, error, unreached, masks)


class _Few:
    """Some meters, m of them, and what has arrived from each of the scene's emitters so far."""

    def __init__(
        self, meter: LuxMeter, light: DirectLight, points: Floats, normals: Floats, first: int
    ) -> None:
        self.meter, self.light, self.first = meter, light, first
        self.points, self.normals = points, normals
        self.lift = LIFT_M / meter.scene.unit_scale_m + RAY_OFFSET * np.abs(points).max(axis=1)
        self.emitters = [
            e
            for e in light.emitters
            if light.links.lights_others(e.light.name) and "diffuse" in e.light.reaches
        ]
        shape = (len(self.emitters), len(points))
        self.taken = np.zeros((*shape, 1))  # by each stream
        self.sent, self.arrived, self.tested, self.seen = np.zeros((4, *shape, STREAMS))
        self.colour = np.zeros((*shape, 3))  # what has arrived, of all streams
        self.exact = np.full((*shape, 1), np.nan)
        self.excluded: dict[Unsupported, Bools] = {}

    def readings(self) -> Readings:
        everyone = np.arange(len(self.points))
        first = BATCH // (STREAMS * self.exact.size) if self.emitters else 0
        for number, emitter in enumerate(self.emitters):
            exact = emitter.light.irradiance(self.points, self.normals)
            if exact is not None and not emitter.light.is_delta:
                self.exact[number, :, 0] = exact
            self._take(number, everyone, max(first, FIRST_POINTS))
        rgb = np.array([e.light.rgb * (e.layer >= 0) for e in self.emitters]).reshape(-1, 3)
        scale = (rgb @ self.meter.weights)[:, None]
        while True:
            mean, unoccluded, variance = self._estimates()
            lux, variance = scale * mean, scale**2 * variance
            bright = np.abs(lux.sum(axis=0)), DARK * (np.abs(scale) * unoccluded).sum(axis=0)
            target = (self.meter.error * np.maximum(*bright)) ** 2
            missed = variance.sum(axis=0) > target
            even = target / np.maximum(np.count_nonzero(variance, axis=0), 1)
            wanted = missed & (variance > even) & (self.taken[..., 0] < MAX_POINTS)
            if not wanted.any():
                break
            for number in np.flatnonzero(wanted.any(axis=1)):
                self._double(int(number), np.flatnonzero(wanted[number]))
        lights = np.zeros((len(everyone), len(self.meter.names)))
        for emitter, share in zip(self.emitters, lux, strict=True):
            if emitter.layer >= 0:
                lights[:, emitter.layer] += share
        error = np.sqrt(variance.sum(axis=0))
        arrived = self.arrived.sum(axis=2)[..., None]
        hue = np.where(arrived, self.colour / np.where(arrived, arrived, 1.0), rgb[:, None])
        irradiance = np.sum(mean[..., None] * hue, axis=0)
        return Readings(irradiance, lights, error, missed, self.excluded)

    def _estimates(self) -> tuple[Floats, Floats, Floats]:
        """Return what arrives, what would if nothing hid it, and the variance of the first.

        Each is (emitters, m), over the luminance of the lights' `rgb`.
        """
        known = np.isfinite(self.exact)
        sent, arrived = self.sent / self.taken, self.arrived / self.taken
        tested, seen = (n.sum(axis=2, keepdims=True) - n for n in (self.tested, self.seen))
        share = np.divide(seen, tested, out=np.ones_like(seen), where=tested > 0.0)
        arrived += np.where(known, share * (self.exact - sent), 0.0)
        unoccluded = np.where(known, self.exact, sent).mean(axis=2)
        variance = STUDENT_15**2 * arrived.var(axis=2, ddof=1) / STREAMS
        if self.light.visibility.opaque.count:
            sampled = [not e.light.is_delta and e.light.cast_shadow for e in self.emitters]
            unseen = unoccluded / (STREAMS * self.taken[..., 0] + 2.0)
            variance += np.array(sampled, dtype=bool)[:, None] * unseen**2
        return arrived.mean(axis=2), unoccluded, variance

    def _double(self, number: int, rows: Ints) -> None:
        """Take as many samples again: the more often one looks, the sooner chance ends it."""
        most = int(self.taken[number, rows].max())
        points, enough = max(BATCH // (STREAMS * len(rows)), 1), min(2 * most, MAX_POINTS)
        for taken in range(most, enough, points):
            self._take(number, rows, min(points, enough - taken))

    def _take(self, number: int, rows: Ints, points: int) -> None:
        """Add samples of an emitter to each stream of the meters `rows`; of a delta light one."""
        emitter, taken = self.emitters[number], self.taken[number, rows]
        shape = (len(rows), STREAMS, points)
        if emitter.light.is_delta:
            shape = (len(rows), 1, 1)
        meter, stream, index = np.broadcast_arrays(
            (self.first + rows)[:, None, None],
            np.arange(shape[1])[:, None],
            taken[..., None] + np.arange(shape[2]),
        )
        uniform = Points(meter.ravel(), stream.ravel(), index.ravel(), 0)
        u = uniform.pair(number)
        surface = self._surface(np.repeat(rows, shape[1] * shape[2]))
        sample = emitter.light.sample(surface.point, surface.normal, u)
        sent = np.maximum(sample.weight * dot(surface.normal, sample.wi), 0.0)
        weights = self.meter.weights
        rgb, arrived = emitter.light.rgb, np.zeros(len(sent))
        if sample.tint is not None:
            sent *= (rgb * sample.tint) @ weights / (rgb @ weights)
        one = copy.copy(self.light)
        one.emitters = [emitter]
        for arrival in one.arrivals(surface, lambda *_: np.zeros(len(sent)), lambda _: u):
            arrived += arrival.rgb @ weights / (rgb @ weights)
            colour = arrival.rgb.reshape(len(rows), -1, 3).sum(axis=1)
            self.colour[number, rows] += colour * (STREAMS / shape[1])  # delta: all streams' one
            for exclusion in arrival.exclusions:
                mask = self.excluded.setdefault(exclusion.cause, np.zeros(len(self.points), bool))
                mask[rows[exclusion.rows // (shape[1] * shape[2])]] = True
        for sums, values in (
            (self.sent, sent),
            (self.tested, sent > 0.0),
            (self.arrived, arrived),
            (self.seen, arrived > 0.0),
        ):
            sums[number, rows] += values.reshape(shape).sum(axis=2)
        self.taken[number, rows] += shape[2]

    def _surface(self, rows: Ints) -> Surface:
        n, normal = len(rows), self.normals[rows]
        zeros, nought = np.zeros(n, dtype=np.int64), np.zeros(n)
        return Surface(
            point=self.points[rows],
            geometric_normal=normal,
            normal=normal,
            material=zeros,
            instance=zeros + len(self.light.scene.instances) - 1,
            triangle=zeros,
            u=nought,
            v=nought,
            incoming=normal,
            epsilon=self.lift[rows],
            cutoff=nought,
        )


def _with_receiver(scene: Scene) -> Scene:
    """Return the scene with one more instance, last: black and without triangles."""
    corners, none = np.zeros((0, 3), np.int32), np.zeros(0, np.int32)
    mesh = Mesh("meter", corners.astype(np.float32), corners, None, none.astype(bool), none)
    place = Instance("meter", len(scene.meshes), np.eye(4), (len(scene.materials),))
    return replace(
        scene,
        meshes=(*scene.meshes, mesh),
        materials=(*scene.materials, Material("meter")),
        instances=(*scene.instances, place),
    )


class Look(NamedTuple):
    """What a luminance meter reads."""

    radiance: Floats  # (3,) [W/(m² sr)]
    variance: Floats  # (3,) of its mean
    lights: dict[str, Floats]  # by light, what surfaces reflect of it (3,) [W/(m² sr)]
    excluded: tuple[Unsupported, ...]  # why the reading is doubtful

    def standard_error(self, weights: Floats) -> float:
        """Return that of the luminance [cd/m²], were the channels' noise all the same."""
        return float(np.sqrt(self.variance) @ weights)

    def findings(self) -> list[Finding]:
        """Return what is doubtful about the reading."""
        return [_doubt(cause, "the luminance") for cause in self.excluded]


def _doubt(cause: Unsupported, what: str) -> Finding:
    message = f"{cause.feature} is not supported; {what} may lack light or shadow of it"
    return Finding("unsupported", "warning", cause.name, message)
