# SPDX-License-Identifier: GPL-3.0-or-later
"""The three laws of the lecture, put to the materials of a scene.

f(i, r) ≥ 0, f(i, r) = f(r, i), and of light from any ω_i no more than all leaves: ∫ f cosθ_r dω_r
≤ 1. A beam from ω_i is followed to all ω_r: a material's lobes are made as each ω_r sees them, and
f(i → r) cosθ_r = (f |n·ω_i|) cosθ_r/cosθ_i with the cosines of the surface and n of the lobe, so
that a bent normal does not hide what it does to the light. The ω_r are drawn from the lobes as ω_i
sees them, a quarter of them by the cosine. The same ω_r tell f(r → i), hence the asymmetry

    ∫ |f(i → r) − f(r → i)| cosθ_r dω_r / ∫ (f(i → r) + f(r → i))/2 cosθ_r dω_r

and the white furnace, what is seen from ω_i in surroundings of radiance 1: ∫ f(r → i) cosθ_r dω_r.
What goes through the surface is counted as the viewer gathers it, for Cycles does not scale
radiance by η² there. Normals of the mesh are left out: they are no property of the material.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from .bsdfs import BSDFS, Frame, Inputs, Lobe, Mixture, lobes
from .bsdfs._diffuse import Diffuse, cosine_weighted
from .errors import Finding
from .plausible import RANGES, nearest
from .sampling import Points
from .scene import Closure, Instance, Material, Mesh, Scene
from .shading import context_on
from .surfaces import dot, normalized
from .textures import SOURCES, Context, Expression, constant

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ANGLES_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 85.0, 89.0)
PLACES = 64  # points on the surfaces of a material that varies
DIRECTIONS, ALONE = 64, 512  # ω_r of each place and angle, and of one that stands for all
REFINED, MOST = 4, 2048  # the brightest are looked at again by so many
EVEN = 0.25  # share of the ω_r that are drawn by the cosine
ENERGY = 0.005  # above 1, that is not yet a broken law: the error of so many directions
ASYMMETRY = 1e-4  # likewise, far above rounding
TRIANGLE = Mesh(
    "", np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), None, *np.zeros((2, 1), int)
)
STEEP = 7  # angles up to 60°: there Blender's closures keep the furnace within
OWN = 0.02  # of 1
LOST = "lost energy is given back by the viewer's angle alone"
BACKS = "light that passes counts on facets that it meets from behind"
KNOWN = {
    "ShaderNodeBsdfPrincipled": "layers take from those below by the viewer's angle alone",
    "ShaderNodeBsdfSheen": "the fit of the fibres knows the viewer's angle alone",
    "ShaderNodeBsdfAnisotropic": LOST,
    "ShaderNodeBsdfMetallic": LOST,
    "ShaderNodeBsdfGlass": f"{LOST}; {BACKS}",
    "ShaderNodeBsdfRefraction": BACKS,
}
EXACT = {"GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY", "SHARP"}  # distributions that lose energy instead
BY_VIEW = {"ShaderNodeFresnel", "ShaderNodeLayerWeight", "ShaderNodeCameraData"}
HERE = {
    ("ShaderNodeNewGeometry", each) for each in ("Normal", "True Normal", "Incoming", "Tangent")
}
DIFFUSE = {"ShaderNodeBsdfDiffuse": "Color", "ShaderNodeBsdfTranslucent": "Color"}
METAL = {"ShaderNodeBsdfMetallic": "Base Color"}


@dataclass(frozen=True, eq=False)
class Place:
    """Points on one instance: the triangles (n,) of its mesh and barycentric (2, n)."""

    mesh: Mesh
    instance: Instance
    triangle: Ints
    uv: Array

    def context(self, rows: Ints, towards: Array) -> Context:
        """Return what is known at the points `rows` (k,), seen from `towards` (k, 3)."""
        return context_on(self.mesh, self.instance, self.triangle[rows], self.uv[:, rows], towards)


@dataclass(frozen=True)
class Response:
    """How a material answers beams at places (p) and angles (a), by channel; all (p, a, 3).

    Attributes
    ----------
    albedo : share of the light that leaves in all directions.
    furnace : what is seen in white surroundings.
    asymmetry : as above.
    least : (p, a, 3) the smallest f [1/sr].
    """

    albedo: Array
    furnace: Array
    asymmetry: Array
    least: Array


@dataclass(frozen=True)
class Judged:
    """A material put to the laws; all but name and findings None where it is not supported.

    Attributes
    ----------
    max_albedo, max_albedo_angle_deg : the largest share reflected, of any channel, and where.
    asymmetry : the largest, of 2.
    angles_deg, albedo, furnace : mean over the surface by angle of incidence and of view; (a, 3).
    """

    name: str
    supported: bool
    findings: tuple[Finding, ...]
    positive: bool | None = None
    reciprocal: bool | None = None
    energy_conserving: bool | None = None
    max_albedo: float | None = None
    max_albedo_angle_deg: float | None = None
    asymmetry: float | None = None
    angles_deg: tuple[float, ...] | None = None
    albedo: Array | None = None
    furnace: Array | None = None


def judge(scene: Scene) -> list[Judged]:
    """Return all materials of a scene with what the laws say, in its order."""
    places = Places(scene)
    return [_judged(scene, places, k) for k in range(len(scene.materials))]


def _judged(scene: Scene, places: Places, index: int) -> Judged:
    material = scene.materials[index]
    missing = [each.feature for each in material.unsupported]
    missing += [c.kind for c in material.closures if c.kind not in BSDFS]
    missing += ["values that only Blender can compute"] * material.measured
    if missing:
        said = "cannot be judged: " + ", ".join(dict.fromkeys(missing))
        finding = Finding("unsupported", "info", material.name, said)
        return Judged(material.name, False, (finding,))
    subject = Subject(material, scene.blender_version, places.of(index))
    found = subject.response()
    most, point, angle = subject.greatest(found, "albedo", len(ANGLES_DEG))
    asymmetry = float(found.asymmetry.max())
    findings = [*_broken(subject, found, most, (point, angle)), *_implausible(subject, scene)]
    return Judged(
        name=material.name,
        supported=True,
        findings=tuple(findings),
        positive=bool(found.least.min() >= 0.0),
        reciprocal=asymmetry < ASYMMETRY,
        energy_conserving=most < 1.0 + ENERGY,
        max_albedo=most,
        max_albedo_angle_deg=ANGLES_DEG[angle],
        asymmetry=asymmetry,
        angles_deg=ANGLES_DEG,
        albedo=found.albedo.mean(axis=0),
        furnace=found.furnace.mean(axis=0),
    )


def _broken(
    subject: Subject, found: Response, most: float, where: tuple[int, int]
) -> Iterator[Finding]:
    """Yield a finding for each law that is broken: where, by how much, and why if that is known."""
    name, least = subject.material.name, found.least.min(axis=2)
    if least.min() < 0.0:
        point, angle = np.unravel_index(np.argmin(least), least.shape)
        place = subject.where(int(point), int(angle))
        said = f"f is {least.min():.3g} sr⁻¹ {place}: less than no light"
        yield Finding("not-positive", "error", name, said)
    reasons = subject.reasons
    if most >= 1.0 + ENERGY:
        colours = subject.colours_above_one(where[0])
        seen, point, angle = subject.greatest(found, "furnace", STEEP)
        ours = not reasons or seen >= 1.0 + OWN
        said = f"{most:.4g} of the light leaves that comes {subject.where(*where)}"
        if seen >= 1.0 + OWN:
            said += f", and {seen:.4g} are seen of white surroundings {subject.where(point, angle)}"
        why = colours or ("nothing shares it out" if ours else f"by construction, {reasons}")
        percent = 100.0 * (most - 1.0)
        yield Finding("gains-energy", "error" if ours else "info", name, f"{said}: {why}", percent)
    worst = found.asymmetry.max(axis=2)
    if worst.max() >= ASYMMETRY:
        point, angle = np.unravel_index(np.argmax(worst), worst.shape)
        place = subject.where(int(point), int(angle))
        said = f"to and fro differ by {100.0 * worst.max():.3g} % {place}"
        said += f": by construction, {reasons}" if reasons else ""
        yield Finding("not-reciprocal", "info" if reasons else "error", name, said)


def _implausible(subject: Subject, scene: Scene) -> Iterator[Finding]:
    """Yield a finding for each number that no, or hardly any, measured surface has."""
    name, weights = subject.material.name, np.array(scene.luminance_weights)
    for quantity, socket, values in subject.numbers():
        level = values @ weights if values.shape[1] == 3 else values[:, 0]
        low, high = RANGES[quantity]
        for end, out in (("low", level < low), ("high", level > high)):
            if out.any():
                value, share = float(np.mean(level[out])), 100.0 * np.mean(out)
                said = f"{socket} is {value:.3g} on {share:.3g} % of it, where by {quantity}"
                code = f"{quantity.replace(' ', '-').lower()}-{end}"
                severity = "info" if quantity == "reflectance" and value < low else "warning"
                yield Finding(code, severity, name, f"{said} {nearest(quantity, value)}")


class Places:
    """Finds points on the surfaces of each material, as many as their area says."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._meshes = [replace(mesh, normals=None) for mesh in scene.meshes]
        self._areas = [_areas(mesh) for mesh in scene.meshes]

    def of(self, material: int, seed: int = 1) -> list[Place]:
        """Return some `PLACES` points on the material, by instance; one where it does not vary."""
        shares = [self._triangles(instance, material) for instance in self._scene.instances]
        total = np.array([share.sum() for share in shares])
        if not total.any():
            alone = Instance("", 0, np.eye(4), (material,))
            return [Place(TRIANGLE, alone, np.zeros(PLACES, np.int64), np.full((2, PLACES), 0.3))]
        rng = np.random.default_rng(seed)
        count = rng.multinomial(PLACES, total / total.sum())
        found: list[Place] = []
        for k in np.flatnonzero(count):
            instance, share = self._scene.instances[k], shares[k]
            triangle = rng.choice(len(share), count[k], p=share / share.sum())
            root, v = np.sqrt(rng.random(count[k])), rng.random(count[k])
            uv = np.stack([root * (1.0 - v), root * v])
            found.append(Place(self._meshes[instance.mesh], instance, triangle, uv))
        return found

    def _triangles(self, instance: Instance, material: int) -> Array:
        """Return the area of each triangle that has the material, about in the world."""
        if instance.proxy or material not in instance.materials:
            return np.zeros(1)
        slots = np.minimum(self._meshes[instance.mesh].slots, len(instance.materials) - 1)
        has = np.array(instance.materials)[slots] == material
        scale = np.abs(np.linalg.det(instance.world_from_object[:3, :3])) ** (2.0 / 3.0)
        return np.where(has, self._areas[instance.mesh], 0.0) * max(scale, 1e-12)


