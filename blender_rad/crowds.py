# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights as one: at each point a few are chosen, by what they send there.

What the camera sees is cut into boxes of place and normal, with a few points in each. From afar, a
light of size s at a distance d, with the intensity I(ω) in the direction ω, sends a point about

    S = I(ω) cosθ/(d² + s²)

of which a share p arrives, as the box's points tell, where the lights that send most are tried. So
h = p S is foreseen: with S at the point itself for the `NEAR` lights that may be the brightest
somewhere in the box, and with its mean S̅ in the box for all others. The picks tell by how much that
is wrong, and c, as in `direct`, what the pixel's other streams have seen of what was foreseen:

    Ê = c Σ h + mean of (f V - c h)/q

The error of h is that of a light which is seen with the chance p, and more: q ∝ S √(p(1 - p) + ε).

`PICKS` strata of q, in which neighbours are next to each other, give a light each. The mean is free
of bias whatever the tables say, since every light keeps a chance. What samples of closures meet is
found through boxes around the lights, each of which they leave once.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .arrays import Floats, Ints, Singles
from .cameras import camera_rays
from .emitters import Emitter
from .film import REST
from .lights import RAYS, Light, LightSample
from .lights._textured import TexturedLight
from .lights.area import AreaLight
from .lights.mesh import MeshLight
from .rays import Caster
from .sampling import Points
from .scene import Camera, Instance, Mesh, Scene
from .surfaces import Surface, dot, normalized

if TYPE_CHECKING:
    from .direct import DirectLight
    from .lights.point import PointLight


FEW = 16  # lights that are sampled one by one
MATTERS = 0.007  # share of the light with which a name keeps its layer; at 0.01 it is judged
SEEN, POINTS = 4096, 4  # points that are looked at, and how many of them a box has at most
PIXELS = 8  # for each of the points
PAIRS = 1 << 22  # of points and lights, at most
TRIES = 64  # lights that are tried at each of the points
NEAR, PICKS = 24, 8
MANY_KINDS = 64
DOUBT = 0.09  # ε
FLAT = 0.1  # least I over its peak
GRAZING = 0.01  # least cosθ
WARY = 0.03  # weight, beside the mean of S, of the most that a light may send
TURN = 0.125  # of the scene's extent: what a normal's unit counts as
SIDE = 32  # directions in a table, squared
FAR = 1e3  # of a light's size: from there its intensity is seen
PLACE = ("position", "center")  # fields for where a light stands
LOOSE = 1e-3  # of a light's size: how much wider its box is
STEP = 1e-6  # of coordinates: where a ray goes on behind a box
TINY = 1e-12  # [bu²], beside squared distances
BY_LIGHT = "rgb _bounds _is_found _kind_of _places _centre _size _brightness"
FIRST_DIMENSION = 1 << 12  # of random numbers, beyond those of single lights


