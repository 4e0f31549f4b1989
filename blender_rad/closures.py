# SPDX-License-Identifier: GPL-3.0-or-later
"""What the closures of a scene's materials do with light, at points on its surfaces.

The light of one emitter that they send to the viewer, L_r = ∫ f L V |cosθ| dω, is found by two
samples of each point: one of the emitter with the density p, and one of the closures with q, which
all emitters share. With the power heuristic each counts as much as its density is trusted:

    L̂_r = f L V |cosθ|/p · p²/(p² + q²)  +  f L V |cosθ|/q · q²/(p² + q²)

p and q are densities per solid angle [1/sr]. Lights of a single direction, and those that
`Light.look` finds only in part, are left to the first sample alone. A lobe reflects only lights
that are visible to its kind of ray (`Light.reaches`); q counts all lobes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from .bsdfs import Frame, Inputs, Lobe, Mixture, lobes
from .lights import Light, LightSample
from .scene import Closure, Scene
from .shading import contexts
from .surfaces import Geometry, Surface, dot, pick
from .textures import Context, Expression

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SAME = 1e-6  # of normals
DIFFUSE = 0.2  # chances of diffuse lobes over their shares: samples of lights serve these well


class Closures:
    """The closures of a scene's materials."""

    def __init__(self, scene: Scene, geometry: Geometry) -> None:
        self._scene, self._geometry = scene, geometry
        self._of = {k: m.closures for k, m in enumerate(scene.materials) if m.closures}

    def at(self, surface: Surface) -> Scattering | None:
        """Return what the closures do at n points, None where there are none."""
        parts = [part for material in self._of for part in self._part(surface, material)]
        return Scattering(surface, parts) if parts else None

    def _part(self, surface: Surface, material: int) -> Iterator[tuple[Ints, Mixture]]:
        """Yield the points (k,) of a material, if any, and what it does there."""
        closures = self._of[material]
        rows, known = np.flatnonzero(surface.material == material), list[Context]()
        if len(rows) and not all(e.value is not None for c in closures for e in _expressions(c)):
            found = contexts(self._scene, self._geometry, surface, [material])
            _, every, known = (list(each) for each in zip(*found, strict=True))
            counts = [len(each) for each in every]
            rows = np.concatenate(every)
        else:
            counts = [len(rows)]
        if not len(rows):
            return
        asked = _Asked(known, counts)
        found = [lobe for c in closures for lobe in self._lobes(c, surface, rows, asked)]
        if found:
            # What Cycles loses of rough refraction depends on the chances, as `Refraction` says.
            refracts = any(lobe.ray == "transmission" for lobe in found)
            yield rows, Mixture.of(found, diffuse=1.0 if refracts else DIFFUSE)

    def _lobes(
        self, closure: Closure, surface: Surface, rows: Ints, asked: _Asked
    ) -> Iterator[Lobe]:
        """Yield what a closure is made of, as its mesh lets Cycles see it."""
        own = pick(surface.normal, rows)
        back = surface.backfacing
        inputs = Inputs(
            values={name: asked.of(value) for name, value in closure.inputs.items()},
            settings=closure.settings,
            weight=np.broadcast_to(asked.of(closure.weight), (len(rows), 3)),
            normal=_unit(asked.vector(closure.normal), own),
            geometric=pick(surface.geometric_normal, rows),
            wo=pick(surface.incoming, rows),
            tangent=None if closure.tangent is None else asked.vector(closure.tangent),
            backfacing=None if back is None else back[rows],
            version=self._scene.blender_version,
        )
        frequency = self._geometry.shading_frequency.take(surface.instance.take(rows))
        soft = bool(closure.settings.get("use_bump_map_correction", True))
        for lobe in lobes(closure.kind, inputs):
            if not lobe.weight.any():
                continue
            bent = (dot(lobe.frame.z, own) < 1.0 - SAME).any()
            if bent or self._geometry.shading_is_shifted:
                yield Bent(lobe, own, frequency, soft and lobe.ray == "diffuse")
            else:
                yield lobe


def _expressions(closure: Closure) -> list[Expression]:
    others = [each for each in (closure.normal, closure.tangent) if each is not None]
    return [closure.weight, *closure.inputs.values(), *others]


class _Asked(NamedTuple):
    """Where expressions are evaluated: instance by instance, with the number of points on each."""

    contexts: list[Context]
    counts: list[int]

    def of(self, expression: Expression) -> Floats:
        """Return its values (n, 1) or (n, 3), a single row where nothing varies."""
        if expression.value is not None:
            return expression.value
        found = [expression.evaluate(context) for context in self.contexts]
        width = max(each.shape[1] for each in found)
        both = zip(found, self.counts, strict=True)
        return np.concatenate([np.broadcast_to(each, (n, width)) for each, n in both])

    def vector(self, expression: Expression | None) -> Floats:
        """Return its values (n, 3), 0 for None."""
        found = np.zeros((1, 3)) if expression is None else self.of(expression)
        return np.broadcast_to(found, (sum(self.counts), 3))


def _unit(vectors: Floats, fallback: Floats) -> Floats:
    """Return `vectors` (n, 3) at unit length, `fallback` (n, 3) where they have none."""
    length = np.sqrt(dot(vectors, vectors))[:, None]
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), fallback)


