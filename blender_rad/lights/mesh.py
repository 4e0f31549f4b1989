# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh emitter: triangles of uniform or textured radiance, shining from both faces.

=================== ======================= ====================================================
parameter           unit                    meaning
=================== ======================= ====================================================
`rgb`               W/(m² sr)               radiance L = strength × colour of the material, or
                                            a factor on that of `texture`
`triangles`         bu                      (m, 3, 3) corners in the world
=================== ======================= ====================================================

Derivation. Each triangle is a Lambert polygon; E = L Σ |E_i| over the triangles, since each shines
from both faces. Triangles are unoccluded by one another here: what hides what is the estimator's
to find. To points on itself a triangle sends nothing. Each face emits πLA, so Φ = 2πLA; of a closed
mesh half of that hits its own inside and `leaving_flux` is the rest. Up to 64 triangles are summed
in closed form at points that see all of them from the same face: elsewhere they hide each other,
and the sum tells little. Samples pick triangles by area, textured ones half by area and half by the
power that a few points in each let expect: with the chance q_i, a point at the distance r gets

    p = q_i r²/(A_i |cosθ_i|)  [1/sr]

of the triangle picked alone. Next to it L/p ~ 1/r² has no bound. So a share β of samples goes by
cosθ/π over the hemisphere, and their density is (1 - β) p + β cosθ/π, of the first triangle in that
direction: what lies behind it is hidden anyway. β is half of what the mesh may cover of the view,
min(1, Σ A/π(d² + s²)) over up to `BOXES` boxes of triangles of the area A, at the distance d, with
half a diagonal s; and 0 below `FAR_SHARE`, and where a mesh does not hide what lies behind.
Flux and intensity of textured ones are means over these points. The radiance is the same in both
models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from . import _geometry as geometry
from ._base import LIGHTS, Array, Light, LightSample

if TYPE_CHECKING:
    from ..rays import Caster

CLOSED_FORM_TRIANGLES = 64  # above it, summing polygons costs more than sampling is worth
ON_IT = 1e-6  # in units of the root of a triangle's area: points so near its plane lie in it
# Of the far field: shapes that hide parts of themselves to about 1 %.
FAR_POINTS, FAR_DIRECTIONS = 1024, 128
SURFACE = 1e-5  # rays start so far off it, in units of the root of its area
PAIRS = 1 << 20  # ray-triangle pairs at once: 8 MB an array
TRIED, MOST_TRIED, FEWEST_TRIED = 1 << 16, 1024, 4  # points of a texture: of all, of a triangle
EVENLY = 0.5  # of a texture's samples go by area
BOXES, FAR_SHARE = 16, 0.005
LIFT = 1e-4  # of the root of the area: rays from the mesh itself start so far off it

Texture = Callable[[NDArray[np.int64], Array, Array], Array]