def _areas(mesh: Mesh) -> Array:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
    return 0.5 * np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=1))


@dataclass(frozen=True)
class Subject:
    """A material at places, to be looked at."""

    material: Material
    version: tuple[int, int, int]
    places: Sequence[Place]

    @cached_property
    def points(self) -> list[tuple[Place, int]]:
        """Every point; a single one where the place does not matter."""
        every = [(place, row) for place in self.places for row in range(len(place.triangle))]
        kinds = {each for expression in self._expressions for each in expression.kinds} - HERE
        varies = any(kind in SOURCES and kind not in BY_VIEW for kind, _ in kinds)
        return every if varies else every[:1]

    @property
    def _expressions(self) -> Iterator[Expression]:
        material = self.material
        own = (material.albedo_texture, material.transmittance_texture, material.normal)
        yield from filter(None, own)
        for closure in material.closures:
            yield from (closure.weight, *closure.inputs.values())
            yield from filter(None, (closure.normal, closure.tangent))

    def lobes(self, context: Context) -> list[Lobe]:
        """Return all that the material does with light, as it is seen."""
        n, normal = len(context.incoming), context.normal
        if self.material.normal is not None:
            normal = context.normal = normalized(self.material.normal.rgb(context, n))
        albedo = np.tile(np.array(self.material.albedo), (n, 1))
        if self.material.albedo_texture is not None:
            albedo += self.material.albedo_texture.rgb(context, n)
        white, level = np.ones((n, 3)), np.zeros(n)
        found: list[Lobe] = []
        if albedo.any():
            found.append(Diffuse(albedo, Frame.around(normal), context.incoming, level, white))
        for closure in self.material.closures:
            found += lobes(closure.kind, _inputs(closure, context, self.version))
        return found

    def passing(self, context: Context) -> Array:
        """Return what goes straight through, (n, 3)."""
        n = len(context.incoming)
        found = np.tile(np.array(self.material.transmittance), (n, 1))
        texture = self.material.transmittance_texture
        return found if texture is None else found + texture.rgb(context, n)

    def response(self) -> Response:
        """Return the response of each point at each of `ANGLES_DEG`."""
        count = DIRECTIONS if len(self.points) > 1 else ALONE
        parts = [
            self._response(place, np.array([row for _, row in group]), ANGLES_DEG, count, 1)
            for place, group in groupby(self.points, lambda point: point[0])
        ]
        return Response(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def greatest(self, found: Response, name: str, angles: int) -> tuple[float, int, int]:
        """Return the greatest of a response's field, of any channel, and its point and angle.

        The most promising up to the angle are looked at again: noise is not to pass for light.
        """
        values = getattr(found, name)[:, :angles].max(axis=2)
        best = (0.0, 0, 0)
        for index in np.argsort(-np.round(values, 6), axis=None, kind="stable")[:REFINED]:
            p, a = (int(k) for k in np.unravel_index(index, values.shape))
            place, row = self.points[p]
            again = self._response(place, np.array([row]), ANGLES_DEG[a : a + 1], MOST, 2)
            most = round(float(getattr(Response(*again), name).max()), 9)
            best = max(best, (most, p, a), key=lambda one: one[0])
        return best

    def _response(
        self, place: Place, points: Ints, angles_deg: Sequence[float], count: int, seed: int
    ) -> tuple[Array, Array, Array, Array]:
        """Return a `Response` of points on one instance, to `count` directions each."""
        angles = np.radians(angles_deg)
        shape = len(points), len(angles), count
        rows = np.repeat(points, len(angles) * count)
        cosine = np.tile(np.repeat(np.cos(angles), count), len(points))
        beam = np.arange(len(rows)) // count
        pair = Points(beam, rows + 7, np.arange(len(rows)) % count, seed)
        turn = Points(rows, rows, np.zeros_like(rows), 0).pair(0)[:, 0] * 2.0 * np.pi
        up = place.context(rows, np.ones((len(rows), 3))).geometric
        frame = Frame.around(up)
        local = np.empty((len(rows), 3), order="F")
        local[:, 0], local[:, 1], local[:, 2] = np.cos(turn), np.sin(turn), cosine
        local[:, :2] *= np.sqrt(1.0 - cosine**2)[:, None]
        wi = frame.world(local)
        seen = place.context(rows, wi)
        passing = self.passing(seen)
        parts = self.lobes(seen)
        if not parts:
            still = passing.reshape(*shape, 3)[:, :, 0]
            return still, still, np.zeros_like(still), np.zeros_like(still)
        mixture = Mixture.of(parts)
        through = any(part.transmits for part in parts)
        wr = mixture.sample(pair.pair(0))
        even = np.arange(len(rows)) % count < EVEN * count
        spread = frame.world(cosine_weighted(pair.pair(1)))
        below = through & (pair.pair(2)[:, 0] < 0.5)
        wr[even] = np.where(below[even, None], -spread[even], spread[even])
        leaving = dot(wr, up)
        failed = np.abs(leaving) < 1e-6
        wr[failed], leaving = up[failed], np.where(failed, 1.0, leaving)
        gathered, density = mixture.evaluate(wr)
        cosine_density = np.abs(leaving) / np.pi * (0.5 if through else leaving > 0.0)
        weight = np.where(failed, 0.0, 1.0 / ((1.0 - EVEN) * density + EVEN * cosine_density))
        back = Mixture.of(found) if (found := self.lobes(place.context(rows, wr))) else None
        sent = back.evaluate(wi)[0] if back else np.zeros_like(gathered)
        sent = sent * (np.abs(leaving) / cosine)[:, None]
        sent = np.where(leaving[:, None] > 0.0, sent, gathered)

        def mean(values: Array) -> Array:
            return np.mean((values * weight[:, None]).reshape(*shape, 3), axis=2)

        both = np.maximum(mean(0.5 * (np.abs(sent) + np.abs(gathered))), 1e-12)
        straight = passing.reshape(*shape, 3)[:, :, 0]
        f = sent / np.abs(leaving)[:, None]
        return (
            mean(sent) + straight,
            mean(gathered) + straight,
            mean(np.abs(sent - gathered)) / both,
            np.where(failed[:, None], 0.0, f).reshape(*shape, 3).min(axis=2),
        )

    def where(self, point: int, angle: int) -> str:
        """Return a point and an angle in words."""
        place, row = self.points[point]
        told = f"at {ANGLES_DEG[angle]:.0f}°"
        if len(self.points) == 1:
            return told
        x, y, z = place.context(np.array([row]), np.ones((1, 3))).position[0]
        return f"{told} on {place.instance.name} at ({x:.4g}, {y:.4g}, {z:.4g})"

    @property
    def reasons(self) -> str:
        """Why it breaks laws as far as that is how Blender is made, in words."""
        material, reasons = self.material, dict[str, None]()
        for closure in material.closures:
            exact = closure.settings.get("distribution") in EXACT
            if closure.kind in KNOWN and (not exact or KNOWN[closure.kind] != LOST):
                reasons[KNOWN[closure.kind]] = None
        if {kind for each in self._expressions for kind, _ in each.kinds} & BY_VIEW:
            reasons["Fresnel and Layer Weight nodes know the viewer's angle alone"] = None
        if material.normal or any(closure.normal for closure in material.closures):
            reasons["bent normals weigh the light's angle, not the viewer's"] = None
        return "; ".join(reasons)

    def numbers(self) -> Iterator[tuple[str, str, Array]]:
        """Yield quantities of `plausible.RANGES`, their sockets, and their values (n, 1 or 3)."""
        contexts = [
            place.context(rows, _up(place, rows))
            for place, group in groupby(self.points, lambda point: point[0])
            for rows in [np.array([row for _, row in group])]
        ]

        def values(expression: Expression, width: int) -> Array:
            found = [
                np.broadcast_to(expression.evaluate(c), (len(c.incoming), width)) for c in contexts
            ]
            return np.concatenate(found)

        material = self.material
        albedo = constant(material.albedo)
        if material.albedo_texture is not None:
            albedo = albedo + material.albedo_texture
        if not material.closures and not material.passes and not material.emits:
            yield "reflectance", "Color", values(albedo, 3)
        for closure in material.closures:
            inputs, kind = closure.inputs, closure.kind
            if kind == "ShaderNodeBsdfPrincipled":
                metal = values(inputs["Metallic"], 1)[:, 0] > 0.5
                colour = values(inputs["Base Color"], 3)
                yield "reflectance", "Base Color", colour[~metal]
                yield "reflectance of metal", "Base Color", colour[metal]
            elif kind in DIFFUSE:
                yield "reflectance", DIFFUSE[kind], values(inputs[DIFFUSE[kind]], 3)
            elif kind in METAL and METAL[kind] in inputs:
                yield "reflectance of metal", METAL[kind], values(inputs[METAL[kind]], 3)
            if "IOR" in inputs and kind not in METAL:
                yield "IOR", "IOR", values(inputs["IOR"], 1)

    def colours_above_one(self, point: int) -> str:
        """Return which they are at a point, in words."""
        place, row = self.points[point]
        rows = np.array([row])
        context = place.context(rows, _up(place, rows))
        named = [
            (name, float(expression.evaluate(context).max()))
            for closure in self.material.closures
            for name, expression in closure.inputs.items()
            if ("Color" in name and "Emission" not in name) or name.endswith("Tint")
        ]
        return ", ".join(f"{name} is {value:.4g}" for name, value in named if value > 1.0)


def _up(place: Place, rows: Ints) -> Array:
    """Return the geometric normals of points."""
    return place.context(rows, np.ones((len(rows), 3))).geometric


def _inputs(closure: Closure, context: Context, version: tuple[int, int, int]) -> Inputs:
    """Return what a closure gets at points."""
    n = len(context.incoming)
    normal, tangent = context.normal, None
    if closure.normal is not None:
        normal = normalized(closure.normal.rgb(context, n))
    if closure.tangent is not None:
        tangent = closure.tangent.rgb(context, n)
    return Inputs(
        values={name: each.evaluate(context) for name, each in closure.inputs.items()},
        settings=closure.settings,
        weight=closure.weight.rgb(context, n),
        normal=normal,
        geometric=context.geometric,
        wo=context.incoming,
        tangent=tangent,
        backfacing=context.backfacing[:, 0] > 0.0,
        version=version,
    )
