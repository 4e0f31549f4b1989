# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera rays: from positions in the picture to lines in the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .scene import Camera

Floats = NDArray[np.float64]


class CameraRays(NamedTuple):
    """Rays that start at the near clipping plane.

    Attributes
    ----------
    origins, directions : (n, 3) [bu], directions of unit length.
    reach : (n,) [bu] distance along the ray to the far clipping plane.
    """

    origins: Floats
    directions: Floats
    reach: Floats


def camera_rays(camera: Camera, resolution: tuple[int, int], xy: Floats) -> CameraRays:
    """Return the rays through picture positions `xy` (n, 2) [pixels, y up, from lower left]."""
    left, right, bottom, top = camera.plane
    width, height = resolution
    x = left + xy[:, 0] / width * (right - left)
    y = bottom + xy[:, 1] / height * (top - bottom)
    near, far = camera.clip
    local = np.stack([x, y, np.full_like(x, -1.0)])
    rotation, position = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    if camera.kind == "orthographic":
        local[2] = -near
        directions = np.broadcast_to(-rotation[:, 2], (len(x), 3))
        reach = np.full(len(x), far - near)
        return CameraRays((rotation @ local).T + position, directions, reach)
    length = np.sqrt(x * x + y * y + 1.0)
    directions = (rotation @ (local / length)).T
    origins = position + directions * (near * length)[:, None]
    return CameraRays(origins, directions, (far - near) * length)


def view_depth(camera: Camera, points: Floats) -> Floats:
    """Return the depth (n,) [bu] of `points` (n, 3) along the view axis."""
    axis, position = camera.world_from_camera[:3, 2], camera.world_from_camera[:3, 3]
    return -(points - position) @ axis