@dataclass(frozen=True)
class Bent(Lobe):
    """A lobe whose normal n is not the surface's N, as Cycles evaluates it.

    A direction above the horizon of one and below that of the other is dark. Diffuse lobes fade
    towards the horizon of N, by the masking of GGX with α² = tan²γ/8, γ the angle between n and N.
    On the side of n, a shading offset of the shadow terminator takes cos kθ in place of cosθ, θ the
    angle from n.

    Attributes
    ----------
    lobe : with its weight and frame.
    normal : (n, 3) of the surface.
    frequency : (n,) k.
    soft : whether it fades.
    """

    lobe: Lobe
    normal: Floats
    frequency: Floats
    soft: bool

    @property
    def weight(self) -> Floats:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.lobe.weight

    @property
    def frame(self) -> Frame:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.lobe.frame

    @property
    def ray(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.lobe.ray

    def evaluate(self, wi: Floats) -> tuple[Floats, Floats]:
        value, density = self.lobe.evaluate(wi)
        return value * self._factor(wi)[:, None], density

    def _factor(self, wi: Floats) -> Floats:
        """Return the factor (n,) on the light from `wi`."""
        between, over = dot(self.lobe.frame.z, self.normal), dot(self.normal, wi)
        above = dot(self.lobe.frame.z, wi)
        bent = between < 1.0 - SAME
        factor = np.where(bent & (between * over * above < 0.0), 0.0, 1.0)
        if self.soft:
            alpha = np.clip(0.125 * (1.0 / np.maximum(between**2, 1e-12) - 1.0), 0.0, 1.0)
            tangent = 1.0 / np.maximum(over**2, 1e-12) - 1.0
            factor *= np.where(bent, 2.0 / (1.0 + np.sqrt(1.0 + alpha * tangent)), 1.0)
        shifted = (self.frequency > 1.0) & (above > 0.0)
        cosine = np.where(shifted, np.minimum(above, 1.0), 1.0)
        ratio = np.maximum(np.cos(self.frequency * np.arccos(cosine)), 0.0) / cosine
        return np.where(shifted, factor * ratio, factor)

    def sample(self, u: Floats) -> Floats:
        return self.lobe.sample(u)

    def albedo(self) -> Floats:
        return self.lobe.albedo()

    @classmethod
    def examples(cls, wo: Floats, frame: Frame) -> Sequence[Self]:
        return []


class Scattering:
    """What closures do at n points: mixtures `parts` at some of them each."""

    def __init__(self, surface: Surface, parts: list[tuple[Ints, Mixture]]) -> None:
        self._surface, self.parts = surface, parts
        self._wi, self._drawn = surface.normal.copy(order="K"), np.zeros(len(surface.point), bool)

    def draw(self, u: Floats) -> None:
        """Take the directions that `found` looks along, of `u` (n, 2) in [0, 1)."""
        for rows, mixture in self.parts:
            wi = mixture.sample(u[rows])
            drawn = wi.any(axis=1)
            self._drawn[rows] = drawn
            self._wi[rows[drawn]] = wi[drawn]

    def _evaluated(self, wi: Floats, reaches: Sequence[str]) -> tuple[Floats, Floats]:
        """Return f |cosθ| (n, 3) of lobes of the kinds `reaches`, and the density (n,) of all."""
        value, density = np.zeros_like(self._wi), np.zeros(len(wi))
        for rows, mixture in self.parts:
            value[rows], density[rows] = mixture.evaluate(wi[rows], reaches)
        return value, density

    def lit(self, sample: LightSample, reaches: Sequence[str], *, found: bool) -> Floats:
        """Return the radiance (n, 3) that a `sample` of a light adds, over `Light.rgb` and V.

        `found` says whether samples of closures find the light as well, and share its weight.
        """
        value, density = self._evaluated(sample.wi, reaches)
        weight = sample.weight
        if found:
            weight = weight * trusted(sample.pdf, density)
        value *= weight[:, None]
        return value if sample.tint is None else value * sample.tint

    def found(self, light: Light) -> tuple[LightSample, Floats] | None:
        """Return where closures' samples hit the light, and the radiance (n, 3) added, as `lit`."""
        return self.met(light.look(*self.gaze), light.reaches) if light.is_found else None

    @property
    def _lift(self) -> Floats:
        """How far (n, 3) the samples' rays start from the points."""
        normal, epsilon = self._surface.geometric_normal, self._surface.epsilon
        return normal * np.copysign(epsilon, dot(self._wi, normal))[:, None]

    @property
    def gaze(self) -> tuple[Floats, Floats, Floats]:
        """Where the samples start, the normals there, and their directions, (n, 3) each."""
        return self._surface.point + self._lift, self._surface.normal, self._wi

    def met(
        self, look: tuple[Floats, Floats, Floats], reaches: Sequence[str]
    ) -> tuple[LightSample, Floats] | None:
        """Return what `found` does of a light, given a `look` at it along `gaze`."""
        wi, (distance, radiance, pdf) = self._wi, look
        radiance = radiance.reshape(len(wi), -1) * self._drawn[:, None]
        met = np.flatnonzero(radiance.any(axis=1))
        if not len(met):
            return None
        value, density = self._evaluated(wi, reaches)
        trust = np.divide(trusted(density, pdf), density, out=0.0 * density, where=density > 0.0)
        finite = met[np.isfinite(distance[met])]
        if len(finite):
            way = pick(wi, finite) * distance[finite, None] + pick(self._lift, finite)
            wi = wi.copy(order="K")
            distance[finite] = np.sqrt(dot(way, way))
            wi[finite] = way / distance[finite, None]
        value *= trust[:, None]
        return LightSample(wi, distance, trust, density), value * radiance


def trusted(own: Floats, other: Floats) -> Floats:
    """Return own²/(own² + other²), (n,), of densities."""
    ratio = np.divide(other, own, out=np.zeros_like(own), where=own > 0.0)
    return 1.0 / (1.0 + np.minimum(ratio, 1e150) ** 2)
