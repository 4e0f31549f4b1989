# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator: the irradiance that each light sends straight to points on surfaces.

    E(x) = ∫ L_i V cosθ_i dω_i    for each light, and L_r = Σ f_r E with f_r = albedo/π

One sample f = L cosθ/p of each light, with its visibility V, goes with each point. Where the
unoccluded irradiance E₀ is known in closed form it serves as a control variate,

    Ê = c E₀ + f (V - c),

with c = Σ f V / Σ f over the samples of the *other* streams of the same pixel, so far: the share of
the light that they see. c does not depend on f or V, so Ê is unbiased; it is exact without noise
where the light is all visible (c = V = 1) or all hidden (c = V = 0), and in between only what
visibility leaves open is noisy. c gathers over the streams' whole history: samples of one index in
two streams follow the same pattern of digits, and the mean of c (E₀ - f) over equal indices would
not fall with their number.

What other closures than Lambert's make of the light is left to `closures`; rays are shared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .closures import Scattering
from .crowds import Crowd
from .emitters import Emitter, emitters
from .lights import RAYS, LightSample
from .linking import Links
from .rays import Caster
from .scene import Scene, Unsupported
from .surfaces import Geometry, Surface, dot, pick
from .transparency import Transmission

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Of the distance to a light: what lies nearer to it than this is the light.
TARGET_SHORTENING = 1e-5
DRAWN = -3  # number of the points that closures are sampled by