class Boxes:
    """A tree of boxes over points with their normals (n, 3).

    `parts` are the points of each, `corners` (boxes, 2, 3) the least and the greatest of all that a
    box may hold.
    """

    def __init__(self, points: Floats, normals: Floats) -> None:
        self._turn = TURN * np.ptp(points, axis=0).max()
        self._axis, self._split = list[int](), list[float]()
        self._next = list[tuple[int, int]]()  # nodes; of a leaf, itself and its box
        self.parts, cells = list[Ints](), list[Floats]()
        where = self._coordinates(points, normals)
        cell = np.array([points.min(axis=0), points.max(axis=0)])
        self._depth = self._grow(where, np.arange(len(points)), cell, cells)
        self._tree = np.array(self._axis), np.array(self._split), np.array(self._next).ravel()
        self.corners = np.array(cells, dtype=np.float32)

    def _grow(self, where: Floats, own: Ints, cell: Floats, cells: list[Floats]) -> int:
        """Add the node of the points `own` in a `cell`, and those below; return their depth."""
        node = len(self._axis)
        axis = int(np.argmax(where[own].max(axis=0) - where[own].min(axis=0)))
        own = own[np.argsort(where[own, axis], kind="stable")]
        along = where[own, axis]
        steps = np.flatnonzero(along[1:] - along[:-1] > STEP * self._turn) + 1
        self._axis.append(axis)
        if len(own) <= POINTS or not len(steps):
            self._split.append(np.inf)
            self._next.append((node, len(cells)))
            self.parts.append(own)
            cells.append(cell)
            return 0
        half = steps[np.argmin(np.abs(steps - len(own) // 2))]
        split = float(along[half - 1 : half + 1].mean())
        self._split.append(split)
        self._next.append((node + 1, -1))
        below, above = cell.copy(), cell.copy()
        if axis < 3:
            below[1, axis] = above[0, axis] = split
        depth = self._grow(where, own[:half], below, cells)
        self._next[node] = node + 1, len(self._axis)
        return 1 + max(depth, self._grow(where, own[half:], above, cells))

    def _coordinates(self, points: Floats, normals: Floats) -> Floats:
        return np.concatenate([points, self._turn * normals], axis=1)

    def of(self, points: Floats, normals: Floats) -> Ints:
        """Return the box (n,) of points (n, 3)."""
        axis, split, following = self._tree
        where, first = self._coordinates(points, normals).ravel(), 6 * np.arange(len(points))
        node = np.zeros(len(points), dtype=np.int64)
        for _ in range(self._depth):
            beyond = where.take(first + axis.take(node)) > split.take(node)
            node = following.take(2 * node + beyond)
        return following.take(2 * node + 1)


class Crowd:
    """Lights that share a layer, see above; `emitter` is a stand-in, whose `rgb` is 1."""

    def __init__(self, lights: Sequence[Light], surface: Surface, weights: Floats) -> None:
        self.emitter = Emitter(replace(lights[0], rgb=np.ones(3)), 0)
        self.rgb = np.array([light.rgb for light in lights])  # (lights, 3)
        self._bounds = np.array([_bounds(light) for light in lights])
        self._is_found = np.array([light.is_found for light in lights])
        self._kind_of, self._kinds, self._places = _alike(lights)
        low, high = self._bounds.swapaxes(0, 1)
        self._centre = (0.5 * (low + high)).astype(np.float32)
        self._size = (((high - low) ** 2).sum(axis=1) / 12.0).astype(np.float32)
        self._brightness = (np.abs(self.rgb) @ weights).astype(np.float32)
        tables = [_intensities(one, weights) for one, _ in self._kinds]
        self._intensity = np.array(tables, dtype=np.float32)
        self._boxes = Boxes(surface.point, surface.normal)
        counts = np.array([len(own) for own in self._boxes.parts])
        order, everyone = np.concatenate(self._boxes.parts), np.arange(len(lights))[None]
        sent = [
            self._sent(surface.point[own], surface.normal[own], everyone)
            for own in np.array_split(order, max(order.size // POINTS**2, 1))
        ]
        sums = np.add.reduceat(np.concatenate(sent), np.cumsum(counts) - counts, axis=0)
        self._mean = sums / counts[:, None].astype(np.float32)
        squared = np.broadcast_to(self._size + np.float32(TINY), self._mean.shape).copy()
        for (start, end), least, greatest in zip(self._boxes.corners.T, low.T, high.T, strict=True):
            gap = np.maximum(least - end[:, None], start[:, None] - greatest)
            squared += np.maximum(gap, 0.0) ** 2
        self._most = self._intensity.max(axis=1)[self._kind_of] * self._brightness / squared
        self._arriving = np.ones_like(self._mean)

    def _settle(self) -> None:
        """Make tables of what is known of the boxes."""
        # How many to work off at once, where lights are asked one by one:
        self.batches = 4 if len(np.unique(self._kind_of)) > MANY_KINDS else 1
        self.hue = (self.rgb / self._brightness[:, None]).astype(np.float32)  # over luminance
        doubt = np.sqrt(self._arriving * (1.0 - self._arriving) + np.float32(DOUBT))
        count = min(NEAR, len(self.rgb) // 2)
        near = np.argpartition(-self._most * doubt, count, axis=1)[:, :count]
        self._near = np.sort(near, axis=1)
        self._near_doubt, near_arriving = (
            np.take_along_axis(each, self._near, axis=1) for each in (doubt, self._arriving)
        )
        self._near_rgb = near_arriving[..., None] * self.hue.take(self._near, axis=0)
        wary = np.minimum(self._most, self._mean / np.float32(STEP))
        self._rest = (self._mean + np.float32(WARY) * wary) * doubt
        foreseen = self._mean * self._arriving
        for each in (self._rest, foreseen):
            np.put_along_axis(each, self._near, 0.0, axis=1)
        self._rest_rgb = foreseen @ self.hue
        upto: Floats = np.cumsum(self._rest, axis=1, dtype=float)
        self._others = upto[:, -1].copy()
        self._table = (upto / upto[:, -1:] + np.arange(len(upto))[:, None]).ravel()

    def part(self, lights: Ints, layer: int) -> Crowd:
        """Return some of its `lights` (k,), in a layer."""
        one = copy.copy(self)
        one.emitter = replace(self.emitter, layer=layer)
        for name in BY_LIGHT.split():
            setattr(one, name, getattr(self, name)[lights])
        for name in ("_mean", "_most", "_arriving"):
            setattr(one, name, getattr(self, name).take(lights, axis=1))
        one._settle()
        return one

    def learn(self, light: DirectLight, surface: Surface) -> Floats:
        """Try lights at the points; return the mean (lights,) of what arrives there of each."""
        weights, where = np.array(light.scene.luminance_weights), (surface.point, surface.normal)
        box, boxes = self._boxes.of(*where), np.arange(len(self._mean))
        index, count = np.arange(len(box)), min(TRIES, len(self.rgb))
        uniform = Points(0 * index, 0 * index, index, 1).pair
        found, tried = (np.zeros(self._mean.shape) for _ in range(2))
        for lights in np.argpartition(-self._mean, count - 1, axis=1)[:, :count].T:
            chosen = lights.take(box)[None]
            ((sample, rgb),) = self._sampled(*where, uniform, chosen, np.ones(chosen.shape))
            cosine = dot(surface.normal, sample.wi)
            value = np.maximum(cosine, 0.0) * np.abs(sample.weight) * (np.abs(rgb) @ weights)
            lit = np.flatnonzero(value)
            if len(lit):
                value[lit] *= light.seen(self.emitter, surface, sample, cosine, lit, passed=0)[0]
            found[boxes, lights] = np.bincount(box, value, len(boxes))
            tried[boxes, lights] = np.bincount(box, self._sent(*where, chosen.T)[:, 0], len(boxes))
        share = np.broadcast_to(found.sum(axis=1) / tried.sum(axis=1), found.T.shape).T.copy()
        np.divide(found, tried, out=share, where=tried > 0.0)
        self._arriving = np.minimum(share, 1.0).astype(np.float32)
        return np.bincount(box) @ (self._arriving * self._mean) / len(box)

    def _expected(
        self, points: Floats, normals: Floats
    ) -> tuple[Ints, Ints, Singles, Singles, Floats]:
        """Return boxes (n,), lights near (n, k), S and q (n, k) of these, and the sum of q (n,)."""
        box = self._boxes.of(points, normals)
        near = self._near.take(box, axis=0)
        sent = self._sent(points, normals, near)
        often = sent * self._near_doubt.take(box, axis=0)
        return box, near, sent, often, often.sum(axis=1) + self._others.take(box)

    def pick(
        self, points: Floats, normals: Floats, u: Floats
    ) -> tuple[Ints, Floats, Floats, Floats]:
        """Return lights (picks, n), their chances, what is foreseen of them over these, and of all.

        Of all it is (n, 3), and the mean of the others', times `hue`. The picks are of `u` (n,).
        """
        box, near, sent, often, total = self._expected(points, normals)
        rows, count = np.arange(len(box)), near.shape[1]
        upto = np.cumsum(often, axis=1, dtype=float)
        at = (np.arange(PICKS)[:, None] + u) / PICKS * total
        column = np.zeros(at.shape, dtype=np.int8)
        for each in upto.T:
            column += each <= at
        left = np.clip((at - upto[:, -1]) / self._others.take(box), 0.0, 1.0 - 1e-9)
        entry = np.searchsorted(self._table, box + left, side="right")
        is_near, column = column < count, np.minimum(column, count - 1)
        entry = np.where(is_near, box * len(self.rgb) + near[rows, column], entry)
        chance = np.where(is_near, often[rows, column], self._rest.take(entry)) / total
        foreseen = np.where(is_near, sent[rows, column], self._mean.take(entry))
        whole = np.einsum("nk,nkc->nc", sent, self._near_rgb.take(box, axis=0))
        whole += self._rest_rgb.take(box, axis=0)
        share = self._arriving.take(entry) / chance
        return entry - box * len(self.rgb), chance, foreseen * share, whole

    def _sent(self, points: Floats, normals: Floats, lights: Ints) -> Singles:
        """Return S (n, k) of `lights` (n, k), or the same (1, k), at n points."""
        place, normal = points.astype(np.float32), normals.astype(np.float32)
        x, y, z = (self._centre[:, k].take(lights) - place[:, k, None] for k in range(3))
        squared = np.maximum(x * x + y * y + z * z, np.float32(TINY))
        height = x * normal[:, 0, None] + y * normal[:, 1, None] + z * normal[:, 2, None]
        size = self._size.take(lights)
        cosine = np.maximum(height, 0.5 * np.sqrt(size)) / np.sqrt(squared + size)
        table = self._kind_of.take(lights) * SIDE**2 + _bin(-x, -y, -z)
        intensity = self._intensity.take(table) * self._brightness.take(lights)
        return intensity * np.maximum(cosine, np.float32(GRAZING)) / (squared + size)

    @cached_property
    def _around(self) -> Caster:
        return _boxes_around(self._bounds[self._is_found])

    def looks(
        self, points: Floats, normals: Floats, wi: Floats
    ) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Yield `Light.look` along `wi` for each light that a ray may meet, with its `rgb`."""
        rows, origins = np.arange(len(points)), points.copy(order="K")
        while len(rows):
            hits = self._around.intersect(origins[rows], wi[rows])
            met = np.flatnonzero(hits.triangle >= 0)
            rows, hits = rows[met], hits.take(met)
            step = hits.distance + STEP * (np.abs(origins[rows]).max(axis=1) + hits.distance)
            origins[rows] += wi[rows] * step[:, None]
            axis, side = np.divmod(hits.triangle % 12 // 2, 2)
            leaves = (wi[rows, axis] > 0.0) == (side == 1)
            if leaves.any():
                lights = np.flatnonzero(self._is_found)[hits.triangle[leaves] // 12]
                yield self._looked(points, normals, wi, rows[leaves], lights)

    def _looked(
        self, points: Floats, normals: Floats, wi: Floats, rows: Ints, lights: Ints
    ) -> tuple[Floats, Floats, Floats]:
        """Return `Light.look` of n points, of which `rows` (k,) look at `lights` (k,)."""
        distance, radiance = np.full(len(points), np.inf), np.zeros((len(points), 3))
        pdf = np.zeros(len(points))
        kind = self._kind_of.take(lights)
        for number in np.unique(kind):
            own, chosen = rows[kind == number], lights[kind == number]
            one, place = self._kinds[number]
            at = {place: self._places.take(chosen, axis=0)} if place else {}
            found = replace(one, **at).look(points[own], normals[own], wi[own])
            distance[own], shown, density = found
            radiance[own] = shown.reshape(len(own), -1) * self.rgb.take(chosen, axis=0)
            box, near, _, often, total = self._expected(points[own], normals[own])
            often = np.where(near == chosen[:, None], often, 0.0).sum(axis=1)
            pdf[own] = PICKS * density * (often + self._rest[box, chosen]) / total
        return distance, radiance, pdf

    def sample(
        self, points: Floats, normals: Floats, uniform: Callable[[int], Floats]
    ) -> tuple[list[tuple[LightSample, Floats]], Floats, Floats]:
        """Return `PICKS` times a sample of a light at each point, with its `rgb` (n, 3).

        Weights are over chance and number, so that the results add up. What was foreseen of these,
        so weighed, and of all lights, (n, 3) each, follows.
        """
        chosen, chance, foreseen, whole = self.pick(points, normals, uniform(self._dimension)[:, 0])
        samples = self._sampled(points, normals, uniform, chosen, chance)
        own = (foreseen[..., None] * self.hue.take(chosen, axis=0)).mean(axis=0)
        return samples, own, whole

    @property
    def _dimension(self) -> int:
        return FIRST_DIMENSION + self.emitter.layer * (PICKS + 1)

    def _sampled(
        self,
        points: Floats,
        normals: Floats,
        uniform: Callable[[int], Floats],
        chosen: Ints,
        chance: Floats,
    ) -> list[tuple[LightSample, Floats]]:
        """Return samples of lights (picks, n), with their `rgb`, over their chances."""
        picks, n = chosen.shape
        lights = chosen.ravel()
        u = np.concatenate([uniform(self._dimension + 1 + k) for k in range(picks)])
        wi, rgb = np.empty((lights.size, 3), order="F"), self.rgb.take(lights, axis=0)
        distance, weight, pdf = np.empty((3, lights.size))
        kind = self._kind_of.take(lights)
        ends = np.cumsum(np.bincount(kind, minlength=len(self._kinds)))
        same = np.split(np.argsort(kind, kind="stable"), ends[:-1])
        for (one, place), rows in zip(self._kinds, same, strict=True):
            if not len(rows):
                continue
            at = {place: self._places.take(lights[rows], axis=0)} if place else {}
            where = points.take(rows % n, axis=0), normals.take(rows % n, axis=0)
            found = replace(one, **at).sample(*where, u.take(rows, axis=0))
            wi[rows], distance[rows], weight[rows] = found.wi, found.distance, found.weight
            pdf[rows] = found.pdf if one.is_found else np.inf
            if found.tint is not None:
                rgb[rows] *= found.tint
        often = picks * chance.ravel()
        whole = LightSample(wi, distance, weight / often, pdf * often)
        parts = [slice(k * n, k * n + n) for k in range(picks)]
        return [(LightSample(*(x[part] for x in whole[:4])), rgb[part]) for part in parts]


def _boxes_around(bounds: Floats) -> Caster:
    """Return what casts rays against boxes, twelve triangles each, of given corners (n, 2, 3)."""
    low, high = bounds.swapaxes(0, 1)
    wide = LOOSE * (1.0 + 0.618 * np.arange(len(low)) % 1.0)  # no two of them end alike
    wide = wide * np.linalg.norm(high - low, axis=1)
    low, high = low - wide[:, None], high + wide[:, None]
    bits = np.indices((2, 2, 2)).reshape(3, 8).T
    sides = [np.flatnonzero(bits[:, axis] == side) for axis in range(3) for side in range(2)]
    faces = np.array([side[corners] for side in sides for corners in ([0, 1, 2], [1, 2, 3])])
    corners = np.where(bits[None] == 1, high[:, None], low[:, None]).reshape(-1, 3)
    triangles = (8 * np.arange(len(low))[:, None, None] + faces).reshape(-1, 3).astype(np.int32)
    none = np.zeros(len(triangles), dtype=np.int32)
    mesh = Mesh("boxes", corners.astype(np.float32), triangles, None, none.astype(bool), none)
    there = [0] if len(low) else []
    return Caster([mesh], [Instance("boxes", 0, np.eye(4), (0,))], there)


def _bounds(light: Light) -> tuple[Floats, Floats]:
    """Return the corners (3,) of what shines."""
    plain = _plain(light)
    if isinstance(plain, MeshLight):
        return plain.triangles.min(axis=(0, 1)), plain.triangles.max(axis=(0, 1))
    if isinstance(plain, AreaLight):
        half = 0.5 * (np.abs(plain.axis_u) + np.abs(plain.axis_v))
        return plain.center - half, plain.center + half
    point = cast("PointLight", plain)
    return point.position - point.radius, point.position + point.radius


def _plain(light: Light) -> Light:
    return light.plain if isinstance(light, TexturedLight) else light


def _alike(lights: Sequence[Light]) -> tuple[Ints, list[tuple[Light, str]], Floats]:
    """Return the kind (n,) of each light, one of each kind, and where the lights stand (n, 3).

    Lights of a kind differ in place and colour alone; where there are none of its like, a light
    keeps its place, and the name of the field for it is empty.
    """
    kinds: dict[Any, list[int]] = {}
    places = np.zeros((len(lights), 3))
    field = [next((f for f in PLACE if hasattr(light, f)), "") for light in lights]
    for index, (light, place) in enumerate(zip(lights, field, strict=True)):
        key: tuple[Any, ...] = (index,)
        if place and light.distribution is None:
            places[index] = getattr(light, place)
            kept = (f.name for f in fields(light) if f.name not in {place, "name", "rgb", "notes"})
            key = (type(light), *(np.asarray(getattr(light, name)).tobytes() for name in kept))
        kinds.setdefault(key, []).append(index)
    of = np.empty(len(lights), dtype=np.int64)
    for number, members in enumerate(kinds.values()):
        of[members] = number
    chosen = [(lights[m[0]], field[m[0]] if len(m) > 1 else "") for m in kinds.values()]
    return of, chosen, places


def _bin(x: Singles, y: Singles, z: Singles) -> Ints:
    """Return the bin of directions, which need no unit length, on an octahedron unfolded."""
    length = np.maximum(np.abs(x) + np.abs(y) + np.abs(z), np.float32(TINY))
    u, v, below = x / length, y / length, z < 0.0
    s, t = np.copysign(1.0 - np.abs(v), u), np.copysign(1.0 - np.abs(u), v)
    place = [np.where(below, a, b) for a, b in ((s, u), (t, v))]
    i, j = (np.minimum(((p + 1.0) * (SIDE / 2)).astype(np.int64), SIDE - 1) for p in place)
    return i * SIDE + j


def _intensities(light: Light, weights: Floats) -> Floats:
    """Return luminous intensities (SIDE²,) of the bins, root mean squares, over that of `rgb`."""
    fine = 2 * SIDE
    u, v = (np.indices((fine, fine)).reshape(2, -1) + 0.5) * (2.0 / fine) - 1.0
    z = 1.0 - np.abs(u) - np.abs(v)
    x = np.where(z < 0.0, np.copysign(1.0 - np.abs(v), u), u)
    y = np.where(z < 0.0, np.copysign(1.0 - np.abs(u), v), v)
    directions = normalized(np.stack([x, y, z], axis=1))
    low, high = _bounds(light)
    away = FAR * (float(np.linalg.norm(high - low)) + 1e-3)
    index = np.arange(len(directions))
    uniform = Points(0 * index, 0 * index, index, 1).pair(0)
    sample = light.sample((low + high) / 2 + away * directions, -directions, uniform)
    tint = 1.0 if sample.tint is None else np.abs(sample.tint).mean(axis=1)
    found = np.abs(sample.weight) * tint * away**2
    peak = np.abs(light.peak_radiant_intensity()) @ weights / (np.abs(light.rgb) @ weights)
    found = np.sqrt((found.reshape(SIDE, 2, SIDE, 2) ** 2).mean(axis=(1, 3))).ravel()
    return found + FLAT * max(found.max(), peak)


def gathered(light: DirectLight, scene: Scene, camera: Camera, *, per_light: bool) -> DirectLight:
    """Return `light` with its many lights gathered in crowds; as it is where they are few.

    With `per_light`, names with at least `MATTERS` of the light keep a layer, and the other lights
    share the layer `REST`.
    """
    many = [e for e in light.emitters if _can_join(e) and e.light.name not in scene.linking]
    if len(many) <= FEW:
        return light
    middles = np.array([np.mean(_bounds(e.light), axis=0) for e in many])
    many = [many[k] for k in np.concatenate(Boxes(middles, 0.0 * middles).parts)]
    width, height = scene.resolution
    wanted = SEEN // 8 + min(PAIRS // len(many), width * height // PIXELS)
    surface = _seen_points(light, scene, camera, min(wanted, SEEN))
    if surface is None:
        return light
    everyone = Crowd([e.light for e in many], surface, np.array(scene.luminance_weights))
    energy = everyone.learn(light, surface)
    one = copy.copy(light)
    one.names, layer_of = ["all"], dict.fromkeys(range(len(light.names)), 0)
    if per_light:
        one.names, layer_of = _layers(light, many, energy)
    layers = np.array([layer_of[emitter.layer] for emitter in many])
    crowded = [k for k, count in enumerate(np.bincount(layers)) if count > FEW]
    inside = {id(many[index]) for index in np.flatnonzero(np.isin(layers, crowded))}
    one.emitters = [
        e if e.layer < 0 else replace(e, layer=layer_of[e.layer])
        for e in light.emitters
        if id(e) not in inside
    ]
    one.crowds = [everyone.part(np.flatnonzero(layers == layer), layer) for layer in crowded]
    return one


def _can_join(emitter: Emitter) -> bool:
    """Return whether it may be one of many; what has no place, and parallel beams, may not."""
    light = emitter.light
    known = emitter.cause is None and light.cast_shadow and light.reaches == RAYS
    plain = _plain(light)
    known &= isinstance(plain, MeshLight | AreaLight) or hasattr(plain, "position")
    return known and bool(np.isfinite(light.peak_radiant_intensity()).all() and light.rgb.any())


def _layers(
    light: DirectLight, many: list[Emitter], energy: Floats
) -> tuple[list[str], dict[int, int]]:
    """Return names of layers, and the layer that each of the old ones goes to."""
    own = np.bincount([e.layer for e in many], energy, len(light.names))
    small = (own < MATTERS * own.sum()) & np.isin(np.arange(len(own)), [e.layer for e in many])
    if np.count_nonzero(small) <= FEW:
        small[:] = False
    kept = np.flatnonzero(~small)
    names = [light.names[k] for k in kept] + [REST] * bool(small.any())
    place = dict.fromkeys(range(len(own)), len(kept)) | {int(k): n for n, k in enumerate(kept)}
    return names, place


def _seen_points(light: DirectLight, scene: Scene, camera: Camera, wanted: int) -> Surface | None:
    """Return up to `wanted` points that the camera sees; None where it sees next to nothing."""
    index = np.arange(2 * wanted)
    uniform = Points(np.zeros_like(index), np.zeros_like(index), index, 0).pair(0)
    width, height = scene.resolution
    x0, y0, x1, y1 = scene.border or (0, 0, width, height)
    where = np.array([x0, y0]) + uniform * np.array([x1 - x0, y1 - y0])
    rays = camera_rays(camera, scene.resolution, where)
    met, hits = rays.met(light.visibility.camera)
    if len(met) < FEW * POINTS:
        return None
    hits = hits.take(np.arange(min(wanted, len(met))))
    return light.geometry.surface(hits, rays.directions.take(met[:wanted], axis=0))
