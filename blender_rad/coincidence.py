# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that lie on other faces (z-fighting): where the camera sees them.

Light that leaves such a point may or may not meet the other face, as rounding has it: Cycles hides
an arbitrary part of it, up to all. To find them without comparing triangles with each other, all
triangles are cut loose and each is moved off by a chance hair's breadth. Seen from close above and
from close below, a point that lies on two faces then shows two different ones.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from .arrays import Bools, Ints
from .cameras import camera_rays
from .direct import DirectLight
from .errors import Finding
from .film import Film, neighbourhood_mean
from .rays import Caster, Hits
from .scene import Camera, Mesh, Scene, Unsupported
from .surfaces import RAY_OFFSET, Geometry, Surface, cross, dot, normalized

FEATURE = "faces lie exactly on faces of "
# Of the coordinates, by which triangles are moved: far more than float32 rounds.
SCATTER = 2 * RAY_OFFSET
REACH = 64  # of a point's epsilon, from where it is looked at
# Of a point's epsilon: measured, Cycles confuses faces up to 0.05 to 0.15 of it.
BEHIND = 0.25
PARALLEL = 1.0 - 1e-6  # cosine of planes that stay together
RAYS, MORE_RAYS = 4, 64  # through a pixel
BATCH = 65536  # rays


def coincident_faces(light: DirectLight) -> dict[Unsupported, Bools]:
    """Return where in the picture (h, w) a face lies on another, by pair of objects.

    A few rays go through each pixel, and more through those beside what they found, so that narrow
    strips are followed to their ends.
    """
    scene, camera, rng = light.scene, light.scene.camera, np.random.default_rng(0)
    if camera is None:
        return {}
    loose = _cut_loose(scene, rng)
    shape = scene.resolution[::-1]
    masks: dict[Unsupported, Bools] = {}
    found, looked, everywhere = np.zeros(shape), np.zeros(shape, dtype=bool), np.ones(shape, bool)
    todo, rays = np.arange(found.size), RAYS
    while len(todo):
        for start in range(0, len(todo), BATCH // rays):
            pixel = np.repeat(todo[start : start + BATCH // rays], rays)
            for cause, shown in _coincident(light, camera, loose, pixel, rng):
                masks.setdefault(cause, np.zeros(shape, dtype=bool)).flat[shown] = True
                found.flat[shown] = 1.0
        beside = (neighbourhood_mean(found, everywhere) > 0.0) & (found == 0.0) & ~looked
        todo, rays = np.flatnonzero(beside), MORE_RAYS
        looked |= beside
    return masks


def left_out(film: Film, masks: Mapping[Unsupported, Bools]) -> Film:
    """Return `film` with those pixels, and those around them, excluded, and a finding for each."""
    for cause, mask in masks.items():
        wider = (neighbourhood_mean(mask.astype(float), film.inside) > 0.0) & film.inside
        if count := int(wider.sum()):
            said = (
                f"{cause.feature} in {count} pixels, which are left out: rounding alone decides "
                "whether Cycles lights them; delete one of the two, or move them apart"
            )
            finding = Finding("coincident-faces", "warning", cause.name, said)
            film = replace(
                film,
                excluded=film.excluded | wider,
                excluded_by={**film.excluded_by, cause: count},
                findings=(*film.findings, finding),
            )
    return film


def _coincident(
    light: DirectLight, camera: Camera, loose: Caster, pixel: Ints, rng: Generator
) -> Iterator[tuple[Unsupported, Ints]]:
    """Yield pairs of objects and which of the pixels (n,), a ray through each, show them."""
    scene = light.scene
    row, column = np.divmod(pixel, scene.resolution[0])
    corner = np.stack([column, scene.resolution[1] - 1 - row], axis=-1)
    rays = camera_rays(camera, scene.resolution, corner + rng.random(corner.shape))
    met, hits = rays.met(light.visibility.camera)
    surface = light.geometry.surface(hits, rays.directions.take(met, axis=0))
    for side in (-1.0, 1.0):
        rows, other = _others(hits, surface, light.geometry, loose, side)
        pairs = np.sort(np.stack([hits.instance[rows], other], axis=-1), axis=1)
        for pair in np.unique(pairs, axis=0):
            first, second = sorted(scene.instances[index].name for index in pair)
            found = pixel[met[rows[(pairs == pair).all(axis=1)]]]
            yield Unsupported("object", first, FEATURE + second), found


def _others(
    hits: Hits, surface: Surface, geometry: Geometry, loose: Caster, side: float
) -> tuple[Ints, Ints]:
    """Return which points (k,) show another face from that side, and the instances it is of.

    A face in front of the one that is seen, which the camera does not see, counts as far up as our
    shadow rays start; one behind it as far as it hides light in Cycles.
    """
    up = surface.geometric_normal * side
    reach = REACH * surface.epsilon
    near = loose.intersect(surface.point + up * reach[:, None], -up)
    own = (near.instance == hits.instance) & (near.triangle == hits.triangle)
    rows = np.flatnonzero((near.distance < 2.0 * reach) & ~own)
    found = geometry.surface(near.take(rows), -up.take(rows, axis=0))
    up = up.take(rows, axis=0)
    height = side * dot(found.point - surface.point.take(rows, axis=0), up)
    height /= surface.epsilon.take(rows)
    parallel = np.abs(dot(found.geometric_normal, up)) > PARALLEL
    coincident = (height > -BEHIND) & (height < 1.0) & parallel
    return rows[coincident], found.instance[coincident]


def _cut_loose(scene: Scene, rng: Generator) -> Caster:
    """Return a caster of all that is seen or throws shadows, every triangle by itself."""
    chosen: list[int] = []
    instances = list(scene.instances)
    amounts = [0.0] * len(scene.meshes)
    for index, instance in enumerate(instances):
        mesh, world = scene.meshes[instance.mesh], instance.world_from_object.copy()
        scale, far = np.linalg.norm(world[:3, :3]) / 3**0.5, np.linalg.norm(world[:3, 3])
        shown = instance.visible_camera or instance.visible_shadow
        if shown and scale > 0.0 and len(mesh.triangles) and not instance.proxy:
            amount = SCATTER * float(far / scale + np.abs(mesh.vertices).max())
            amounts[instance.mesh] = max(amount, amounts[instance.mesh])
            world[:3, 3] += amount * scale * normalized(rng.normal(size=(1, 3)))[0]
            instances[index] = replace(instance, world_from_object=world)
            chosen.append(index)
    meshes = [_loosened(m, a, rng) for m, a in zip(scene.meshes, amounts, strict=True)]
    return Caster(meshes, instances, chosen)


def _loosened(mesh: Mesh, amount: float, rng: Generator) -> Mesh:
    """Return `mesh`, each triangle moved off by at most `amount` [bu], and its edges inwards.

    Edges move by 2 to 3 times `amount`, so that triangles that touch stay apart: a third of a
    triangle's height is its inscribed radius r, or down to 2r/3.
    """
    corners = mesh.vertices.astype(np.float64)[mesh.triangles]
    middle = corners.mean(axis=1, keepdims=True)
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    perimeter = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).sum(axis=1)
    radius = np.maximum(np.sqrt(dot(normal, normal)), 1e-300) / np.maximum(perimeter, 1e-300)
    shrink = np.maximum(1.0 - 3.0 * amount / radius, 0.0)
    lift = normalized(normal) * (amount * rng.random(len(corners)))[:, None]
    corners = middle + (corners - middle) * shrink[:, None, None] + lift[:, None]
    triangles = np.arange(corners.size // 3, dtype=np.int32).reshape(-1, 3)
    return replace(mesh, vertices=corners.reshape(-1, 3), triangles=triangles)