class Visibility:
    """Who hides what from whom: rays among a scene's instances by their ray visibility.

    Attributes
    ----------
    camera : what camera rays hit.
    opaque, stopping : what stops shadow rays for certain, and which instances these are.
    passing, letting : what may let some of their light pass.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        instances = scene.instances
        solid = [k for k, i in enumerate(instances) if len(scene.meshes[i.mesh].triangles)]
        shadowing = [k for k in solid if instances[k].visible_shadow]
        self.stopping = [k for k in shadowing if self._stops_light(k)]
        self.letting = [k for k in shadowing if not self._stops_light(k)]
        seen = [k for k in solid if instances[k].visible_camera]
        self.camera = Caster(scene.meshes, instances, seen)
        alike = seen == self.stopping
        self.opaque = self.camera if alike else Caster(scene.meshes, instances, self.stopping)
        self.passing = Caster(scene.meshes, instances, self.letting)

    def _stops_light(self, instance: int) -> bool:
        materials = [self._scene.materials[m] for m in self._scene.instances[instance].materials]
        return all(m.opaque and not m.passes for m in materials)

    def cause(self, instance: int) -> Unsupported:
        """Return why light through the unknown `instance` cannot be followed."""
        placed = self._scene.instances[instance]
        for index in placed.materials:
            material = self._scene.materials[index]
            if not material.opaque and material.unsupported:
                return material.unsupported[0]
        return Unsupported("object", placed.name, "Transparency")


class Exclusion(NamedTuple):
    """Points `rows` (k,) whose light is not known, and why."""

    rows: Ints
    cause: Unsupported


class Arrival(NamedTuple):
    """What one emitter sends to a batch of points.

    Attributes
    ----------
    emitter : the light; its `rgb` times `irradiance` is in W/m².
    irradiance : (n,) estimates.
    exclusions : points for which they can't be trusted.
    tint : (n, 3) factor on the light's `rgb`; None for 1.
    scattered : (n, 3) radiance that closures send to the viewer; None without any.
    """

    emitter: Emitter
    irradiance: Floats
    exclusions: list[Exclusion]
    tint: Floats | None = None
    scattered: Floats | None = None

    @property
    def rgb(self) -> Floats:
        """What arrives, (n, 3) [W/m²]."""
        arriving = (self.irradiance * self.emitter.light.rgb[:, None]).T
        return arriving if self.tint is None else arriving * self.tint


Share = Callable[[int, Floats, Floats], Floats]  # emitter's number, f (n,), f V (n,) -> c (n,)


class Sightings:
    """How much of each emitter the streams of a pixel have seen.

    Parameters
    ----------
    emitters, places, streams : how many there are.
    """

    def __init__(self, emitters: int, places: int, streams: int) -> None:
        self._sums = np.zeros((emitters, places * streams), dtype=np.complex64)  # f + i f V
        self._streams = streams

    def of(self, place: Ints, stream: Ints) -> Share:
        """Return what counts samples, no two of one stream, and tells c; 1 before any is known.

        `place` and `stream` (n,) tell where they belong.
        """
        streams, first = self._streams, place * self._streams
        own = first + stream
        others = [first + (stream + k) % streams for k in range(1, streams)]

        def share(number: int, value: Floats, reaching: Floats) -> Floats:
            sums = self._sums[number]
            known = sums.take(own)
            known.real += value
            known.imag += reaching
            sums[own] = known
            found = sums.take(others[0])
            for other in others[1:]:
                found += sums.take(other)
            nothing = np.ones(len(found), dtype=np.float32)
            return np.divide(found.imag, found.real, out=nothing, where=found.real > 0.0)

        return share


class DirectLight:
    """The direct light of a scene, anywhere.

    Attributes
    ----------
    geometry, visibility : of the scene.
    emitters : lights that are sampled everywhere; `names` are those of their layers.
    crowds : the other lights.
    """

    crowds: Sequence[Crowd] = ()

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.geometry = Geometry(scene)
        self.visibility = Visibility(scene)
        self.transmission = Transmission(scene, self.geometry, self.visibility.passing)
        self.links = Links(scene, self.visibility, self.transmission)
        self.emitters, self.names = emitters(scene)

    def arrivals(
        self,
        surface: Surface,
        share: Share,
        uniform: Callable[[int], Floats],
        passed: int = 0,
        scattering: Scattering | None = None,
    ) -> Iterator[Arrival]:
        """Yield the light of emitters that reaches any of the points, in one part or two.

        Parameters
        ----------
        surface : n points.
        share : gives c (n,), such as `Sightings.share`.
        uniform : gives points (n, 2) in [0, 1) for the emitter of a number.
        passed : transparent surfaces in front of them.
        scattering : closures at the points.
        """
        if scattering is not None:
            scattering.draw(uniform(DRAWN))
        for crowd in self.crowds:
            yield from self._from_crowd(crowd, surface, uniform, passed, scattering)
        for number, emitter in enumerate(self.emitters):
            light = emitter.light
            unlit = self.links.unlit(light.name, surface.instance)
            if scattering is not None:
                found = scattering.found(light)
                yield from self._met(emitter, surface, found, unlit, passed)
            sample = light.sample(surface.point, surface.normal, uniform(number))
            value, cosine = self._received(surface, sample)
            if "diffuse" not in light.reaches:
                value[:] = 0.0
            glow = None
            if scattering is not None:
                glow = scattering.lit(sample, light.reaches, found=light.is_found)
            _darken(unlit, value, glow)
            lit = _lit(value, glow)
            if not len(lit):
                continue
            seen, through, exclusions = self.seen(
                emitter, surface, sample, cosine, lit, passed=passed
            )
            if emitter.cause is not None:
                reached = Exclusion(lit[seen > 0.0], emitter.cause)
                yield Arrival(emitter, np.zeros(len(value)), [reached, *exclusions])
                continue
            irradiance = np.zeros(len(value))
            irradiance[lit] = value[lit] * seen
            exact = self._exact(emitter, surface)
            if exact is not None:
                out = ~np.isfinite(exact) if unlit is None else unlit | ~np.isfinite(exact)
                exact = np.where(out, value, exact)
                irradiance += share(number, value, irradiance) * (exact - value)
            tint = sample.tint
            if through is not None:
                coloured = np.ones((len(value), 3))
                missing = value[lit, None] * (through - seen[:, None])
                coloured[lit] += _over(missing, irradiance[lit])
                tint = coloured if tint is None else coloured * tint
            if glow is not None:
                glow = _passed(glow * light.rgb, lit, seen, through)
            yield Arrival(emitter, irradiance, exclusions, tint, glow)

    def _received(self, surface: Surface, sample: LightSample) -> tuple[Floats, Floats]:
        """Return the irradiance (n,) over `rgb` of unhidden samples, and their cosines (n,)."""
        cosine = dot(surface.normal, sample.wi)
        value = np.where(cosine > 0.0, sample.weight * cosine, 0.0)
        if self.geometry.shading_is_shifted:
            value *= self._terminator_shading(surface, cosine)
        return value, cosine

    def _met(
        self,
        emitter: Emitter,
        surface: Surface,
        found: tuple[LightSample, Floats] | None,
        unlit: Bools | None,
        passed: int,
    ) -> Iterator[Arrival]:
        """Yield what of the emitter the samples of closures have `found`, if anything."""
        if found is None:
            return
        sample, glow = found
        _darken(unlit, glow)
        nothing = np.zeros(len(glow))
        lit = _lit(nothing, glow)
        if not len(lit):
            return
        cosine = dot(surface.normal, sample.wi)
        seen, through, exclusions = self.seen(emitter, surface, sample, cosine, lit, passed=passed)
        if emitter.cause is not None:
            exclusions = [Exclusion(lit[seen > 0.0], emitter.cause), *exclusions]
        glow = _passed(glow * emitter.light.rgb, lit, seen, through)
        yield Arrival(emitter, nothing, exclusions, scattered=glow)

    def _from_crowd(
        self,
        crowd: Crowd,
        surface: Surface,
        uniform: Callable[[int], Floats],
        passed: int,
        scattering: Scattering | None,
    ) -> Iterator[Arrival]:
        """Yield the light of a crowd."""
        if scattering is not None:
            for look in crowd.looks(*scattering.gaze):
                found = scattering.met(look, RAYS)
                yield from self._met(crowd.emitter, surface, found, None, passed)
        total, exclusions = np.zeros((len(surface.point), 3)), list[Exclusion]()
        scattered = None if scattering is None else np.zeros_like(total)
        for sample, rgb in crowd.sample(surface.point, surface.normal, uniform):
            value, cosine = self._received(surface, sample)
            glow = None
            if scattering is not None:
                glow = scattering.lit(sample, RAYS, found=True) * rgb
            lit = _lit(value, glow)
            if not len(lit):
                continue
            seen, through, found = self.seen(
                crowd.emitter, surface, sample, cosine, lit, passed=passed
            )
            exclusions += found
            passing = seen[:, None] if through is None else through
            total[lit] += value[lit, None] * rgb[lit] * passing
            if glow is not None and scattered is not None:
                scattered += _passed(glow, lit, seen, through)
        brightest = np.abs(total).max(axis=1)
        yield Arrival(crowd.emitter, brightest, exclusions, _over(total, brightest), scattered)

    def _exact(self, emitter: Emitter, surface: Surface) -> Floats | None:
        """Return the unoccluded irradiance (n,), nan where no closed form holds."""
        if emitter.light.is_delta or "diffuse" not in emitter.light.reaches:
            return None
        exact = emitter.light.irradiance(surface.point, surface.normal)
        if exact is not None and self.geometry.shading_is_shifted:
            frequency = self.geometry.shading_frequency.take(surface.instance)
            exact = np.where(frequency == 1.0, exact, np.nan)
        return exact

    def _terminator_shading(self, surface: Surface, cosine: Floats) -> Floats:
        """Return Cycles' shading offset of the shadow terminator, cos(kθ)/cosθ, (n,)."""
        frequency = self.geometry.shading_frequency.take(surface.instance)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        shifted = np.maximum(np.cos(angle * frequency), 0.0)
        ratio = np.divide(shifted, cosine, out=np.ones_like(cosine), where=cosine > 0.0)
        return np.where(frequency > 1.0, ratio, 1.0)

    def seen(
        self,
        emitter: Emitter,
        surface: Surface,
        sample: LightSample,
        cosine: Floats,
        lit: Ints,
        *,
        passed: int,
    ) -> tuple[Bools | Floats, Floats | None, list[Exclusion]]:
        """Return how much of their sample the points `lit` see (k,), by channel, and what is open.

        By channel, (k, 3), it is None where all see all or nothing.
        """
        if not emitter.light.cast_shadow:
            return np.ones(len(lit), dtype=bool), None, []
        wi, distance, epsilon = sample.wi, sample.distance, surface.epsilon
        points = surface.point
        if len(lit) < len(distance):
            wi, distance, epsilon = pick(wi, lit), distance.take(lit), epsilon.take(lit)
            points = pick(points, lit)
        origins = self.geometry.shadow_origins(surface, wi, cosine, lit)
        wi, reach = _aimed(wi, distance, epsilon, origins - points)
        opaque, transmission = self.links.blockers(emitter.light.name)
        seen = ~opaque.occluded(origins, wi, reach)
        if not transmission.caster.count:
            return seen, None, []
        rows = np.flatnonzero(seen)
        share, crossed = transmission.along(origins[rows], wi[rows], reach[rows], passed)
        exclusions = [
            Exclusion(lit[rows[crossed == instance]], self.visibility.cause(int(instance)))
            for instance in np.unique(crossed[crossed >= 0])
        ]
        if (share == 1.0).all():
            return seen, None, exclusions
        through = np.zeros((len(lit), 3))
        through[rows] = share
        return through.mean(axis=1), through, exclusions


