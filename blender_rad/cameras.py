# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera rays: from positions in the picture, and on the lens, to lines in the world."""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval

from .arrays import Bools, Floats, Ints
from .rays import Caster, Hits
from .scene import Aperture, Camera

# From the axes of panoramas, x ahead and z up (of mirror balls -y ahead), to a camera's, -z ahead.
_CAMERA_FROM_PANORAMA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
_CAMERA_FROM_BALL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
FLAT = ("perspective", "orthographic")


class CameraRays(NamedTuple):
    """Rays that start at the near clipping plane."""

    origins: Floats  # (n, 3) [bu]
    directions: Floats  # (n, 3) unit
    reach: Floats  # (n,) [bu] to the far clipping plane; -inf where a panorama shows nothing

    def met(self, caster: Caster) -> tuple[Ints, Hits]:
        """Return which rays (k,) meet a surface, and where."""
        hits = caster.intersect(self.origins, self.directions)
        met = np.flatnonzero((hits.instance >= 0) & (hits.distance <= self.reach))
        return met, hits.take(met)


def camera_rays(
    camera: Camera, resolution: tuple[int, int], xy: Floats, lens: Floats | None = None
) -> CameraRays:
    """Return the rays through picture positions `xy` (n, 2) [pixels, y up, from lower left].

    `lens` (n, 2) in [0, 1) chooses where they pass the lens; None is its middle. All that pass it
    meet where the ray through the middle is in focus.
    """
    left, right, bottom, top = camera.plane
    x = left + xy[:, 0] / resolution[0] * (right - left)
    y = bottom + xy[:, 1] / resolution[1] * (top - bottom)
    (near, far), nought = camera.clip, np.zeros_like(x)
    eye, reach = np.zeros((3, len(x))), np.full_like(x, far - near)
    if camera.kind == "orthographic":
        eye[:2], aim = (x, y), np.stack([nought, nought, nought - 1.0])
    elif camera.kind == "perspective":
        aim = np.stack([x, y, nought - 1.0])
    else:
        aim, inside = _panorama(camera, x, y)
        reach[~inside] = -np.inf
    stretch = np.sqrt(np.sum(aim**2, axis=0))
    reach *= stretch
    directions = aim / stretch
    if camera.aperture is not None and lens is not None:
        shift = _on_lens(camera.aperture, lens)
        if camera.kind not in FLAT:
            shift = _across(directions, shift, _axes(camera))
        eye += shift
        directions = aim * camera.aperture.focus - shift
        directions /= np.sqrt(np.sum(directions**2, axis=0))
        if camera.kind == "orthographic":
            stretch = -1.0 / directions[2]
    eye += directions * (near * stretch)
    rotation, position = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    return CameraRays((rotation @ eye).T + position, (rotation @ directions).T, reach)


def _axes(camera: Camera) -> Floats:
    return _CAMERA_FROM_BALL if camera.kind == "mirrorball" else _CAMERA_FROM_PANORAMA


def _panorama(camera: Camera, u: Floats, v: Floats) -> tuple[Floats, Bools]:
    """Return unit directions (3, n) in the camera's axes, and whether they are in the picture."""
    inside = np.ones(u.shape, dtype=bool)
    if camera.kind == "mirrorball":  # n faces the camera, and d = 2 (n·e) n - e with e towards it
        x, z = 2.0 * u - 1.0, 2.0 * v - 1.0
        inside = x * x + z * z <= 1.0
        facing = np.sqrt(np.where(inside, 1.0 - x * x - z * z, 0.0))
        axes = [2.0 * facing * x, 1.0 - 2.0 * facing**2, 2.0 * facing * z]
    elif camera.kind in ("equirectangular", "central_cylindrical"):
        low, high, bottom, top = camera.lens
        turn, rise = -(low + u * (high - low)), bottom + v * (top - bottom)
        level = np.ones_like(u)
        if camera.kind == "equirectangular":
            level, rise = np.cos(rise), np.sin(rise)
        axes = [level * np.cos(turn), level * np.sin(turn), rise]
    elif camera.kind == "equiangular_cubemap_face":
        axes = [np.ones_like(u), *np.tan(0.5 * np.pi * np.stack([0.5 - u, v - 0.5]))]
    else:
        *curve, field, width, height = camera.lens
        right, up = (u - 0.5) * width, (v - 0.5) * height
        angle, inside = _fisheye(camera.kind, curve, field, np.hypot(right, up))
        across = np.sin(angle) / np.maximum(np.hypot(right, up), 1e-30)
        axes = [np.cos(angle), -right * across, up * across]
    directions = np.stack(axes)
    directions[:, ~inside] = _axes(camera).T[:, 2:]
    return _axes(camera) @ (directions / np.sqrt(np.sum(directions**2, axis=0))), inside


def _fisheye(kind: str, curve: list[float], field: float, r: Floats) -> tuple[Floats, Bools]:
    """Return the angle from the axis at `r` (n,) on the sensor, and whether the lens shows it."""
    if kind == "fisheye_equidistant":
        return 0.5 * field * r, r <= 1.0
    if kind == "fisheye_equisolid":
        angle = 2.0 * np.arcsin(np.minimum(r / (2.0 * curve[0]), 1.0))
    else:
        angle = -np.asarray(polyval(r, curve), dtype=np.float64)
    return angle, np.abs(angle) <= 0.5 * field


def _on_lens(aperture: Aperture, u: Floats) -> Floats:
    """Return points (3, n) even over the opening, a disc or a polygon, in the camera's axes."""
    first, second = u.T
    if aperture.blades < 3:
        r, turn = np.sqrt(first), 2.0 * np.pi * second
    else:  # in a triangle from the middle to one of its sides
        side, first = np.divmod(first * aperture.blades, 1.0)
        half = np.pi / aperture.blades
        along, depth = (2.0 * second - 1.0) * np.sin(half), np.cos(half)
        r = np.sqrt(first) * np.hypot(along, depth)
        turn = np.arctan2(along, depth) + aperture.rotation + 2.0 * half * side
    x, y = r * np.cos(turn) / aperture.ratio, r * np.sin(turn)
    return aperture.radius * np.stack([x, y, np.zeros_like(x)])


def _across(directions: Floats, shift: Floats, axes: Floats) -> Floats:
    """Return `shift` (3, n) on lenses that stand across each direction (3, n)."""
    ahead = axes[:, :1]
    first = ahead - np.sum(ahead * directions, axis=0) * directions
    first /= np.maximum(np.sqrt(np.sum(first**2, axis=0)), 1e-30)
    second = np.cross(directions, first, axis=0) * np.linalg.det(axes)
    return shift[0] * first + shift[1] * second


def view_depth(camera: Camera, points: Floats) -> Floats:
    """Return the depth (n,) [bu] of `points` (n, 3): along the view axis; distance in panoramas."""
    axis, position = camera.world_from_camera[:3, 2], camera.world_from_camera[:3, 3]
    if camera.kind in FLAT:
        return -(points - position) @ axis
    return np.asarray(np.linalg.norm(points - position, axis=1))
