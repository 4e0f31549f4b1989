# SPDX-License-Identifier: GPL-3.0-or-later
"""How the materials of a scene answer beams of light, measured on the surfaces that have them.

A beam from ω_i is followed to all ω_r: a material's lobes are made as each ω_r sees them, and
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

import numpy as np

from .arrays import Floats, Ints
from .bsdfs import Frame, Lobe, Mixture
from .bsdfs._diffuse import Diffuse, cosine_weighted
from .cameras import camera_rays
from .closures import Closures
from .direct import Visibility
from .rays import Hits
from .sampling import Points
from .scene import Material, Mesh, Scene
from .shading import Shading, contexts
from .surfaces import Geometry, Surface, dot, normalized
from .textures import SOURCES, Context, Expression

ANGLES_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 85.0, 89.0, 89.9)
PLACES = 64  # points on the surfaces of a material that varies
IN_VIEW = 20_000  # rays that look for points of materials that are known in view alone
DIRECTIONS, ALONE = 64, 512  # ω_r of each place and angle, and of one that stands for all
EVEN = 0.25  # share of the ω_r that are drawn by the cosine
BY_VIEW = {"ShaderNodeFresnel", "ShaderNodeLayerWeight", "ShaderNodeCameraData", "EMITTED"}
HERE = {
    ("ShaderNodeNewGeometry", each) for each in ("Normal", "True Normal", "Incoming", "Tangent")
}


@dataclass(frozen=True)
class Response:
    """How a material answers beams at places (p) and angles (a), by channel; all (p, a, 3)."""

    albedo: Floats  # share of the light that leaves in all directions
    furnace: Floats  # what is seen in white surroundings
    asymmetry: Floats  # as above
    least: Floats  # the smallest f [1/sr]


@dataclass(frozen=True)
class Spots:
    """Points (n,) of one material: what a ray would have hit there, and of what measurement."""

    hits: Hits
    subpixel: Ints | None

    def take(self, rows: Ints) -> Spots:
        return Spots(self.hits.take(rows), None if self.subpixel is None else self.subpixel[rows])


class Goniometer:
    """Measures the materials of a scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene = replace(scene, meshes=tuple(replace(m, normals=None) for m in scene.meshes))
        self._areas = [_areas(mesh) for mesh in scene.meshes]
        self._geometry = Geometry(self.scene)
        self._closures = Closures(self.scene, self._geometry)
        self._albedo, self._passing, self._normals = (
            Shading(self.scene, self._geometry, name)
            for name in ("albedo", "transmittance", "normal")
        )

    def spots(self, index: int) -> Spots | None:
        """Return some `PLACES` points of a material, one where it is the same all over.

        None where none are known.
        """
        material = self.scene.materials[index]
        found = self._in_view(index) if material.measured else self._by_area(index)
        if found is None or any(map(_varies, expressions(material))):
            return found
        return found.take(np.zeros(1, dtype=np.int64))

    def _by_area(self, index: int) -> Spots | None:
        rng = np.random.default_rng(1)
        shares = [self._shares(k, index) for k in range(len(self.scene.instances))]
        total = np.array([share.sum() for share in shares])
        if not total.any():
            return None
        count = rng.multinomial(PLACES, total / total.sum())
        instance = np.repeat(np.arange(len(count)), count)
        some = [
            rng.choice(len(s), n, p=s / s.sum()) for s, n in zip(shares, count, strict=True) if n
        ]
        root, part = np.sqrt(rng.random(PLACES)), rng.random(PLACES)
        barycentric = root * (1.0 - part), root * part
        return Spots(Hits(instance, np.concatenate(some), *barycentric, np.ones(PLACES)), None)

    def _shares(self, number: int, index: int) -> Floats:
        """Return the area of each triangle of an instance that has the material, about."""
        instance = self.scene.instances[number]
        if instance.proxy or index not in instance.materials:
            return np.zeros(1)
        slots = np.minimum(self.scene.meshes[instance.mesh].slots, len(instance.materials) - 1)
        has = np.array(instance.materials)[slots] == index
        scale = np.abs(np.linalg.det(instance.world_from_object[:3, :3])) ** (2.0 / 3.0)
        return np.where(has, self._areas[instance.mesh], 0.0) * max(float(scale), 1e-12)

    @cached_property
    def _view(self) -> Spots | None:
        """What the camera sees at some of the points where Blender was asked."""
        scene = self.scene
        if scene.measured is None or scene.camera is None:
            return None
        rows, columns = scene.measured.shape[1:3]
        every = rows * columns
        subpixel = np.random.default_rng(2).choice(every, min(IN_VIEW, every), False)
        row, column = np.divmod(subpixel, columns)
        where = np.stack([column + 0.5, rows - row - 0.5]).T * (scene.resolution[0] / columns)
        rays = camera_rays(scene.camera, scene.resolution, where)
        met, hits = rays.met(Visibility(scene).camera)
        return Spots(hits, subpixel[met])

    def _in_view(self, index: int) -> Spots | None:
        if self._view is None or not len(self._view.hits.instance):
            return None
        axis = np.zeros((len(self._view.hits.instance), 3))
        own = np.flatnonzero(self._geometry.surface(self._view.hits, axis).material == index)
        return self._view.take(own[:PLACES]) if len(own) else None

    def surface(self, spots: Spots, towards: Floats) -> Surface:
        """Return the surface at spots, seen from `towards` (n, 3)."""
        surface = replace(self._geometry.surface(spots.hits, -towards), subpixel=spots.subpixel)
        bent = normalized(self._normals.at(surface))
        bent *= np.where(dot(bent, surface.geometric_normal) < 0.0, -1.0, 1.0)[:, None]
        normal = np.where(bent.any(axis=1)[:, None], bent, surface.normal)
        return replace(surface, normal=np.asfortranarray(normal))

    def front(self, spots: Spots) -> Floats:
        """Return the geometric normals (n, 3) of the front."""
        surface = self._geometry.surface(spots.hits, np.ones((len(spots.hits.instance), 3)))
        side = 1.0 if surface.backfacing is None else np.where(surface.backfacing, -1.0, 1.0)
        return surface.geometric_normal * np.reshape(side, (-1, 1))

    def contexts(self, spots: Spots, index: int) -> Iterator[Context]:
        """Yield what is known at spots of a material, seen straight on."""
        surface = self.surface(spots, self.front(spots))
        for _, _, context in contexts(self.scene, self._geometry, surface, [index]):
            yield context

    def lobes(self, surface: Surface) -> list[Lobe]:
        """Return all that a single material does with light, as it is seen."""
        albedo, n = self._albedo.at(surface), len(surface.point)
        found: list[Lobe] = []
        if albedo.any():
            frame, white = Frame.around(surface.normal), np.ones((n, 3))
            found.append(Diffuse(albedo, frame, surface.incoming, np.zeros(n), white))
        scattering = self._closures.at(surface)
        for rows, mixture in scattering.parts if scattering else ():
            found += [lobe.at(np.argsort(rows)) for lobe in mixture.parts]
        return found

    def response(
        self, spots: Spots, angles_deg: Sequence[float], count: int, seed: int
    ) -> Response:
        """Return the response of each spot at each angle, to `count` directions each."""
        shape = len(spots.hits.instance), len(angles_deg), count
        place, angle, index = (each.ravel() for each in np.indices(shape))
        cosine: Floats = np.cos(np.radians(angles_deg))[angle]
        spots = spots.take(place)
        uniform = Points(place, angle, index, seed)
        turn = 2.0 * np.pi * Points(place, place, np.zeros_like(place), 0).pair(0)[:, 0]
        up = self.front(spots)
        frame, sine = Frame.around(up), np.sqrt(1.0 - cosine**2)
        local = [sine * np.cos(turn), sine * np.sin(turn), cosine]
        wi = frame.world(np.array(local, dtype=np.float64).T)
        surface = self.surface(spots, wi)
        straight = self._passing.at(surface).reshape(*shape, 3)[:, :, 0]
        parts = self.lobes(surface)
        if not parts:
            dark = np.zeros_like(straight)
            return Response(straight, straight, dark, dark)
        mixture, through = Mixture.of(parts), any(part.transmits for part in parts)
        wr = mixture.sample(uniform.pair(0))
        even = index < EVEN * count
        below = through & (uniform.pair(2)[:, 0] < 0.5)
        spread = frame.world(cosine_weighted(uniform.pair(1)))
        wr[even] = np.where(below[even, None], -spread[even], spread[even])
        leaving = dot(wr, up)
        failed = np.abs(leaving) < 1e-6
        wr[failed], leaving = up[failed], np.where(failed, 1.0, leaving)
        gathered, density = mixture.evaluate(wr)
        by_cosine = np.abs(leaving) / np.pi * (0.5 if through else leaving > 0.0)
        weight = np.where(failed, 0.0, 1.0 / ((1.0 - EVEN) * density + EVEN * by_cosine))
        back = self.lobes(self.surface(spots, wr))
        sent = Mixture.of(back).evaluate(wi)[0] if back else np.zeros_like(gathered)
        sent = sent * (np.abs(leaving) / cosine)[:, None]
        sent = np.where(leaving[:, None] > 0.0, sent, gathered)
        f = np.where(failed, 0.0, 1.0 / np.abs(leaving))[:, None] * sent

        def mean(values: Floats) -> Floats:
            return np.mean((values * weight[:, None]).reshape(*shape, 3), axis=2)

        both = np.maximum(mean(0.5 * (np.abs(sent) + np.abs(gathered))), 1e-12)
        return Response(
            albedo=mean(sent) + straight,
            furnace=mean(gathered) + straight,
            asymmetry=mean(np.abs(sent - gathered)) / both,
            least=f.reshape(*shape, 3).min(axis=2),
        )


def expressions(material: Material) -> Iterator[Expression]:
    """Yield all that a material's reflection depends on."""
    own = (material.albedo_texture, material.transmittance_texture, material.normal)
    yield from filter(None, own)
    for closure in material.closures:
        yield from (closure.weight, *closure.inputs.values())
        yield from filter(None, (closure.normal, closure.tangent))


def _varies(expression: Expression) -> bool:
    """Return whether it depends on the place, not just on who looks from where."""
    return any(kind in SOURCES and kind not in BY_VIEW for kind, _ in expression.kinds - HERE)


def _areas(mesh: Mesh) -> Floats:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
    return 0.5 * np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=1))