def _darken(unlit: Bools | None, *values: Floats | None) -> None:
    """Set `values` (n, ...) to 0 where they are `unlit` (n,)."""
    for each in values if unlit is not None else ():
        if each is not None:
            each[unlit] = 0.0


def _lit(value: Floats, glow: Floats | None) -> Ints:
    """Return the points (k,) at which anything of `value` (n,) and `glow` (n, 3) is not 0."""
    return np.flatnonzero(value if glow is None else (value != 0.0) | glow.any(axis=1))


def _passed(glow: Floats, lit: Ints, seen: Bools | Floats, through: Floats | None) -> Floats:
    """Return what of `glow` (n, 3) comes through, as `DirectLight.seen` tells of `lit` (k,)."""
    share = np.zeros_like(glow)
    share[lit] = seen[:, None] if through is None else through
    return glow * share


def _over(values: Floats, divisor: Floats) -> Floats:
    """Return `values` (n, 3) over `divisor` (n,), 0 where that is 0."""
    whole = divisor[:, None]
    return np.divide(values, whole, out=np.zeros_like(values), where=whole != 0.0)


def _aimed(wi: Floats, distance: Floats, epsilon: Floats, lift: Floats) -> tuple[Floats, Floats]:
    """Return rays to the same targets from origins moved by `lift` (n, 3), and their ends (n,).

    They are as long as what they reach for is far, so that it lies at 1, and end short of it; what
    is infinitely far keeps its direction.
    """
    if np.isinf(distance[0]):  # of a light, all are or none
        return wi, distance
    ends = np.maximum(1.0 - TARGET_SHORTENING - epsilon / np.maximum(distance, 1e-300), 0.0)
    return wi * distance[:, None] - lift, ends
