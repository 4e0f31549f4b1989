# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights as one: at each point a few are chosen, by what they send there.

What the camera sees is cut into `LEAVES` boxes by the medians of a few points. Every light is
sampled at the points of each, with its shadow: that gives its mean E̅ and the share p of it that
arrives. A table holds its intensity I by direction, far away. At a point of the box, where a light
of size s and distance d lies in the direction ω, it is chosen with a chance

    q ∝ p I(ω) cosθ/(d² + s²) + F E̅

among the `NEAR` lights that are strongest in the box and `OTHERS`, which a table of the box gives
with chances that are about in proportion to p E̅; these stand for all the others.

`PICKS` strata of that distribution give a light each; the mean of f V / q is free of bias whatever
the tables say, since every light keeps a chance.

Where closures are sampled too, the chance that weighs both is q over the box's mean of the sum that
it is a share of: any function of point and light will do there, as long as both take the same. What
a ray meets is found through boxes around the lights, each of which it leaves once.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .bsdfs._base import picked
from .cameras import camera_rays
from .emitters import Emitter
from .film import REST
from .lights import RAYS, Light, LightSample
from .lights._textured import TexturedLight
from .lights.area import AreaLight
from .lights.mesh import MeshLight
from .lights.point import PointLight
from .rays import Caster
from .sampling import Points
from .scene import Camera, Instance, Mesh, Scene
from .surfaces import Surface, dot, normalized, pick

if TYPE_CHECKING:
    from .direct import DirectLight

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]

FEW = 16  # lights that are sampled one by one
MATTERS = 0.007  # share of the light with which a name keeps its layer; at 0.01 it is judged
LEVELS, POINTS = 7, 4  # 2^levels boxes; points in each
LEAVES = 1 << LEVELS
NEAR, OTHERS = 24, 16
PLACES = 4  # a light, in tables
PICKS = 4
MANY_KINDS = 64
CHUNK = 4096  # points at a time, so that what is known of their lights stays near the processor
FLAT = 0.1  # F, and the least p
GRAZING = 0.05  # least cosθ
SIDE = 16  # directions in a table, squared
FAR = 1e3  # of a light's size: from there its intensity is seen
PLACE = ("position", "center")  # fields for where a light stands
LOOSE = 1e-3  # of a light's size: how much wider its box is
STEP = 1e-6  # of coordinates: where a ray goes on behind a box
FIRST_DIMENSION = 1 << 12  # of random numbers, beyond those of single lights


class Boxes:
    """A balanced tree of boxes over points (LEAVES · k, 3)."""

    def __init__(self, points: Floats) -> None:
        self._axis = np.zeros(LEAVES, dtype=np.int64)
        self._split = np.zeros(LEAVES)
        members = {1: np.arange(len(points))}
        for node in range(1, LEAVES):
            own = members.pop(node)
            axis = int(np.argmax(np.ptp(points[own], axis=0)))
            own = own[np.argsort(points[own, axis], kind="stable")]
            half = len(own) // 2
            self._axis[node], self._split[node] = (
                axis,
                points[own[half - 1 : half + 1], axis].mean(),
            )
            members[2 * node], members[2 * node + 1] = own[:half], own[half:]
        self.members = np.stack([members[LEAVES + k] for k in range(LEAVES)])

    def of(self, points: Floats) -> Ints:
        """Return the box (n,) of points (n, 3)."""
        node = np.ones(len(points), dtype=np.int64)
        rows = np.arange(len(points))
        for _ in range(LEVELS):
            beyond = points[rows, self._axis.take(node)] > self._split.take(node)
            node = 2 * node + beyond
        return node - LEAVES


