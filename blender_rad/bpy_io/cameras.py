# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: Blender's sensor rules as a plane before the eye, its panoramas and its lens."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Aperture, Camera, Unsupported
from .arrays import matrix

Floats = NDArray[np.float64]
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
    """Return the camera of an evaluated object; what is not known of it is recorded."""
    world = matrix(bl_object.matrix_world)
    world[:3, :3] /= np.linalg.norm(world[:3, :3], axis=0)
    name = bl_object.name
    if bl_object.type != "CAMERA":
        record = Unsupported("camera", name, f"{bl_object.type.title()} as camera")
        return Camera(name, "perspective", world, (-1, 1, -1, 1), (0.1, 100.0), (record,))
    camera = bl_object.data
    kinds = {"ORTHO": "orthographic", "PANO": camera.panorama_type.lower()}
    kind = kinds.get(camera.type, "perspective")
    size = (resolution[0] * render.pixel_aspect_x, resolution[1] * render.pixel_aspect_y)
    sensor, shift = (camera.sensor_width, camera.sensor_height), (camera.shift_x, camera.shift_y)
    fit, focal = camera.sensor_fit, None if kind == "orthographic" else camera.lens
    plane = view_plane(size, fit, sensor, lens=focal, scale=camera.ortho_scale, shift=shift)
    lens: tuple[float, ...] = ()
    if camera.type == "PANO":
        left, right, bottom, top = view_plane(size, fit, sensor, lens=1.0, scale=0.0, shift=(0, 0))
        lens = _panorama(camera, kind, (right - left, top - bottom))
        plane = (shift[0], 1.0 + shift[0], shift[1], 1.0 + shift[1])
    features = ["Custom camera"] * (camera.type == "CUSTOM")
    features += ["Stereoscopy"] * render.use_multiview
    return Camera(
        name,
        kind,
        world,
        plane,
        (camera.clip_start, camera.clip_end),
        tuple(Unsupported("camera", name, feature) for feature in features),
        lens,
        lens_of(camera, world),
    )


def _panorama(camera: Any, kind: str, sensor: tuple[float, float]) -> tuple[float, ...]:
    """Return `Camera.lens` of a panorama, seen by a sensor (width, height) [mm]."""

    def ranges(path: str, *names: str) -> tuple[float, ...]:
        return tuple(getattr(camera, path.format(name)) for name in names)

    if kind == "equirectangular":
        return ranges("{}", "longitude_min", "longitude_max", "latitude_min", "latitude_max")
    if kind == "central_cylindrical":
        turn = ranges("central_cylindrical_range_{}", "u_min", "u_max")
        low, high = ranges("central_cylindrical_range_{}", "v_min", "v_max")
        radius = camera.central_cylindrical_radius
        return (*turn, low / radius, high / radius)
    if kind == "fisheye_equidistant":
        return (camera.fisheye_fov, 2.0, 2.0)
    if kind == "fisheye_equisolid":
        return (camera.fisheye_lens, camera.fisheye_fov, *sensor)
    if kind == "fisheye_lens_polynomial":
        curve = ranges("fisheye_polynomial_{}", "k0", "k1", "k2", "k3", "k4")
        return (*curve, camera.fisheye_fov, *sensor)
    return ()


def lens_of(camera: Any, world: Floats) -> Aperture | None:
    """Return the lens of a camera that stands at `world` (4, 4).

    Cycles takes the focal length as mm of which 1000 are a Blender unit, and an orthographic
    camera's as 1 unit; the distance to an object counts along the view axis.
    """
    dof = camera.dof
    if not dof.use_dof:
        return None
    focal = 1.0 if camera.type == "ORTHO" else 1e-3 * camera.lens
    distance, target = dof.focus_distance, dof.focus_object
    if target:
        bone = target.pose and target.pose.bones.get(dof.focus_subtarget)
        place = matrix(target.matrix_world @ bone.matrix if bone else target.matrix_world)
        distance = abs(world[:3, 2] @ (world[:3, 3] - place[:3, 3]))
    return Aperture(
        radius=focal / (2.0 * max(dof.aperture_fstop, 1e-5)),
        focus=max(float(distance), 1e-5),
        blades=dof.aperture_blades,
        rotation=dof.aperture_rotation,
        ratio=dof.aperture_ratio,
    )
