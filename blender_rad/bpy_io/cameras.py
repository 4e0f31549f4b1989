# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: Blender's sensor rules as a plane before the eye, its panoramas and its lens."""

from typing import Any

import numpy as np

from ..arrays import Floats
from ..scene import Aperture, Camera, Unsupported
from .arrays import matrix

# Properties that `Camera.lens` holds of a panorama; the sensor's sides follow.
_PANORAMAS = {
    "equirectangular": ("longitude_min", "longitude_max", "latitude_min", "latitude_max"),
    "central_cylindrical": tuple(
        f"central_cylindrical_range_{end}" for end in ("u_min", "u_max", "v_min", "v_max")
    ),
    "fisheye_equidistant": ("fisheye_fov",),
    "fisheye_equisolid": ("fisheye_lens", "fisheye_fov"),
    "fisheye_lens_polynomial": (*(f"fisheye_polynomial_k{k}" for k in range(5)), "fisheye_fov"),
}


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
    sensor, (width, height) = _frame(camera, size)
    x, y, lens = camera.shift_x, camera.shift_y, ()
    if camera.type == "PANO":
        plane = (x, 1.0 + x, y, 1.0 + y)
        lens = _panorama(camera, kind, (sensor * width, sensor * height))
    else:
        span = camera.ortho_scale if kind == "orthographic" else sensor / camera.lens
        left, right = (span * (x + side * width / 2) for side in (-1, 1))
        bottom, top = (span * (y + side * height / 2) for side in (-1, 1))
        plane = (left, right, bottom, top)
    features = ["Custom camera"] * (camera.type == "CUSTOM")
    features += ["Stereoscopy"] * render.use_multiview
    unsupported = tuple(Unsupported("camera", name, feature) for feature in features)
    clip = (camera.clip_start, camera.clip_end)
    return Camera(name, kind, world, plane, clip, unsupported, lens, lens_of(camera, world))


def _frame(camera: Any, size: tuple[float, float]) -> tuple[float, tuple[float, float]]:
    """Return the side of the sensor [mm] that spans one of the frame's, and these in parts of it.

    The fitted side is the width for HORIZONTAL, for AUTO the larger one; AUTO takes the sensor's
    width for either. The other side follows from the frame's shape. Shifts count in the fitted.
    """
    fit, (width, height) = camera.sensor_fit, size
    wide = fit == "HORIZONTAL" or (fit == "AUTO" and width > height)
    fitted = width if wide else height
    sensor = camera.sensor_height if fit == "VERTICAL" else camera.sensor_width
    return sensor, (width / fitted, height / fitted)


def _panorama(camera: Any, kind: str, sensor: tuple[float, float]) -> tuple[float, ...]:
    """Return `Camera.lens` of a panorama, seen by a sensor (width, height) [mm]."""
    values = tuple(getattr(camera, name) for name in _PANORAMAS.get(kind, ()))
    if kind == "central_cylindrical":
        left, right, low, high = values
        radius = camera.central_cylindrical_radius
        return (left, right, low / radius, high / radius)
    if kind == "fisheye_equidistant":
        return (*values, 2.0, 2.0)
    return (*values, *sensor) if kind.startswith("fisheye") else values


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
