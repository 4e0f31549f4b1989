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


def tangents(mesh: Mesh, uv: Singles, *, closed: bool = False) -> Singles:
    """Return (m, 3, 4): unit tangents, and 1 or -1 for the sense of turning.

    `uv` (m, 3, 2) is the map. A triangle without area in it adds nothing and takes what others have
    at its corners, the X axis where none has anything. Across the seam of a `closed` map u goes on.
    """
    places = mesh.vertices[mesh.triangles]
    corners, flat = places.astype(np.float64), uv.astype(np.float64)
    (e1, e2), (t1, t2) = (np.moveaxis(a[:, 1:] - a[:, :1], 1, 0) for a in (corners, flat))
    if closed:
        t1[:, 0], t2[:, 0] = (t[:, 0] - np.round(t[:, 0]) for t in (t1, t2))
    turn = np.sign(t1[:, 0] * t2[:, 1] - t1[:, 1] * t2[:, 0])
    along = (t2[:, 1:] * e1 - t1[:, 1:] * e2) * turn[:, None]
    faces = np.repeat(_unit(np.cross(e1, e2))[:, None], 3, axis=1).astype(np.float32)
    normals = faces if mesh.normals is None else mesh.normals
    ahead, behind = (
        _within(np.roll(corners, shift, axis=1) - corners, normals) for shift in (-1, 1)
    )
    angle = np.arccos(np.clip(np.sum(ahead * behind, axis=-1), -1.0, 1.0))
    parts = _within(along[:, None], normals) * angle[..., None]
    signs = np.repeat(turn, 3)
    shared = np.concatenate([a.reshape(len(signs), -1) for a in (places, normals, uv)], axis=1)
    shared = np.ascontiguousarray(shared + np.float32(0.0))  # no -0
    alike = shared.view(np.dtype((np.void, shared.itemsize * shared.shape[1])))
    side = 2 * np.unique(alike, return_inverse=True)[1].reshape(-1) + (signs > 0.0)
    sums = [np.bincount(side, part, 2 * len(side)) for part in parts.reshape(-1, 3).T]
    total = _unit(np.stack(sums, axis=1).astype(np.float64))
    side[(signs == 0.0) & ~total[side].any(axis=1)] += 1
    found = np.concatenate([total[side], 2.0 * (side % 2)[:, None] - 1.0], axis=1)
    found[~total[side].any(axis=1)] = [1.0, 0.0, 0.0, -1.0]
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
