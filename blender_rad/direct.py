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

from .arrays import Bools, Floats, Ints
from .closures import Scattering, trusted
from .crowds import Crowd
from .emitters import Emitter, emitters
from .lights import RAYS, LightSample
from .linking import Links
from .rays import Caster
from .scene import Scene, Unsupported
from .surfaces import Geometry, Surface, dot, pick
from .transparency import Transmission

# Of the distance to a light: what lies nearer to it than this is the light.
TARGET_SHORTENING = 1e-5
MOST_SHARE = 2.0  # of what is foreseen of a crowd
ASTRAY = "Not there for shadow rays as for others"
DRAWN = -3  # number of the points that closures are sampled by


class Visibility:
    """Who hides what from whom: rays among a scene's instances by their ray visibility.

    Casters are `camera`, of what camera rays hit, `opaque`, of the instances `stopping` shadow rays
    for certain, and `passing`, of those `letting` some of their light pass. `ghosts` are not there
    for shadow rays as for those that Cycles sends from surfaces, `solid` is the rest of `opaque`.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        meshes, instances = scene.meshes, scene.instances
        stops = [m.opaque and not m.passes for m in scene.materials]
        seen, self.stopping, self.letting = list[int](), list[int](), list[int]()
        for k, instance in enumerate(instances):
            if not len(meshes[instance.mesh].triangles):
                continue
            if instance.visible_camera:
                seen.append(k)
            if instance.visible_shadow:
                opaque = all(stops[m] for m in instance.materials)
                (self.stopping if opaque else self.letting).append(k)
        self.camera = Caster(meshes, instances, seen)
        alike = seen == self.stopping
        self.opaque = self.camera if alike else Caster(meshes, instances, self.stopping)
        self.passing = Caster(meshes, instances, self.letting)
        rays = RAYS if any(m.closures for m in scene.materials) else RAYS[:1]
        ghosts = [
            k
            for k, i in enumerate(instances)
            if len(meshes[i.mesh].triangles)
            and any(getattr(i, f"visible_{ray}") != i.visible_shadow for ray in rays)
        ]
        solid = [k for k in self.stopping if k not in ghosts]
        self.ghosts = Caster(meshes, instances, ghosts) if ghosts != self.letting else self.passing
        self.solid = Caster(meshes, instances, solid) if solid != self.stopping else self.opaque

    def cause(self, instance: int) -> Unsupported:
        """Return why light through the unknown `instance` cannot be followed."""
        placed = self._scene.instances[instance]
        materials = [self._scene.materials[index] for index in placed.materials]
        known = [cause for m in materials if not m.opaque for cause in m.unsupported]
        return known[0] if known else Unsupported("object", placed.name, "Transparency")


class Exclusion(NamedTuple):
    """Points `rows` (k,) whose light is not known, and why.

    `irradiance` [W/m²] and `scattered` radiance [W/(m² sr)], (k, 3), are the most that is in doubt
    of an estimate; without them nothing is known.
    """

    rows: Ints
    cause: Unsupported
    irradiance: Floats | None = None
    scattered: Floats | None = None

    def most(self, brdf: Floats) -> Floats | None:
        """Return the radiance (k, 3) in doubt, of points (n, 3) with a Lambert `brdf`."""
        if self.irradiance is None:
            return self.scattered
        reflected = self.irradiance * brdf[self.rows]
        return reflected if self.scattered is None else reflected + np.abs(self.scattered)


class Arrival(NamedTuple):
    """What one emitter sends to a batch of points."""

    emitter: Emitter
    irradiance: Floats  # (n,) estimates; times the light's `rgb` in W/m²
    exclusions: list[Exclusion]  # points for which they can't be trusted
    tint: Floats | None = None  # (n, 3) factor on the light's `rgb`; None for 1
    scattered: Floats | None = None  # (n, 3) radiance that closures send to the viewer

    @property
    def rgb(self) -> Floats:
        """What arrives, (n, 3) [W/m²]."""
        arriving = (self.irradiance * self.emitter.light.rgb[:, None]).T
        return arriving if self.tint is None else arriving * self.tint


Share = Callable[[int, Floats, Floats], Floats]  # emitter's number, f (n,), f V (n,) -> c (n,)


class Sightings:
    """How much of so many emitters the `streams` of so many pixels have seen."""

    def __init__(self, emitters: int, places: int, streams: int) -> None:
        self._sums = np.zeros((emitters, places * streams), dtype=np.complex64)  # f + i f V
        self._streams = streams

    def of(self, place: Ints, stream: Ints) -> Share:
        """Return what counts samples of pixels and streams (n,), and tells c; 1 before any."""
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


class _Asked(NamedTuple):
    """What `DirectLight.arrivals` is asked."""

    surface: Surface
    share: Share
    uniform: Callable[[int], Floats]
    passed: int
    scattering: Scattering | None


class _Reaching(NamedTuple):
    """Irradiance (n,) over `rgb` of samples, and what `DirectLight.seen` tells of those `lit`."""

    value: Floats
    lit: Ints
    seen: Bools | Floats
    through: Floats | None
    exclusions: list[Exclusion]

    def passed(self, values: Floats) -> Floats:
        """Return what comes through of `values` (n, 3)."""
        share = np.zeros_like(values)
        share[self.lit] = self.seen[:, None] if self.through is None else self.through
        return values * share


class DirectLight:
    """The direct light of a scene, anywhere.

    `emitters` are sampled everywhere, the others are in `crowds`; `names` are those of layers.
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
        """Yield the light of emitters that reaches any of n points, in one part or two.

        `share` gives c (n,), as `Sightings.of` does, `uniform` points (n, 2) in [0, 1) for the
        emitter of a number. `passed` transparent surfaces are in front of the points; `scattering`
        is what closures do there.
        """
        asked = _Asked(surface, share, uniform, passed, scattering)
        if scattering is not None:
            scattering.draw(uniform(DRAWN))
        for number, crowd in enumerate(self.crowds, len(self.emitters)):
            yield from self._from_crowd(number, crowd, asked)
        for number, emitter in enumerate(self.emitters):
            unlit = self.links.unlit(emitter.light.name, surface.instance)
            if scattering is not None:
                yield from self._met(emitter, asked, scattering.found(emitter.light), unlit)
            yield from self._sampled(number, asked, unlit)

    def _sampled(self, number: int, asked: _Asked, unlit: Bools | None) -> Iterator[Arrival]:
        """Yield what a sample of the emitter of that number finds, if anything."""
        surface, scattering = asked.surface, asked.scattering
        emitter = self.emitters[number]
        light = emitter.light
        sample = light.sample(surface.point, surface.normal, asked.uniform(number))
        glow = None
        if scattering is not None:
            glow = scattering.lit(sample, light.reaches, found=light.is_found) * light.rgb
        rgb = light.rgb if sample.tint is None else light.rgb * sample.tint
        if "diffuse" not in light.reaches:
            rgb = None
        reaching = self._reaching(emitter, asked, sample, rgb, glow, unlit=unlit)
        if reaching is None:
            return
        value, lit, seen, through, exclusions = reaching
        irradiance = np.zeros(len(value))
        if emitter.cause is not None:
            yield Arrival(emitter, irradiance, exclusions)
            return
        irradiance[lit] = value[lit] * seen
        exact = self._exact(emitter, surface)
        if exact is not None:
            out = ~np.isfinite(exact) if unlit is None else unlit | ~np.isfinite(exact)
            exact = np.where(out, value, exact)
            irradiance += asked.share(number, value, irradiance) * (exact - value)
        tint = sample.tint
        if through is not None:
            coloured = np.ones((len(value), 3))
            missing = value[lit, None] * (through - seen[:, None])
            coloured[lit] += _over(missing, irradiance[lit])
            tint = coloured if tint is None else coloured * tint
        scattered = None if glow is None else reaching.passed(glow)
        yield Arrival(emitter, irradiance, exclusions, tint, scattered)

    def _met(
        self,
        emitter: Emitter,
        asked: _Asked,
        found: tuple[LightSample, Floats] | None,
        unlit: Bools | None = None,
    ) -> Iterator[Arrival]:
        """Yield what of the emitter the samples of closures have `found`, if anything."""
        if found is None:
            return
        sample, glow = found[0], found[1] * emitter.light.rgb
        reaching = self._reaching(emitter, asked, sample, None, glow, unlit=unlit)
        if reaching is not None:
            scattered = reaching.passed(glow)
            exclusions = reaching.exclusions
            if self._may_stray(emitter):
                exclusions = [*exclusions, *self._astray(emitter, asked, sample, glow)]
            yield Arrival(emitter, reaching.value, exclusions, scattered=scattered)

    def _from_crowd(self, number: int, crowd: Crowd, asked: _Asked) -> Iterator[Arrival]:
        """Yield the light of the crowd that `share` knows by that number."""
        surface, scattering = asked.surface, asked.scattering
        if scattering is not None:
            for look in crowd.looks(*scattering.gaze):
                yield from self._met(crowd.emitter, asked, scattering.met(look, RAYS))
        total, exclusions = np.zeros((len(surface.point), 3)), list[Exclusion]()
        scattered = None if scattering is None else np.zeros_like(total)
        samples, foreseen, whole = crowd.sample(surface.point, surface.normal, asked.uniform)
        for sample, rgb in samples:
            glow = None
            if scattering is not None:
                glow = scattering.lit(sample, RAYS, found=True) * rgb
            reaching = self._reaching(crowd.emitter, asked, sample, rgb, glow)
            if reaching is None:
                continue
            exclusions += reaching.exclusions
            total += reaching.passed(reaching.value[:, None] * rgb)
            if glow is not None and scattered is not None:
                scattered += reaching.passed(glow)
        share = asked.share(number, *(np.abs(each).sum(axis=1) for each in (foreseen, total)))
        total += np.minimum(share, MOST_SHARE)[:, None] * (whole - foreseen)
        brightest = np.abs(total).max(axis=1)
        yield Arrival(crowd.emitter, brightest, exclusions, _over(total, brightest), scattered)

    def _reaching(
        self,
        emitter: Emitter,
        asked: _Asked,
        sample: LightSample,
        rgb: Floats | None,
        glow: Floats | None,
        *,
        unlit: Bools | None = None,
    ) -> _Reaching | None:
        """Return what reaches Lambert surfaces, or closures that make `glow` of it; None without.

        `rgb` is the sample's colour, None where it is not for Lambert surfaces. Where the light is
        not for the points, `unlit` (n,), glow becomes 0.
        """
        surface, cosine = asked.surface, dot(asked.surface.normal, sample.wi)
        lambert = rgb is not None
        value = np.where(cosine > 0.0, sample.weight * cosine, 0.0) if lambert else 0.0 * cosine
        if lambert and self.geometry.shading_is_shifted:
            value *= self._terminator_shading(surface, cosine)
        for dark in (value, glow) if unlit is not None else ():
            if dark is not None:
                dark[unlit] = 0.0
        lit = np.flatnonzero(value if glow is None else (value != 0.0) | glow.any(axis=1))
        if not len(lit):
            return None
        seen, through, exclusions = self.seen(
            emitter, surface, sample, cosine, lit, passed=asked.passed
        )
        reaching = _Reaching(value, lit, seen, through, exclusions)
        for k, (rows, cause, *_) in enumerate(exclusions):
            most = None if rgb is None else reaching.passed(value[:, None] * rgb)[rows]
            shown = None if glow is None else reaching.passed(glow)[rows]
            exclusions[k] = Exclusion(rows, cause, most, shown)
        if rgb is not None and self._may_stray(emitter):
            pdf = 0.0 * cosine if emitter.light.kind == "MESH" else sample.pdf
            share = value * trusted(np.maximum(cosine, 0.0) / np.pi, pdf)
            exclusions += self._astray(emitter, asked, sample, None, share[:, None] * rgb)
        if emitter.cause is not None:
            exclusions.append(Exclusion(lit[seen > 0.0], emitter.cause))
        return reaching

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
        """Return visibilities V of samples at the points `lit`: (k,), by channel, and exclusions.

        V by channel, (k, 3), is None where nothing lets a part of the light pass.
        """
        if not emitter.light.cast_shadow:
            return np.ones(len(lit), dtype=bool), None, []
        origins, wi, reach = self._rays(surface, sample, cosine, lit)
        opaque, transmission = self.links.blockers(emitter.light.name)
        seen = ~opaque.occluded(origins, wi, reach)
        if not transmission.caster.count:
            return seen, None, []
        rows = np.flatnonzero(seen)
        found = np.isfinite(sample.pdf[lit[rows]])
        share, crossed = transmission.along(origins[rows], wi[rows], reach[rows], passed, found)
        exclusions = [
            Exclusion(lit[rows[crossed == instance]], self.visibility.cause(int(instance)))
            for instance in np.unique(crossed[crossed >= 0])
        ]
        if (share == 1.0).all():
            return seen, None, exclusions
        through = np.zeros((len(lit), 3))
        through[rows] = share
        return through.mean(axis=1), through, exclusions

    def _rays(
        self, surface: Surface, sample: LightSample, cosine: Floats, rows: Ints
    ) -> tuple[Floats, Floats, Floats]:
        """Return origins, directions and ends of shadow rays to samples of the points `rows`."""
        wi, distance, epsilon = sample.wi, sample.distance, surface.epsilon
        points = surface.point
        if len(rows) < len(distance):
            wi, distance, epsilon = pick(wi, rows), distance.take(rows), epsilon.take(rows)
            points = pick(points, rows)
        origins = self.geometry.shadow_origins(surface, wi, cosine, rows)
        return origins, *_aimed(wi, distance, epsilon, origins - points)

    def _ghosts(self, emitter: Emitter) -> Caster:
        """Return what casts rays against all that is not alike for all rays to a light."""
        return self.visibility.ghosts if emitter.light.cast_shadow else self.visibility.opaque

    def _may_stray(self, emitter: Emitter) -> bool:
        return not emitter.light.is_delta and self._ghosts(emitter).count > 0

    def _astray(
        self,
        emitter: Emitter,
        asked: _Asked,
        sample: LightSample,
        glow: Floats | None,
        irradiance: Floats | None = None,
    ) -> list[Exclusion]:
        """Return where objects are not the same for both ways in which Cycles samples lights.

        What it samples by the surface of `irradiance` (n, 3), or sends on as `glow` (n, 3), is lost
        at what throws no shadows, and found behind what throws nothing else.
        """
        open_to = glow if irradiance is None else irradiance
        if open_to is None:
            return []
        cosine = dot(asked.surface.normal, sample.wi)
        rows = np.flatnonzero(open_to.any(axis=1))
        if not len(rows):
            return []
        rays = self._rays(asked.surface, sample, cosine, rows)
        hits = self._ghosts(emitter).intersect(*rays[:2])
        crossed = hits.distance < rays[2]
        if emitter.light.cast_shadow:
            crossed &= ~self.visibility.solid.occluded(*rays)
        return [
            Exclusion(
                chosen := rows[crossed & (hits.instance == k)],
                Unsupported("object", self.scene.instances[k].name, ASTRAY),
                None if irradiance is None else irradiance[chosen],
                None if irradiance is not None or glow is None else glow[chosen],
            )
            for k in np.unique(hits.instance[crossed])
        ]


def _over(values: Floats, divisor: Floats) -> Floats:
    """Return `values` (n, 3) over `divisor` (n,), 0 where that is 0."""
    whole = divisor[:, None]
    return np.divide(values, whole, out=np.zeros_like(values), where=whole != 0.0)


def _aimed(wi: Floats, distance: Floats, epsilon: Floats, lift: Floats) -> tuple[Floats, Floats]:
    """Return rays to the same targets from origins moved by `lift` (n, 3), and their ends (n,).

    A ray's direction has the length of the distance, so that its target lies at 1, and it ends just
    before that. Directions to what is infinitely far are kept.
    """
    if np.isinf(distance[0]):  # of a light, all are or none
        return wi, distance
    ends = np.maximum(1.0 - TARGET_SHORTENING - epsilon / np.maximum(distance, 1e-300), 0.0)
    return wi * distance[:, None] - lift, ends
