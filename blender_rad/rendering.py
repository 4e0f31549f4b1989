# SPDX-License-Identifier: GPL-3.0-or-later
"""From a scene to a film: camera samples in rounds, to the pixels that need them, on threads.

A pixel's samples are dealt to `STREAMS` independent low-discrepancy sequences in turn; the spread
of the streams gives its variance. The first round goes to all pixels. Then, for a target error,
further samples are shared out where they help most: in proportion to a pixel's standard deviation
over its signal, estimated from its neighbours. Its own samples must not tell: pixels whose samples
happen to miss what is bright would get no more of them, and the mean would be too dark.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .cameras import CameraRays, camera_rays, view_depth
from .closures import Closures
from .crowds import gathered
from .direct import DirectLight, Share, Sightings
from .emitters import WORLD_NAME, world_lights
from .errors import RadError
from .film import Film, lift, neighbourhood_mean
from .holdouts import Holdouts
from .measurement import Measurement
from .pixels import Batch, Pixels
from .sampling import MAX_POINTS, Points
from .scene import Camera, Material, Scene, Unsupported
from .shading import Shading
from .surfaces import Surface, dot, normalized, pick
from .transparency import shaded_layers

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Progress = Callable[[float], None]
Arrived = Callable[[Callable[[], Film]], None]  # given what develops the film so far
T = TypeVar("T", bound=np.generic)

STREAMS = 2  # the fewest that tell of a spread: points spread the more evenly, the longer a stream
BATCH = 20480  # camera samples worked off at a time, so that arrays stay near the processor
MAX_SAMPLES = MAX_POINTS
ANOTHER_SEED = 0x10001  # between surfaces behind each other
BEHIND = "Measured sockets behind transparent surfaces"
DOUBT = 1e-4  # of a pixel's radiance: what may be wrong of it
DARK = 0.05  # of the picture's mean: what counts for a pixel's radiance at least
BLUR = 2  # times that doubts are averaged over 3×3 pixels
EDGES = "Measured sockets on slivers"
GROWTH = 4.0  # a pixel's samples grow at most so many times from one decision to the next


@dataclass(frozen=True)
class Settings:
    """How long and how well to render.

    Attributes
    ----------
    samples : camera samples a pixel; None samples until `error`.
    error : target of `Film.relative_standard_error`.
    per_light : whether to keep a layer for each light.
    threads : None for all cores.
    time_limit : [s] after which the samples so far make the picture; None for no limit.
    seed : of the randomisation.
    """

    samples: int | None = None
    error: float = 0.01
    per_light: bool = True
    threads: int | None = None
    time_limit: float | None = None
    seed: int = 0


class CancelledError(Exception):
    """The render was asked to stop."""


def render(
    scene: Scene,
    settings: Settings | None = None,
    *,
    light: DirectLight | None = None,
    progress: Progress | None = None,
    cancel: threading.Event | None = None,
    arrived: Arrived | None = None,
) -> Film:
    """Return the direct light of `scene` as its camera sees it.

    Parameters
    ----------
    light : what was built for this scene before; None builds it.
    progress : called with the share of the work done, 0 to 1, as far as it can be foreseen.
    cancel : set from elsewhere to stop.
    arrived : called after each round of samples, in the caller's thread.

    Raises
    ------
    RadError
        When the scene has no camera, or for more samples than the sequences have points.
    CancelledError
        When `cancel` was set.
    """
    if scene.camera is None:
        raise RadError("no camera", scene.file, "expected a scene with an active camera")
    settings = settings or Settings()
    if (settings.samples or 1) > MAX_SAMPLES:
        asked = f"{settings.samples} samples a pixel"
        raise RadError(asked, scene.file, f"expected at most {MAX_SAMPLES}")
    light = light or DirectLight(scene)
    light = gathered(light, scene, scene.camera, per_light=settings.per_light)
    run = _Run(scene, scene.camera, settings, light, progress=progress, cancel=cancel)
    run.arrived = arrived or run.arrived
    return run.film()


class _Run:
    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        settings: Settings,
        light: DirectLight,
        *,
        progress: Progress | None,
        cancel: threading.Event | None,
    ) -> None:
        self.scene, self.camera, self.settings = scene, camera, settings
        self.light = light
        materials = [Material(m.name) if m.held_out else m for m in scene.materials]
        geometry = light.geometry
        self.holdouts = Holdouts(scene, geometry, light.transmission)
        self.albedo, self.emission = (
            Shading(scene, geometry, name, materials) for name in ("albedo", "emission")
        )
        self.closures = Closures(scene, geometry)
        self.measurement = Measurement(scene, camera, geometry, light.visibility.camera)
        self.unsupported = [m.unsupported for m in scene.materials]
        # Causes, pixels and doubts, appended by threads, atomically:
        self.excluded: list[tuple[Unsupported, Ints, Floats]] = []
        self.world = world_lights(scene)
        self.inside = _inside(scene)
        self.place = np.flatnonzero(self.inside)  # row of the sums -> pixel of the frame
        self.shaded = shaded_layers(scene)
        self.layers = {name: index for index, name in enumerate(light.names)}
        self.layer_of = np.array([self.layers.get(i.name, -1) for i in scene.instances], dtype=int)
        layers = len(self.light.names) if settings.per_light else 0
        self.sums = Pixels(layers, len(self.place), STREAMS)
        numbered = len(light.emitters) + len(light.crowds)
        self.sightings = Sightings(numbered, len(self.place), STREAMS)
        self.progress = progress or (lambda share: None)
        self.arrived: Arrived = lambda _: None
        self.cancel = cancel or threading.Event()
        limit = settings.time_limit
        self.deadline = np.inf if limit is None else time.monotonic() + limit
        self.late = False

    # --- scheduling ---------------------------------------------------------------------------

    def film(self) -> Film:
        """Take all samples and return the picture."""
        with ThreadPoolExecutor(self.settings.threads or os.cpu_count()) as pool:
            if self.settings.samples is not None:
                self._take_fixed(pool, self.settings.samples)
            else:
                self._take_until(pool, self.settings.error)
        return self._developed()

    def _take_fixed(self, pool: ThreadPoolExecutor, samples: int) -> None:
        everyone = np.arange(len(self.place))
        for taken in range(0, samples, STREAMS):
            count = min(STREAMS, samples - taken)
            self._round(pool, everyone, count, (taken / samples, (taken + count) / samples))

    def _take_until(self, pool: ThreadPoolExecutor, error: float) -> None:
        self._round(pool, np.arange(len(self.place)), STREAMS, (0.0, 0.0))
        while not self.late:
            wanted, share = self._wanted_steps(error)
            if not wanted.any():
                break
            rows = np.flatnonzero(wanted)
            most_first = np.argsort(-wanted[rows].astype(np.int16), kind="stable")  # by radix
            rows = rows[most_first]
            self._round(pool, rows, STREAMS, (share, share), wanted[rows])

    def _wanted_steps(self, error: float) -> tuple[Ints, float]:
        """Return how many more steps each pixel should have (n,), and the share of work done."""
        signal, ratio = self.sums.radiance()
        floor = 0.01 * np.mean(signal, axis=0) ** 2
        lifted = lift(self._framed(signal.mean(axis=1)), self.inside).reshape(-1)[self.place]
        signal /= lifted[:, None]
        signal *= signal
        signal += np.maximum(floor, np.finfo(float).tiny)
        ratio /= signal
        relative = (ratio[:, 0] + ratio[:, 1] + ratio[:, 2]) / 3.0
        if np.mean(relative) <= error**2:
            return np.zeros(len(relative), dtype=np.int64), 1.0
        taken = self.sums.taken // STREAMS
        spread = self._framed(relative * taken)
        near = neighbourhood_mean(spread, self.inside, own=False).reshape(-1)[self.place]
        told = np.mean(near / taken)  # of pixels whose neighbours are as noisy as themselves, all
        near = near * max(np.mean(relative) / told, 1.0) if told > 0.0 else np.full_like(near, 1.0)
        one_step = np.sqrt(near)
        wanted = one_step * (np.mean(one_step) / error**2)
        most = np.minimum(np.ceil(GROWTH * taken), MAX_SAMPLES // STREAMS)
        wanted = np.clip(np.ceil(wanted), taken, most)
        share = min(1.0, float(error**2 / np.mean(relative)))
        return wanted.astype(np.int64) - taken, share

    def _round(
        self,
        pool: ThreadPoolExecutor,
        rows: Ints,
        count: int,
        share: tuple[float, float],
        times: Ints | None = None,
    ) -> None:
        """Take the next `count` samples of the pixels `rows`, once or several `times` (n,) over."""
        if self.late:
            return
        size = max([1, *(c.batches for c in self.light.crowds)]) * max(BATCH // count, 1)
        times = np.ones(len(rows), dtype=np.int64) if times is None else times
        batches = [slice(k, k + size) for k in range(0, len(rows), size)]
        jobs = [pool.submit(self._batch, rows[part], count, times[part]) for part in batches]
        try:
            for number, job in enumerate(jobs):
                job.result()
                self.progress(share[0] + (share[1] - share[0]) * (number + 1) / len(jobs))
        except BaseException:
            self.cancel.set()
            wait(jobs, return_when=FIRST_EXCEPTION)
            raise
        self.arrived(self._developed)

    def _batch(self, rows: Ints, count: int, times: Ints) -> None:
        for step in range(int(times.max())):
            if self.cancel.is_set():
                raise CancelledError
            if time.monotonic() > self.deadline and self.sums.taken[rows].all():
                self.late = True
                return
            self._trace(rows[times > step], count)

    # --- one batch ----------------------------------------------------------------------------

    def _trace(self, rows: Ints, count: int) -> None:
        """Take the next `count` samples, a whole step of `STREAMS` or the last, of `rows` (p,)."""
        batch, seen = self._look(rows, count)
        for stream in range(count):
            batch.add(batch.by_pixel(seen)[:, stream], self.sums.streams[stream])
        self.sums.taken[batch.span] += count

    def _look(
        self,
        rows: Ints,
        count: int,
        rays: CameraRays | None = None,
        weight: Floats | None = None,
        passed: int = 0,
    ) -> tuple[Batch, Floats]:
        """Return what the next samples see (samples, 3), in view or along `rays`.

        The rays have `passed` transparent surfaces, which let `weight` (samples, 3) of it pass.
        """
        pixel = np.repeat(self.place[rows], count)
        index = np.repeat(self.sums.taken[rows] // STREAMS, count)
        stream = np.tile(np.arange(count), len(rows))
        uniform = Points(pixel, stream, index, self.settings.seed + passed * ANOTHER_SEED)
        where = None
        if rays is None:
            where = self._positions(pixel, uniform.pair(0))
            lens = uniform.pair(-1) if self.camera.aperture else None
            rays = camera_rays(self.camera, self.scene.resolution, where, lens)
        hits = self.light.visibility.camera.intersect(rays.origins, rays.directions)
        met = (hits.instance >= 0) & (hits.distance <= rays.reach)
        batch = Batch(rows, count, np.flatnonzero(met), weight)
        radiance = self._background(batch, rays, met, hits.distance)
        if len(batch.hits):
            directions = pick(rays.directions, batch.hits)
            surface = self.light.geometry.surface(hits.take(batch.hits), directions)
            if where is not None and self.scene.measured is not None:
                surface = self._measured(batch, surface, pick(where, batch.hits))
            leaving = self._surfaces(batch, surface)
            if self.holdouts.exist:
                held = batch.weighed(batch.spread(self.holdouts.at(surface)))
                self.sums.alpha[batch.span] -= batch.total(held.mean(axis=1))
            if passed < self.shaded:
                share = self.sightings.of(rows[batch.pixel_of_hit], stream.take(batch.hits))
                points = uniform.take(batch.hits)
                leaving += self._reflected(batch, surface, share, points, passed)
            radiance += batch.spread(leaving)
            if passed < self.shaded and self.light.transmission.seen_through:
                self._look_through(batch, surface, rays, passed, radiance)
        return batch, radiance

    def _look_through(
        self, batch: Batch, surface: Surface, rays: CameraRays, passed: int, radiance: Floats
    ) -> None:
        """Add what is seen behind the surfaces to `radiance` (samples, 3).

        Pixels are looked through whole: those of their samples that nothing passes look again at
        what they have seen, with no weight.
        """
        share = batch.spread(self.light.transmission.at(surface))
        passing = share.any(axis=1)
        pixels = np.flatnonzero(batch.by_pixel(passing).any(axis=1))
        if not len(pixels):
            return
        beyond = surface.point - surface.geometric_normal * surface.epsilon[:, None]
        origins = np.where(passing[:, None], batch.spread(beyond), rays.origins)
        reach = rays.reach - dot(origins - rays.origins, rays.directions)
        samples = (pixels[:, None] * batch.each + np.arange(batch.each)).reshape(-1)
        further = CameraRays(*(part.take(samples, axis=0) for part in (origins, rays[1], reach)))
        share = share.take(samples, axis=0)
        weight = share if batch.weight is None else share * batch.weight.take(samples, axis=0)
        _, behind = self._look(batch.rows[pixels], batch.each, further, weight, passed + 1)
        radiance[samples] += share * behind

    def _surfaces(self, batch: Batch, surface: Surface) -> Floats:
        """Return the emission (k, 3) that is seen; note normals, depth and what is excluded."""
        sums, span = self.sums, batch.span
        if batch.weight is None:
            batch.add(batch.total(batch.spread(surface.normal)), sums.normal)
            depth = np.full(batch.count, np.inf)
            depth[batch.hits] = view_depth(self.camera, surface.point)
            sums.depth[span] = reduce(np.minimum, batch.by_pixel(depth).T, sums.depth[span])
        materials = np.flatnonzero(np.bincount(surface.material))
        for material in materials:
            unmeasured = self.scene.materials[material].measured and surface.subpixel is None
            if not unmeasured and not self.unsupported[material]:
                continue
            rows = np.flatnonzero(surface.material == material)
            for cause in self.unsupported[material]:
                self._exclude(batch, batch.hits[rows], cause)
            if unmeasured:
                self._unmeasured(batch, surface, rows, BEHIND)
        if not any(self.scene.materials[m].emits for m in materials):
            return np.zeros_like(surface.point)
        emission = self.emission.at(surface)
        glowing = np.flatnonzero(emission.any(axis=1))
        layer = self.layer_of.take(surface.instance)
        for index in np.unique(layer[glowing]):
            part = np.where((layer == index)[:, None], emission, 0.0)
            self._show(batch, batch.spread(part), int(index))
        return emission

    def _show(self, batch: Batch, radiance: Floats, layer: int) -> None:
        """Note emission (samples, 3) that the camera sees, of the light with that layer or -1."""
        total = batch.total(batch.weighed(radiance))
        batch.add(total, self.sums.seen)
        if layer >= 0 and self.settings.per_light:
            batch.add(total, self.sums.shown[layer])

    def _reflected(
        self, batch: Batch, surface: Surface, share: Share, points: Points, passed: int
    ) -> Floats:
        """Return the light (k, 3) that surfaces reflect, and add it to the lights' layers."""
        brdf: Floats = np.divide(self.albedo.at(surface), np.pi, order="F")
        irradiance, scattered = np.zeros_like(brdf), np.zeros_like(brdf)
        scattering = self.closures.at(surface)
        own = self.light.arrivals(surface, share, lambda k: points.pair(k + 1), passed, scattering)
        for arrival in own:
            emitter = arrival.emitter
            for exclusion in arrival.exclusions:
                samples = batch.hits[exclusion.rows]
                most = exclusion.most(brdf)
                if most is not None and batch.weight is not None:
                    most *= batch.weight[samples]
                self._exclude(batch, samples, exclusion.cause, most)
            if emitter.layer < 0:
                continue
            arriving = arrival.rgb
            irradiance += arriving
            if arrival.scattered is not None:
                scattered += arrival.scattered
            if self.settings.per_light:
                arriving *= brdf
                arriving += 0.0 if arrival.scattered is None else arrival.scattered
                parts = batch.by_pixel(batch.weighed(batch.spread(arriving)))
                for half in range(batch.each):
                    batch.add(parts[:, half], self.sums.lights[half, emitter.layer])
        if batch.weight is None:
            batch.add(batch.total(batch.spread(irradiance)), self.sums.irradiance)
        return brdf * irradiance + scattered

    def _positions(self, pixel: Ints, jitter: Floats) -> Floats:
        """Return picture positions (n, 2), y up, of a box filter one pixel wide."""
        width, height = self.scene.resolution
        row, column = np.divmod(pixel, width)
        return np.stack([column + jitter[:, 0], height - 1 - row + jitter[:, 1]]).T

    def _measured(self, batch: Batch, surface: Surface, where: Floats) -> Surface:
        """Return `surface` with what is measured; leave out where it is needed and not there."""
        surface, missing = self.measurement.of(surface, where)
        self._unmeasured(batch, surface, missing, EDGES)
        return surface

    def _unmeasured(self, batch: Batch, surface: Surface, rows: Ints, feature: str) -> None:
        for index in np.unique(surface.material.take(rows)):
            cause = Unsupported("material", self.scene.materials[index].name, feature)
            self._exclude(batch, batch.hits[rows[surface.material.take(rows) == index]], cause)

    def _background(self, batch: Batch, rays: CameraRays, met: Bools, distance: Floats) -> Floats:
        """Return what is seen besides surfaces (samples, 3): the world, and lights that show."""
        world, transparent = self.scene.world, self.scene.film_transparent
        free = ~met & (rays.reach > -np.inf)
        if batch.weight is None:
            alpha = (~free).astype(float) if transparent else np.ones(batch.count)
            self.sums.alpha[batch.span] += batch.total(alpha)
        elif transparent:
            clear = np.where(met, 0.0, batch.weight.mean(axis=1))
            self.sums.alpha[batch.span] -= batch.total(clear)
        radiance = np.zeros((batch.count, 3), order="F")
        if world.visible_camera and not transparent and free.any():
            for light in self.world:
                _, shown = light.intersect(rays.origins[free], rays.directions[free])
                radiance[free] += light.rgb * shown.reshape(len(shown), -1)
            if self.world:
                self._show(batch, radiance, self.layers.get(WORLD_NAME, -1))
            for cause in world.unsupported:
                self._exclude(batch, np.flatnonzero(free), cause)
        before = np.where(met, distance, rays.reach)
        for light in self.scene.lights:
            if light.visible_camera:
                at, shown = light.intersect(rays.origins, rays.directions)
                in_view = np.where(np.isinf(at), free, at < before)
                own = np.where(in_view[:, None], shown.reshape(len(shown), -1), 0.0) * light.rgb
                self._show(batch, own, self.layers.get(light.name, -1))
                radiance += own
        return radiance

    def _exclude(
        self, batch: Batch, samples: Ints, cause: Unsupported, most: Floats | None = None
    ) -> None:
        """Note what of the radiance of `samples` (k,) is in doubt: at `most` (k, 3), or all."""
        if len(samples):
            doubt = np.full(len(samples), np.inf) if most is None else np.abs(most).mean(axis=1)
            found: Floats = np.zeros(len(batch.rows))
            np.add.at(found, samples // batch.each, doubt)
            self.excluded.append((cause, batch.rows[found > 0.0], found[found > 0.0]))

    # --- the picture --------------------------------------------------------------------------

    def _developed(self) -> Film:
        sums, scene = self.sums, self.scene
        samples = sums.taken
        weight = 1.0 / np.maximum(samples, 1)
        mean, variance = sums.radiance()
        masks = self._excluded_by(np.abs(mean).mean(axis=1), weight)
        excluded = np.any([np.zeros(len(samples), dtype=bool), *masks.values()], axis=0)
        lights, noise = (
            dict(zip(self.light.names, map(self._framed, layers), strict=False))
            for layers in sums.layers()
        )
        shown = {
            name: self._framed(sums.shown[k] * weight[:, None].astype(np.float32))
            for name, k in self.layers.items()
            if lights and sums.shown[k].any()
        }
        return Film(
            radiance=self._framed(mean),
            variance=self._framed(variance),
            alpha=self._framed(sums.alpha * weight),
            lights=lights,
            noise=noise,
            seen=self._framed(sums.seen * weight[:, None]),
            shown=shown,
            irradiance=self._framed(sums.irradiance * weight[:, None]),
            depth=self._framed(sums.depth * scene.unit_scale_m),
            normal=self._framed(normalized(sums.normal)),
            samples=self._framed(samples),
            inside=self.inside,
            excluded=self._framed(excluded),
            excluded_by={cause: int(mask.sum()) for cause, mask in masks.items()},
            findings=scene.findings,
        )

    def _excluded_by(self, radiance: Floats, weight: Floats) -> dict[Unsupported, Bools]:
        """Return a mask (n,) for each cause of exclusion, given the pixels' radiance (n,).

        `weight` is 1 over the number of samples. What may be missed by the samples of one pixel,
        slivers or rare ways of light, is told by those of its neighbours.
        """
        radiance = np.maximum(radiance, DARK * radiance.mean() if len(radiance) else 0.0)
        found = {cause: np.full(len(self.place), np.inf) for cause in self.camera.unsupported}
        for cause, rows, doubt in self.excluded:
            found.setdefault(cause, np.zeros(len(self.place)))[rows] += doubt
        masks = {c: self._blurred(doubt * weight) > DOUBT * radiance for c, doubt in found.items()}
        return {cause: mask for cause, mask in masks.items() if mask.any()}

    def _blurred(self, values: Floats) -> Floats:
        """Return `values` (n,) averaged over neighbours, those that are infinite spread less."""
        known = np.where(np.isfinite(values), values, 0.0)
        near = neighbourhood_mean(self._framed(np.isinf(values).astype(float)), self.inside)
        for _ in range(BLUR):
            known = neighbourhood_mean(self._framed(known), self.inside).reshape(-1)[self.place]
        return np.where(near.reshape(-1)[self.place] > 0.0, np.inf, known)

    def _framed(self, values: NDArray[T]) -> NDArray[T]:
        """Return `values` (n, ...) in the whole frame (h, w, ...), 0 outside the border."""
        width, height = self.scene.resolution
        frame = values
        if len(values) < height * width:
            frame = np.zeros((height * width, *values.shape[1:]), dtype=values.dtype)
            frame[self.place] = values
        return frame.reshape(height, width, *values.shape[1:])


def _inside(scene: Scene) -> Bools:
    """Return (h, w) whether a pixel lies inside the render border; row 0 is the top."""
    width, height = scene.resolution
    inside = np.zeros((height, width), dtype=bool)
    x0, y0, x1, y1 = scene.border or (0, 0, width, height)
    inside[height - y1 : height - y0, x0:x1] = True
    return inside