class Crowd:
    """Lights that share a layer; see above.

    Parameters
    ----------
    boxes : with points of theirs, and
    unoccluded, arriving : (lights, points) luminances there, without and with what hides them.
    centre, size, intensity : (lights, 3) [bu], (lights,) [bu²], and (lights, SIDE²) by direction.

    Attributes
    ----------
    emitter : a stand-in, whose `rgb` is 1.
    batches : how many to work off at once, where lights are asked one by one.
    """

    def __init__(
        self,
        emitters: Sequence[Emitter],
        layer: int,
        boxes: Boxes,
        known: Sequence[Floats],
    ) -> None:
        unoccluded, arriving, even, *looks = known
        self._centre, self._size, self._intensity = (x.astype(np.float32) for x in looks)
        self._intensity /= np.float32(unoccluded.mean() or 1.0)
        lights = [emitter.light for emitter in emitters]
        self._rgb = np.array([light.rgb for light in lights])
        self._caster, self._boxed = _boxes_around(lights)
        self._kind_of, self._kinds, self._places = _alike(lights)
        self.batches = 4 if len(self._kinds) > MANY_KINDS else 1
        self.emitter = Emitter(replace(lights[0], rgb=np.ones(3)), layer)
        self._boxes = boxes
        count = min(NEAR, len(lights) // 2)
        scale = unoccluded.mean() or 1.0
        sent, seen, flat = (
            x[:, boxes.members].mean(axis=2).T / scale for x in (unoccluded, arriving, even)
        )
        passing = np.divide(seen, sent, out=np.ones_like(sent), where=sent > 0.0)
        passing = np.maximum(passing, FLAT)
        mean = passing * sent
        flat = FLAT * (flat + mean + FLAT * sent.mean(axis=0)) + 1e-6
        self._near = np.argsort(-mean, axis=1, kind="stable")[:, :count]
        self._times = _shared_out(mean + flat, self._near)
        self._total = (mean + flat).sum(axis=1)
        self._passing, self._flat = passing.astype(np.float32), flat.astype(np.float32)
        self._table = np.repeat(
            np.tile(np.arange(len(lights)), LEAVES), self._times.ravel()
        ).reshape(LEAVES, -1)

    def pick(self, points: Floats, normals: Floats, u: Floats) -> tuple[Ints, Floats, Floats]:
        """Return lights (PICKS, n), the chances (PICKS, n) they had, and about had, from `u`."""
        box = self._boxes.of(points)[:, None]
        near, others = self._near[box[:, 0]], min(OTHERS, self._table.shape[1])
        entry = ((np.arange(others) + u[:, 1:]) * (self._table.shape[1] / others)).astype(np.int64)
        far = self._table[box, entry]
        lights = np.concatenate([near, far], axis=1)
        sent = self._passing[box, lights] * self._sent(
            points.astype(np.float32), normals.astype(np.float32), lights
        )
        sent += self._flat[box, lights]
        weight = sent.copy()
        weight[:, near.shape[1] :] *= (self._table.shape[1] / others) / self._times[box, far]
        upto = np.cumsum(weight, axis=1)
        rows, total = np.arange(len(points)), upto[:, -1]
        chosen = np.empty((PICKS, len(points)), dtype=np.int64)
        chance, about = np.empty((2, PICKS, len(points)))
        for k in range(PICKS):
            column = (upto <= ((k + u[:, 0]) / PICKS * total)[:, None]).sum(axis=1)
            column = np.minimum(column, lights.shape[1] - 1)
            chosen[k], chance[k] = lights[rows, column], sent[rows, column] / total
            about[k] = sent[rows, column] / self._total[box[:, 0]]
        return chosen, chance, about

    def looks(
        self, points: Floats, normals: Floats, wi: Floats
    ) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Yield `Light.look` along `wi` for each light that a ray may meet, with its `rgb`."""
        rows, origins = np.arange(len(points)), points.copy(order="K")
        while len(rows):
            hits = self._caster.intersect(origins[rows], wi[rows])
            met = np.flatnonzero(hits.triangle >= 0)
            rows, hits = rows[met], hits.take(met)
            step = hits.distance + STEP * (np.abs(origins[rows]).max(axis=1) + hits.distance)
            origins[rows] += wi[rows] * step[:, None]
            axis, side = np.divmod(hits.triangle % 12 // 2, 2)
            leaves = (wi[rows, axis] > 0.0) == (side == 1)
            if leaves.any():
                lights = self._boxed[hits.triangle[leaves] // 12]
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
            radiance[own] = shown.reshape(len(own), -1) * self._rgb.take(chosen, axis=0)
            box = self._boxes.of(points[own])
            singles = points[own].astype(np.float32), normals[own].astype(np.float32)
            sent = self._sent(*singles, chosen[:, None])[:, 0]
            sent = self._passing[box, chosen] * sent + self._flat[box, chosen]
            pdf[own] = PICKS * density * sent / self._total[box]
        return distance, radiance, pdf

    def _sent(self, points: Singles, normals: Singles, lights: Ints) -> Singles:
        """Return about what `lights` (n, k) send to n points."""
        x, y, z = (self._centre[:, k].take(lights) - points[:, k, None] for k in range(3))
        squared = np.maximum(x * x + y * y + z * z, 1e-30)
        height = sum(d * normals[:, k, None] for k, d in enumerate((x, y, z)))
        cosine = np.maximum(height / np.sqrt(squared), GRAZING)
        intensity = self._intensity.ravel().take(lights * SIDE**2 + _bin(-x, -y, -z))
        return intensity * cosine / (squared + self._size.take(lights))

    def sample(
        self, points: Floats, normals: Floats, uniform: Callable[[int], Floats]
    ) -> list[tuple[LightSample, Floats]]:
        """Return `PICKS` times a sample of a light at each point, with its `rgb` (n, 3).

        Weights are over chance and number, so that the results add up.
        """
        first = FIRST_DIMENSION + self.emitter.layer * (PICKS + 1)
        u, n = uniform(first), len(points)
        parts = [slice(start, start + CHUNK) for start in range(0, n, CHUNK)]
        picks = [self.pick(points[part], normals[part], u[part]) for part in parts]
        chosen, chance, about = (
            np.concatenate(each, axis=1).ravel() for each in zip(*picks, strict=True)
        )
        kind = self._kind_of.take(chosen)
        order = np.argsort(kind, kind="stable")
        ends = np.cumsum(np.bincount(kind, minlength=len(self._kinds)))
        point, light = order % n, chosen.take(order)
        points, normals = points.take(point, axis=0), normals.take(point, axis=0)
        u = np.concatenate([uniform(first + 1 + k) for k in range(PICKS)]).take(order, axis=0)
        wi, rgb = np.zeros((len(order), 3)), self._rgb.take(light, axis=0)
        distance, weight, pdf = np.ones(len(order)), np.zeros(len(order)), np.ones(len(order))
        start = 0
        for (one, place), end in zip(self._kinds, ends.tolist(), strict=True):
            rows, start = slice(start, end), end
            if rows.start == end:
                continue
            at = {place: self._places.take(light[rows], axis=0)} if place else {}
            found = replace(one, **at).sample(points[rows], normals[rows], u[rows])
            wi[rows], distance[rows], weight[rows] = found.wi, found.distance, found.weight
            pdf[rows] = found.pdf if one.is_found else np.inf
            if found.tint is not None:
                rgb[rows] *= found.tint
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        weight /= PICKS * chance.take(order)
        pdf *= PICKS * about.take(order)
        found = []
        for k in range(PICKS):
            rows = back[k * n : (k + 1) * n]
            parts = distance.take(rows), weight.take(rows), pdf.take(rows)
            sample = LightSample(pick(wi, rows), *parts)
            found.append((sample, rgb.take(rows, axis=0)))
        return found


def _boxes_around(lights: Sequence[Light]) -> tuple[Caster, Ints]:
    """Return what casts rays against boxes, twelve triangles each, and whose they are."""
    bounds = [_bounds(light) for light in lights]
    boxed = np.array([k for k, each in enumerate(bounds) if each is not None], dtype=np.int64)
    low, high = (
        np.array([each for each in bounds if each is not None]).reshape(-1, 2, 3).swapaxes(0, 1)
    )
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
    return Caster([mesh], [Instance("boxes", 0, np.eye(4), (0,))], there), boxed


def _bounds(light: Light) -> tuple[Floats, Floats] | None:
    """Return the corners (3,) of what `Light.look` may find of it, None where that is nothing."""
    plain = light.plain if isinstance(light, TexturedLight) else light
    if not light.is_found:
        return None
    if isinstance(plain, PointLight):
        return plain.position - plain.radius, plain.position + plain.radius
    if isinstance(plain, AreaLight):
        half = 0.5 * (np.abs(plain.axis_u) + np.abs(plain.axis_v))
        return plain.center - half, plain.center + half
    if isinstance(plain, MeshLight):
        return plain.triangles.min(axis=(0, 1)), plain.triangles.max(axis=(0, 1))
    return None


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


def _shared_out(weight: Floats, near: Ints) -> Ints:
    """Return how often each light (boxes, lights) has a place in the table of the others.

    There are `PLACES` for each light: one is its own, unless it is near, the rest go by weight.
    """
    weight = weight.copy()
    np.put_along_axis(weight, near, 0.0, axis=1)
    others = weight > 0.0
    places = PLACES * weight.shape[1]
    if not others.any():
        return np.zeros(weight.shape, dtype=np.int64)
    free = places - others.sum(axis=1, keepdims=True)
    upto = np.floor(np.cumsum(weight, axis=1) / weight.sum(axis=1, keepdims=True) * free + 0.5)
    return others + np.diff(upto, prepend=0.0).astype(np.int64)


def _bin(x: Singles, y: Singles, z: Singles) -> Ints:
    """Return the bin of directions, which need no unit length, on an octahedron unfolded."""
    length = np.maximum(np.abs(x) + np.abs(y) + np.abs(z), 1e-300)
    u, v, below = x / length, y / length, z < 0.0
    s, t = np.copysign(1.0 - np.abs(v), u), np.copysign(1.0 - np.abs(u), v)
    place = [np.where(below, a, b) for a, b in ((s, u), (t, v))]
    i, j = (np.minimum(((p + 1.0) * (SIDE / 2)).astype(np.int64), SIDE - 1) for p in place)
    return i * SIDE + j


def _directions() -> Floats:
    """Return the unit vectors (SIDE², 3) in the middles of the bins."""
    u, v = (np.indices((SIDE, SIDE)).reshape(2, -1) + 0.5) * (2.0 / SIDE) - 1.0
    z = 1.0 - np.abs(u) - np.abs(v)
    x = np.where(z < 0.0, np.copysign(1.0 - np.abs(v), u), u)
    y = np.where(z < 0.0, np.copysign(1.0 - np.abs(u), v), v)
    return normalized(np.stack([x, y, z], axis=1))


def gathered(light: DirectLight, scene: Scene, camera: Camera, *, per_light: bool) -> DirectLight:
    """Return `light` with its many lights gathered in crowds; as it is where they are few.

    With `per_light`, names with at least `MATTERS` of the light keep a layer, and the other lights
    share the layer `REST`.
    """
    many = [e for e in light.emitters if _can_join(e) and e.light.name not in scene.linking]
    if len(many) <= FEW:
        return light
    surface = _seen_points(light, scene, camera)
    if surface is None:
        return light
    boxes = Boxes(surface.point)
    known = _tried(light, many, surface, np.array(scene.luminance_weights))
    joined: dict[int, list[int]] = {}
    layer_of = dict.fromkeys(range(len(light.names)), 0)
    names = ["all"]
    if per_light:
        names, layer_of = _layers(light, many, known[1].mean(axis=1))
    for index, emitter in enumerate(many):
        joined.setdefault(layer_of[emitter.layer], []).append(index)
    crowds = {layer: rows for layer, rows in joined.items() if len(rows) > FEW}
    inside = {id(many[index]) for rows in crowds.values() for index in rows}
    one = copy.copy(light)
    one.names = names
    one.emitters = [
        e if e.layer < 0 else replace(e, layer=layer_of[e.layer])
        for e in light.emitters
        if id(e) not in inside
    ]
    one.crowds = [
        Crowd([many[k] for k in rows], layer, boxes, [x[rows] for x in known])
        for layer, rows in crowds.items()
    ]
    return one


def _can_join(emitter: Emitter) -> bool:
    """Return whether it may be one of many; parallel beams, suns and the world may not."""
    light = emitter.light
    known = emitter.cause is None and light.cast_shadow and light.reaches == RAYS
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


def _seen_points(light: DirectLight, scene: Scene, camera: Camera) -> Surface | None:
    """Return LEAVES · POINTS points that the camera sees; None where it sees too little."""
    wanted = LEAVES * POINTS
    index = np.arange(16 * wanted)
    uniform = Points(np.zeros_like(index), np.zeros_like(index), index, 0).pair(0)
    width, height = scene.resolution
    x0, y0, x1, y1 = scene.border or (0, 0, width, height)
    where = np.array([x0, y0]) + uniform * np.array([x1 - x0, y1 - y0])
    rays = camera_rays(camera, scene.resolution, where)
    hits = light.visibility.camera.intersect(rays.origins, rays.directions)
    met = np.flatnonzero((hits.instance >= 0) & (hits.distance <= rays.reach))[:wanted]
    if len(met) < wanted:
        return None
    return light.geometry.surface(hits.take(met), rays.directions.take(met, axis=0))


def _tried(
    light: DirectLight, emitters: Sequence[Emitter], surface: Surface, weights: Floats
) -> list[Floats]:
    """Return what lights send to the points, what arrives, and how they look from far away."""
    points, directions = len(surface.point), _directions()
    zero = np.zeros(max(points, len(directions)), dtype=np.int64)
    u = Points(zero, zero, np.arange(len(zero)), 1).pair(0)
    lights = [emitter.light for emitter in emitters]
    luminance = np.abs([one.rgb for one in lights]) @ weights
    kind_of, kinds, places = _alike(lights)
    sent, arriving, even = np.zeros((3, len(lights), points))
    centre, size = np.zeros((len(lights), 3)), np.zeros(len(lights))
    intensity = np.zeros((len(lights), len(directions)))
    together = max(CHUNK // points, 1)
    for number, (one, place) in enumerate(kinds):
        kind = np.flatnonzero(kind_of == number)
        sampled = partial(_sampled, one, place, places, u)
        for own in (kind[k : k + together] for k in range(0, len(kind), together)):
            many = picked(surface, np.tile(np.arange(points), len(own)))
            sample = sampled(own, many.point, many.normal)
            cosine = dot(many.normal, sample.wi)
            value = np.maximum(cosine, 0.0) * _luminance(sample) * np.repeat(luminance[own], points)
            lit = np.flatnonzero(value)
            passing = np.zeros(len(value))
            if len(lit):
                passing[lit] = light.seen(emitters[own[0]], many, sample, cosine, lit, passed=0)[0]
            sent[own] = value.reshape(len(own), points)
            arriving[own] = (value * passing).reshape(len(own), points)
            reached = np.isfinite(sample.distance).reshape(len(own), points)
            far = np.where(reached.ravel(), sample.distance, 0.0)[:, None]
            met = (many.point + sample.wi * far).reshape(len(own), points, 3)
            share = reached / np.maximum(reached.sum(axis=1, keepdims=True), 1)
            centre[own] = np.einsum("np,npk->nk", share, met)
            spread = np.sum((met - centre[own][:, None]) ** 2, axis=2)
            size[own] = np.sum(share * spread, axis=1)
            away = FAR * (np.sqrt(size[own]) + 1e-3)[:, None]
            to = centre[own][:, None] + away[..., None] * directions
            sample = sampled(own, to.reshape(-1, 3), np.tile(-directions, (len(own), 1)))
            found = _luminance(sample).reshape(len(own), len(directions))
            intensity[own] = found * away**2 * luminance[own][:, None]
            peak = np.abs(one.peak_radiant_intensity()) @ weights
            peak = peak * luminance[own] / (np.abs(one.rgb) @ weights)
            most = np.maximum(intensity[own].max(axis=1), peak)
            intensity[own] += FLAT * most[:, None]
            towards = np.repeat(centre[own], points, axis=0) - many.point
            squared = np.maximum(dot(towards, towards), 1e-30)
            cosine = np.maximum(dot(towards, many.normal) / np.sqrt(squared), GRAZING)
            form = (cosine / (squared + np.repeat(size[own], points))).reshape(len(own), points)
            even[own] = FLAT * most[:, None] * form
    return [sent, arriving, even, centre, size, intensity]


def _sampled(  # noqa: PLR0917
    one: Light, place: str, places: Floats, u: Floats, own: Ints, points: Floats, normals: Floats
) -> LightSample:
    """Return samples of the lights `own` (m,), which are like `one`, at m times as many points."""
    each = len(points) // len(own)
    at = {place: np.repeat(places[own], each, axis=0)} if place else {}
    return replace(one, **at).sample(points, normals, np.tile(u[:each], (len(own), 1)))


def _luminance(sample: LightSample) -> Floats:
    """Return what arrives on a facing surface, over the luminance of the light's `rgb`."""
    tint = 1.0 if sample.tint is None else np.abs(sample.tint).mean(axis=1)
    return np.abs(sample.weight) * tint
