# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: Blender's sensor rules as a plane before the eye."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene import Camera, Unsupported
from .arrays import matrix

Plane = tuple[float, float, float, float]


def view_plane(
    size: tuple[float, float],
    fit: str,
    sensor: tuple[float, float],
    *,
    lens: float | None,
    scale: float,
    shift: tuple[float, float],
) -> Plane:
    """Return (left, right, bottom, top) of the full frame on the plane z = -1, or in bu.

    Parameters
    ----------
    size : width and height of the frame, each times its pixel aspect.
    fit : Blender's sensor fit: AUTO, HORIZONTAL or VERTICAL.
    sensor : width and height [mm].
    lens : focal length [mm]; None for an orthographic camera.
    scale : orthographic scale [bu].
    shift : in parts of the side that the sensor fits.

    Notes
    -----
    The fitted side is the width for HORIZONTAL, for AUTO the larger one. It spans
    ``sensor / lens`` on the plane at distance 1, or `scale`; AUTO takes the sensor's width for
    either side. The other side follows from the frame's shape. Shifts count in the fitted side.

    Examples
    --------
    >>> view_plane((2, 1), "AUTO", (36, 24), lens=18.0, scale=0.0, shift=(0.0, 0.0))
    (-1.0, 1.0, -0.5, 0.5)
    """
    width, height = size
    wide = fit == "HORIZONTAL" or (fit == "AUTO" and width > height)
    sensor_side = sensor[1] if fit == "VERTICAL" else sensor[0]
    span = scale if lens is None else sensor_side / lens
    fitted = width if wide else height
    half_x, half_y = span * width / fitted / 2, span * height / fitted / 2
    x, y = span * shift[0], span * shift[1]
    return (x - half_x, x + half_x, y - half_y, y + half_y)


def read_camera(bl_object: Any, render: Any, resolution: tuple[int, int]) -> Camera:
    """Return the camera of an evaluated object; what it does beyond a pinhole is recorded."""
    world = matrix(bl_object.matrix_world)
    world[:3, :3] /= np.linalg.norm(world[:3, :3], axis=0)
    name = bl_object.name
    if bl_object.type != "CAMERA":
        record = Unsupported("camera", name, f"{bl_object.type.title()} as camera")
        return Camera(name, "perspective", world, (-1, 1, -1, 1), (0.1, 100.0), (record,))
    camera = bl_object.data
    kind = "orthographic" if camera.type == "ORTHO" else "perspective"
    plane = view_plane(
        (resolution[0] * render.pixel_aspect_x, resolution[1] * render.pixel_aspect_y),
        camera.sensor_fit,
        (camera.sensor_width, camera.sensor_height),
        lens=None if kind == "orthographic" else camera.lens,
        scale=camera.ortho_scale,
        shift=(camera.shift_x, camera.shift_y),
    )
    records = tuple(Unsupported("camera", name, f) for f in _features(camera, render))
    return Camera(name, kind, world, plane, (camera.clip_start, camera.clip_end), records)


def _features(camera: Any, render: Any) -> list[str]:
    named = {"PANO": "Panoramic camera", "CUSTOM": "Custom camera"}
    features = [named[camera.type]] if camera.type in named else []
    features += ["Depth of field"] * camera.dof.use_dof
    features += ["Stereoscopy"] * render.use_multiview
    return features
