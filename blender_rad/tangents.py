# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangents of UV maps at the corners of triangles, as normal maps are made for.

In a triangle P and (u, v) are linear, and ∂P/∂u ∝ v₂ e₁ − v₁ e₂ of its edges. Where corners share
place, normal, UV and the sense of turning, the tangent is the mean of those of their triangles in
the plane of the normal, weighted by the angle of each there (M. S. Mikkelsen, "Simulation of
Wrinkled Surfaces Revisited", 2008).
"""

import numpy as np

from .arrays import Floats, Singles
from .scene import Mesh


def tangents(mesh: Mesh, uv: Singles) -> Singles:
    """Return (m, 3, 4): unit tangents, and 1 or -1 for the sense of turning.

    `uv` (m, 3, 2) is the map; where a triangle has no area in it, it adds nothing.
    """
    places = mesh.vertices[mesh.triangles]
    corners, flat = places.astype(np.float64), uv.astype(np.float64)
    (e1, e2), (t1, t2) = (np.moveaxis(a[:, 1:] - a[:, :1], 1, 0) for a in (corners, flat))
    turn = np.where(t1[:, 0] * t2[:, 1] > t1[:, 1] * t2[:, 0], 1.0, -1.0)
    along = (t2[:, 1:] * e1 - t1[:, 1:] * e2) * turn[:, None]
    faces = np.repeat(_unit(np.cross(e1, e2))[:, None], 3, axis=1).astype(np.float32)
    normals = faces if mesh.normals is None else mesh.normals
    ahead, behind = (
        _within(np.roll(corners, shift, axis=1) - corners, normals) for shift in (-1, 1)
    )
    angle = np.arccos(np.clip(np.sum(ahead * behind, axis=-1), -1.0, 1.0))
    parts = _within(along[:, None], normals) * angle[..., None]
    signs = np.repeat(turn, 3).astype(np.float32)[:, None]
    shared = np.concatenate(
        [a.reshape(len(signs), -1) for a in (places, normals, uv, signs)], axis=1
    )
    shared = np.ascontiguousarray(shared + np.float32(0.0))  # no -0
    alike = shared.view(np.dtype((np.void, shared.itemsize * shared.shape[1])))
    group = np.unique(alike, return_inverse=True)[1].reshape(-1)
    sums = [np.bincount(group, part)[group].astype(np.float64) for part in parts.reshape(-1, 3).T]
    found = np.concatenate([_unit(np.stack(sums, axis=1)), signs], axis=1)
    return found.reshape(-1, 3, 4).astype(np.float32)


def around(mesh: Mesh) -> Singles:
    """Return the map (m, 3, 2) of a mesh that has none: longitude and latitude of its vertices."""
    x, y, z = mesh.vertices.astype(np.float64).T
    longitude = np.where((x == 0.0) & (y == 0.0), 0.0, 0.5 - 0.5 * np.arctan2(x, y) / np.pi)
    uv = np.stack([longitude, 0.5 + np.arctan2(z, np.hypot(x, y)) / np.pi], axis=1)
    return uv.astype(np.float32)[mesh.triangles]


def _unit(vectors: Floats) -> Floats:
    length = np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
    return vectors / np.where(length == 0.0, 1.0, length)


def _within(vectors: Floats, normals: Singles) -> Floats:
    """Return `vectors` at unit length in the planes of unit normals."""
    return _unit(vectors - np.sum(vectors * normals, axis=-1, keepdims=True) * normals)