@LIGHTS.register("MESH")
@dataclass(frozen=True, kw_only=True)
class MeshLight(Light):
    """Triangles of uniform radiance.

    Attributes
    ----------
    triangles : (m, 3, 3) corners in the world [bu].
    texture : gives the radiance (n, 3) of triangles (n,) at the weights (2, n) of their second and
        third corners towards viewers (n, 3) [bu]; None where `rgb` says it all.
    solid : whether it hides what of it lies behind.
    """

    kind: ClassVar[str] = "MESH"
    triangles: Array
    texture: Texture | None = None
    solid: bool = True

    @property
    def is_found(self) -> bool:
        return self.solid

    @cached_property
    def _normals(self) -> Array:
        """Normals (m, 3) of twice the triangles' areas."""
        corners: Array = self.triangles.astype(np.float64)
        edges: Array = corners[:, 1:] - corners[:, :1]
        normals: Array = np.cross(edges[:, 0], edges[:, 1])
        return normals

    @cached_property
    def _offsets(self) -> Array:
        """N·a (m,) of the triangles' planes."""
        return np.sum(self._normals * self.triangles[:, 0], axis=1)

    @cached_property
    def _areas(self) -> Array:
        """Areas (m,) [bu²]."""
        return 0.5 * np.sqrt(geometry.dot(self._normals, self._normals))

    @property
    def _area(self) -> float:
        return float(self._areas.sum())

    @cached_property
    def _tried(self) -> Array:
        """Radiance over `rgb` at points of each triangle, on its front and back, (m, k, 2, 3)."""
        count = len(self.triangles)
        if self.texture is None:
            return np.ones((count, 1, 2, 3))
        each = int(np.clip(TRIED // max(count, 1), FEWEST_TRIED, MOST_TRIED))
        u = geometry.lattice(each)
        root = np.sqrt(u[:, 0])
        uv = np.tile([1.0 - root, root * u[:, 1]], count)
        i = np.repeat(np.arange(count), each)
        sides = [self.texture(i, uv, side * self._normals[i]) for side in (1.0, -1.0)]
        return np.stack(sides, axis=1).reshape(count, each, 2, 3)

    @cached_property
    def _mean(self) -> Array:
        """Mean radiance over `rgb`, (3,)."""
        return self._areas @ self._tried.mean(axis=(1, 2)) / (self._area or 1.0)

    @cached_property
    def _cumulative(self) -> Array:
        """Cumulated chances (m,) of triangles."""
        power = self._areas * np.abs(self._tried).mean(axis=(1, 2, 3))
        share = self._areas / (self._area or 1.0)
        if power.any():
            share = EVENLY * share + (1.0 - EVENLY) * power / power.sum()
        upto: Array = np.cumsum(share)
        return upto / upto[-1]

    @cached_property
    def _boxes(self) -> tuple[Array, Array, Array]:
        """Boxes of neighbours: centres and half sizes (k, 3), areas over π (k,)."""
        middle = self.triangles.mean(axis=1)
        parts = [np.arange(len(middle))]
        while len(parts) < min(BOXES, len(middle)):
            wide = [(float(np.ptp(middle[own], axis=0).max()), len(own)) for own in parts]
            own = parts.pop(wide.index(max(wide)))
            along = middle[own, np.argmax(np.ptp(middle[own], axis=0))]
            parts += np.array_split(own[np.argsort(along)], 2)
        corners = [self.triangles[own].reshape(-1, 3) for own in parts]
        low, high = (np.array([f(each, axis=0) for each in corners]) for f in (np.min, np.max))
        areas = np.array([self._areas[own].sum() for own in parts])
        return (low + high) / 2.0, (high - low) / 2.0, areas / np.pi

    def _turned(self, points: Array) -> Array:
        """Return β at points (n, 3), the share of samples that go by the cosine, (n,)."""
        cover = np.zeros(len(points))
        for centre, half, area in zip(*(self._boxes if self.solid else ()), strict=True):
            squared = np.full(len(points), half @ half)
            for x, middle, reach in zip(points.T, centre, half, strict=True):
                squared += np.maximum(np.abs(x - middle) - reach, 0.0) ** 2
            cover += area / np.maximum(squared, geometry.TINY)
        share = np.minimum(cover, 1.0) / 2.0
        return np.where(share < FAR_SHARE, 0.0, share)

    def sample(self, points: Array, normals: Array, u: Array) -> LightSample:
        total = self._area
        if total == 0.0:
            nothing = np.zeros(len(points))
            return LightSample(normals.copy(), nothing, nothing, nothing)
        turned = self._turned(points)
        first = (u[:, 0] - turned) / (1.0 - turned)
        position, i, uv, density = self._place(np.stack([np.maximum(first, 0.0), u[:, 1]], axis=1))
        rows = np.flatnonzero(first < 0.0)
        if len(rows):
            again = np.stack([u[rows, 0] / turned[rows], u[rows, 1]], axis=1)
            wi, _ = geometry.sample_hemisphere(normals[rows], again)
            lifted = points[rows] + LIFT * np.sqrt(total) * normals[rows]
            distance, which, where = self._find(lifted, wi)
            met = (distance > 10.0 * LIFT * np.sqrt(total)) & np.isfinite(distance)
            position[rows] = lifted + np.where(met, distance, 1.0)[:, None] * wi
            hit = rows[met]
            i[hit], uv[:, hit], density[rows] = which[met], where[:, met], np.inf
            density[hit] = self._density_on[i[hit]]
        wi = position - points
        squared = np.maximum(geometry.dot(wi, wi), geometry.TINY)
        distance = np.sqrt(squared)
        tint = None if self.texture is None else self.texture(i, uv, -wi)
        wi /= distance[:, None]
        angle = np.abs(geometry.dot(self._normals[i], wi)) / (2.0 * self._areas[i] * squared)
        by_cosine = turned * np.maximum(geometry.dot(normals, wi), 0.0) / np.pi
        weight = angle / ((1.0 - turned) * density + by_cosine * angle)
        return LightSample(wi, distance, weight, 1.0 / np.maximum(weight, geometry.TINY), tint)

    @cached_property
    def _chances(self) -> Array:
        """Chances (m,) of triangles to be picked by area."""
        return np.diff(self._cumulative, prepend=0.0)

    @cached_property
    def _density_on(self) -> Array:
        """Density (m,) [1/bu²] of points picked by area."""
        return self._chances / np.maximum(self._areas, geometry.TINY)

    def _place(self, u: Array) -> tuple[Array, NDArray[np.int64], Array, Array]:
        """Return positions (n, 3), their triangles (n,), places (2, n) and densities [1/bu²]."""
        at = u[:, 0]
        i = np.minimum(np.searchsorted(self._cumulative, at, side="right"), len(self.triangles) - 1)
        left = np.clip(1.0 - (self._cumulative[i] - at) / self._chances[i], 0.0, 1.0)
        root = np.sqrt(left)
        a, b, c = (self.triangles[i, corner] for corner in range(3))
        s, t = 1.0 - root, root * u[:, 1]
        position = a + s[:, None] * (b - a) + t[:, None] * (c - a)
        return position, i, np.stack([s, t]), self._density_on[i]

    def irradiance(self, points: Array, normals: Array) -> Array | None:
        if self.texture is not None or len(self.triangles) > CLOSED_FORM_TRIANGLES:
            return None
        side = points @ self._normals.T - self._offsets
        off = np.abs(side) > ON_IT * np.sum(self._normals**2, axis=1) ** 0.75
        before, behind = np.any(off & (side > 0.0), axis=1), np.any(off & (side < 0.0), axis=1)
        alike = np.flatnonzero(~(before & behind))
        total = np.full(len(points), np.nan)
        total[alike] = 0.0
        for triangle, seen in zip(self.triangles, off.T, strict=True):
            at = alike[seen[alike]]
            total[at] += np.abs(geometry.polygon_irradiance(triangle, points[at], normals[at]))
        return total

    def intersect(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        distance, radiance, _ = self._look(origins, directions)
        return distance, radiance

    def look(self, points: Array, normals: Array, wi: Array) -> tuple[Array, Array, Array]:
        distance, radiance, i = self._look(points, wi)
        facing = np.maximum(np.abs(geometry.dot(self._normals[i], wi)), geometry.TINY)
        by_area = self._density_on[i] * 2.0 * self._areas[i] * distance**2 / facing
        turned = self._turned(points)
        by_cosine = np.maximum(geometry.dot(normals, wi), 0.0) / np.pi
        return distance, radiance, (1.0 - turned) * by_area + turned * by_cosine

    def _look(self, origins: Array, directions: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return `intersect` and the triangles (n,) that are met."""
        distance, i, uv = self._find(origins, directions)
        hit = np.flatnonzero(np.isfinite(distance))
        if self.texture is None:
            radiance = np.zeros(len(origins))
            radiance[hit] = 1.0
            return distance, radiance, i
        radiance = np.zeros((len(origins), 3))
        radiance[hit] = self.texture(i[hit], uv[:, hit], -directions[hit] * distance[hit, None])
        return distance, radiance, i

    def _find(self, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return distance (n,), triangle (n,) and place (2, n) of rays' first hits."""
        if len(self.triangles) > CLOSED_FORM_TRIANGLES:
            return self._nearest_of_many(origins, directions)
        batch = max(PAIRS // len(self.triangles), 1)
        starts = range(0, max(len(origins), 1), batch)
        found = [self._nearest(origins[k : k + batch], directions[k : k + batch]) for k in starts]
        distance, i, uv = zip(*found, strict=True)
        return np.concatenate(distance), np.concatenate(i), np.concatenate(uv, axis=1)

    def _nearest_of_many(
        self, origins: Array, directions: Array
    ) -> tuple[Array, NDArray[np.int64], Array]:
        """Return what `_nearest` does, in single precision."""
        caster, centre = self._caster
        hits = caster.intersect(origins - centre, directions)
        return hits.distance, np.maximum(hits.triangle, 0), np.stack([hits.u, hits.v])

    def _nearest(self, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return distance (n,), triangle (n,), place (2, n) of rays' first hits: Cramer's rule.

        o + t d = a + s e + q f, with N = e × f, h = (a - o) × d: t = N·(a-o)/N·d, s = h·f/N·d,
        q = -h·e/N·d.
        """
        a = self.triangles[:, 0]
        e, f = self.triangles[:, 1] - a, self.triangles[:, 2] - a
        slope = directions @ self._normals.T
        parallel = slope == 0.0
        slope[parallel] = 1.0
        turn = np.cross(a - origins[:, None], directions[:, None])
        s = np.einsum("nmi,mi->nm", turn, f) / slope
        q = -np.einsum("nmi,mi->nm", turn, e) / slope
        t = (self._offsets - origins @ self._normals.T) / slope
        hit = (s >= 0.0) & (q >= 0.0) & (s + q <= 1.0) & (t > 0.0) & ~parallel
        t = np.where(hit, t, np.inf)
        first = np.argmin(t, axis=1)
        rows = np.arange(len(t))
        return t[rows, first], first, np.stack([s[rows, first], q[rows, first]])

    def radiant_flux(self) -> Array:
        return self.rgb * self._mean * (2.0 * np.pi * self._area)

    def leaving_flux(self) -> Array:
        return self.radiant_flux() * self._far[0]

    def peak_radiant_intensity(self) -> Array:
        return self.rgb * self._mean * self._far[1]

    def peak_radiance(self) -> Array:
        return self.rgb * self._tried.max(axis=(0, 1, 2), initial=0.0)

    @cached_property
    def _far(self) -> tuple[float, float]:
        """Return the share of the flux that leaves, and the peak intensity [bu²/sr] over `rgb`.

        I(ω) = A ⟨|n·ω| V⟩ over points of the surface, with V whether ω leaves it there. Directions
        come with their opposites: of a closed convex mesh exactly half leaves, of a plane all.
        """
        if self._area == 0.0:
            return 0.0, 0.0
        points, i, _, _ = self._place(geometry.lattice(FAR_POINTS))
        normals = self._normals[i] / (2.0 * self._areas[i, None])
        up = np.tile([0.0, 0.0, 1.0], (FAR_DIRECTIONS, 1))
        half = geometry.sample_cone(up, np.ones(len(up)), geometry.lattice(FAR_DIRECTIONS))
        directions = np.concatenate([half, -half, normals[:: FAR_POINTS // FAR_DIRECTIONS]])
        cos = directions @ normals.T
        sides = points + SURFACE * np.sqrt(self._area) * np.sign(cos)[..., None] * normals
        seen = self._leaves(sides.reshape(-1, 3), np.repeat(directions, len(points), axis=0))
        emitted = np.abs(cos)
        intensity = self._area * np.mean(emitted * seen.reshape(cos.shape), axis=1)
        whole = slice(0, 2 * FAR_DIRECTIONS)
        share = intensity[whole].mean() / (self._area * emitted[whole].mean())
        return float(share), float(intensity.max())

    def _leaves(self, origins: Array, directions: Array) -> NDArray[np.bool_]:
        """Return whether rays (n, 3) pass by the triangles, (n,)."""
        caster, centre = self._caster
        return ~caster.occluded(origins - centre, directions, np.full(len(origins), np.inf))

    @cached_property
    def _caster(self) -> tuple[Caster, Array]:
        """What casts rays against the triangles about a centre (3,), and this."""
        from ..rays import Caster
        from ..scene import Instance, Mesh

        centre = self.triangles.mean(axis=(0, 1))
        count = len(self.triangles)
        mesh = Mesh(
            name=self.name,
            vertices=(self.triangles.reshape(-1, 3) - centre).astype(np.float32),
            triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
            normals=None,
            smooth=np.zeros(count, dtype=np.bool_),
            slots=np.zeros(count, dtype=np.int32),
        )
        return Caster([mesh], [Instance(self.name, 0, np.eye(4), (0,))], [0]), centre

    @classmethod
    def examples(cls) -> list[Light]:
        rgb = np.array([0.3, 0.4, 0.5])
        corners = np.array([[-0.5, 0.0, 1.5], [0.6, -0.2, 1.4], [0.1, 0.7, 1.9], [0.2, 0.1, 2.2]])
        faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
        return [
            cls(name="triangle", rgb=rgb, triangles=corners[faces[:1]]),
            cls(name="tetrahedron", rgb=rgb, triangles=corners[faces]),
        ]
