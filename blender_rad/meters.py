# SPDX-License-Identifier: GPL-3.0-or-later
"""Lux meters and luminance meters in a scene, and grids of them.

A lux meter is a flat cosine receiver: E = Σ_lights ∫ L V cosθ dω over the half space of its normal.
It is a point of the estimator on an instance without triangles, so that nothing ever hits it. Each
light is sampled in `STREAMS` independent sequences, whose spread is its error, and again where that
is more than its part of what may be left. Rays that agree may all have missed something: to the
spread is added 1/(n + 2) of the unoccluded light, the standard deviation of a share of which n of
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
from numpy.typing import NDArray

from .direct import DirectLight
from .emitters import Emitter, emitters
from .errors import Finding, RadError
from .rendering import Settings, render
from .sampling import MAX_POINTS, Points
from .scene import Camera, Instance, Material, Mesh, Scene, Unsupported
from .surfaces import RAY_OFFSET, Surface, dot

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STREAMS = 16
STUDENT_15 = 2.131 / 1.960  # 97.5 % quantile of Student's t, 15 degrees of freedom, over normal's
FIRST_POINTS = 8  # of each stream
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
    """What n lux meters read.

    Attributes
    ----------
    irradiance : (n, 3) [W/m²].
    lights : (n, names) illuminance by light [lx].
    standard_error : (n,) of the illuminance [lx], for ±1.96 of it to cover 95 %.
    unreached : (n,) bool, where the error asked for was not reached.
    excluded : (n,) bool for each cause that makes a reading doubtful.
    """

    irradiance: Floats
    lights: Floats
    standard_error: Floats
    unreached: NDArray[np.bool_]
    excluded: dict[Unsupported, NDArray[np.bool_]]

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
        settings = Settings(error=self.error * SPOT_PIXELS, threads=self.threads)
        film = render(view, settings, light=self._light)
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
        return Readings(
            np.concatenate([part.irradiance for part in parts]),
            np.concatenate([part.lights for part in parts]),
            np.concatenate([part.standard_error for part in parts]),
            np.concatenate([part.unreached for part in parts]),
            masks,
        )


class _Few:
    """Some meters, m of them, and what has arrived from each of the scene's emitters so far."""

    def __init__(
        self, meter: LuxMeter, light: DirectLight, points: Floats, normals: Floats, first: int
    ) -> None:
        self.error, self.weights, self.names = meter.error, meter.weights, meter.names
        self.light, self.points, self.normals, self.first = light, points, normals, first
        self.lift = LIFT_M / meter.scene.unit_scale_m + RAY_OFFSET * np.abs(points).max(axis=1)
        self.emitters = light.emitters
        shape = (len(self.emitters), len(points))
        self.sums = np.zeros((*shape, STREAMS))
        self.taken = np.zeros(shape, dtype=np.int64)  # by each stream
        self.open = np.zeros(shape)  # unoccluded irradiance
        self.excluded: dict[Unsupported, NDArray[np.bool_]] = {}

    def readings(self) -> Readings:
        everyone = np.arange(len(self.points))
        for number, emitter in enumerate(self.emitters):
            if not emitter.light.is_delta and emitter.light.cast_shadow:
                self.open[number] = self._unoccluded(emitter, everyone)
            self._take(number, everyone, 1 if emitter.light.is_delta else FIRST_POINTS)
        rgb = np.array([e.light.rgb * (e.layer >= 0) for e in self.emitters]).reshape(-1, 3)
        scale = rgb @ self.weights
        while True:
            mean, variance = self._estimates(scale)
            target = np.maximum(np.abs(mean.sum(axis=0)), DARK * np.abs(scale) @ self.open)
            target = (self.error * target) ** 2
            missed = variance.sum(axis=0) > target
            even = target / np.maximum(np.count_nonzero(variance, axis=0), 1)
            wanted = missed & (variance > even) & (self.taken < MAX_POINTS)
            if not wanted.any():
                break
            for number in np.flatnonzero(wanted.any(axis=1)):
                rows = np.flatnonzero(wanted[number])
                self._take(int(number), rows, max(BATCH // (STREAMS * len(rows)), FIRST_POINTS))
        layers = np.zeros((len(self.names), len(everyone)))
        known = [k for k, e in enumerate(self.emitters) if e.layer >= 0]
        np.add.at(layers, [self.emitters[k].layer for k in known], mean[known])
        irradiance = (self.sums.mean(axis=2) / self.taken).T @ rgb
        error = np.sqrt(variance.sum(axis=0))
        return Readings(irradiance, layers.T, error, missed, self.excluded)

    def _estimates(self, scale: Floats) -> tuple[Floats, Floats]:
        """Return illuminances and their variances, each (emitters, m), [lx] and [lx²]."""
        means = self.sums / self.taken[..., None]
        spread = means.var(axis=2, ddof=1) / STREAMS
        unseen = self.open / (STREAMS * self.taken + 2.0)
        variance = STUDENT_15**2 * spread + (unseen if self._shadows else 0.0) ** 2
        return means.mean(axis=2) * scale[:, None], variance * scale[:, None] ** 2

    @property
    def _shadows(self) -> bool:
        return self.light.visibility.opaque.count > 0

    def _unoccluded(self, emitter: Emitter, rows: Ints) -> Floats:
        """Return what would arrive (m,) if nothing were in the way, over the light's `rgb`."""
        exact = emitter.light.irradiance(self.points, self.normals)
        if exact is not None and np.isfinite(exact).all():
            return exact
        normals = np.repeat(self.normals, FIRST_POINTS, axis=0)
        uniform = self._uniform(rows, np.zeros_like(rows), 1, FIRST_POINTS)
        points = np.repeat(self.points, FIRST_POINTS, axis=0)
        sample = emitter.light.sample(points, normals, uniform.pair(0))
        value = sample.weight * np.maximum(dot(normals, sample.wi), 0.0)
        return value.reshape(-1, FIRST_POINTS).mean(axis=1)

    def _uniform(self, rows: Ints, taken: Ints, streams: int, points: int) -> Points:
        """Return random points, (meter, stream, point) in this order."""
        meter, stream, index = np.broadcast_arrays(
            (self.first + rows)[:, None, None],
            np.arange(streams)[:, None],
            taken[:, None, None] + np.arange(points),
        )
        return Points(meter.ravel(), stream.ravel(), index.ravel(), 0)

    def _take(self, number: int, rows: Ints, points: int) -> None:
        """Add `points` samples of each stream of an emitter to the meters `rows`."""
        emitter = self.emitters[number]
        taken = self.taken[number, rows]
        points = min(points, MAX_POINTS - int(taken.max()))
        streams = 1 if emitter.light.is_delta else STREAMS
        uniform = self._uniform(rows, taken, streams, points)
        one = copy.copy(self.light)
        one.emitters = [emitter]
        each = streams * points
        group = np.repeat(np.arange(len(rows) * streams), points)
        surface = self._surface(np.repeat(rows, each))
        for arrival in one.arrivals(surface, group, lambda _: uniform.pair(number)):
            sums = arrival.irradiance.reshape(len(rows), streams, points).sum(axis=2)
            self.sums[number, rows] += sums
            for exclusion in arrival.exclusions:
                mask = self.excluded.setdefault(exclusion.cause, np.zeros(len(self.points), bool))
                mask[rows[exclusion.rows // each]] = True
        self.taken[number, rows] += points

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
            epsilon=self.lift[rows],
            smooth=zeros.astype(bool),
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
    """What a luminance meter reads.

    Attributes
    ----------
    radiance, variance : (3,) [W/(m² sr)], and of its mean.
    lights : by light, what surfaces reflect of it (3,) [W/(m² sr)].
    excluded : why the reading is doubtful.
    """

    radiance: Floats
    variance: Floats
    lights: dict[str, Floats]
    excluded: tuple[Unsupported, ...]

    def standard_error(self, weights: Floats) -> float:
        """Return that of the luminance [cd/m²], were the channels' noise all the same."""
        return float(np.sqrt(self.variance) @ weights)

    def findings(self) -> list[Finding]:
        """Return what is doubtful about the reading."""
        return [_doubt(cause, "the luminance") for cause in self.excluded]


def _doubt(cause: Unsupported, what: str) -> Finding:
    message = f"{cause.feature} is not supported; {what} may lack light or shadow of it"
    return Finding("unsupported", "warning", cause.name, message)
