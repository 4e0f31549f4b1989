# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramas point by point against Cycles' Position and Depth, lenses against its pictures."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.cameras import camera_rays, view_depth

from .reading import CUBE, add, camera, cycles_passes, empty_scene, polygons

RANGE = {"latitude_min": -0.4, "latitude_max": 1.1, "longitude_min": -2.0, "longitude_max": 0.9}
FISHEYE = {"fisheye_fov": 2.6, "fisheye_lens": 9.0, "sensor_width": 30.0, "sensor_fit": 'VERTICAL'}
PANORAMAS: dict[str, dict[str, Any]] = {
    "EQUIRECTANGULAR": RANGE,
    "MIRRORBALL": {"shift_x": 0.1},
    "FISHEYE_EQUIDISTANT": {**FISHEYE, "shift_y": -0.15},
    "FISHEYE_EQUISOLID": FISHEYE,
    "FISHEYE_LENS_POLYNOMIAL": {
        **FISHEYE,
        "fisheye_polynomial_k0": 0.01,
        "fisheye_polynomial_k1": -0.06,
        "fisheye_polynomial_k3": 2e-5,
    },
    "EQUIANGULAR_CUBEMAP_FACE": {},
    "CENTRAL_CYLINDRICAL": {
        "central_cylindrical_range_u_min": -1.2,
        "central_cylindrical_range_v_max": 2.0,
        "central_cylindrical_radius": 1.5,
    },
}
DISTANCE = 2e-3  # [bu] of 6: Cycles' rays pass near a pixel's centre, and pixels are 0.3 wide


def room(size: tuple[int, int], **properties: Any) -> Any:
    """A camera inside a leaning box, its object returned."""
    empty_scene()
    add("Room", polygons("Room", *CUBE), scale=(6, 5, 4), rotation_euler=(0.1, 0.2, 0.3))
    placed = camera(**properties)
    placed.location, placed.rotation_euler = (0.5, -0.4, 0.3), (1.2, 0.3, 0.7)
    render = bpy.context.scene.render
    (render.resolution_x, render.resolution_y), render.pixel_aspect_x = size, 1.25
    return placed


def centres(size: tuple[int, int]) -> np.ndarray:
    """Return the middles of pixels (n, 2), from the upper left."""
    row, column = np.indices(size[::-1])
    return np.stack([column + 0.5, size[1] - 0.5 - row], axis=-1).reshape(-1, 2)


@pytest.mark.feature("what each pixel sees")
@pytest.mark.parametrize("kind", PANORAMAS)
def test_panorama_sees_what_cycles_sees(kind: str, tmp_path: Path) -> None:
    size = 60, 48
    room(size, type='PANO', panorama_type=kind, **PANORAMAS[kind])
    scene = read_scene(bpy.context.scene)
    assert scene.camera is not None
    passes = cycles_passes(tmp_path)
    rays = camera_rays(scene.camera, size, centres(size))
    seen, position = rays.reach > 0.0, passes["Position"].reshape(-1, 3)
    hit = position.any(axis=1)
    assert (seen == hit).mean() > 0.99
    both = seen & hit
    assert both.mean() > 0.4
    to = position - rays.origins
    ahead = np.sum(to * rays.directions, axis=1)
    off = np.linalg.norm(to - ahead[:, None] * rays.directions, axis=1)[both]
    assert np.median(off) < DISTANCE
    assert np.quantile(off, 0.9) < 5 * DISTANCE
    depth = view_depth(scene.camera, position)
    np.testing.assert_allclose(depth[both], passes["Depth"].ravel()[both], rtol=1e-4)


BLADES = {"aperture_blades": 3, "aperture_rotation": 0.5, "aperture_ratio": 2.0}
LENSES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "disc": ({}, {}),
    "blades": ({}, BLADES),
    "orthographic": ({"type": 'ORTHO', "ortho_scale": 2}, {"aperture_fstop": 2.0, **BLADES}),
    "panorama": ({"type": 'PANO', "panorama_type": 'EQUIRECTANGULAR', **RANGE}, BLADES),
    "mirror-ball": ({"type": 'PANO', "panorama_type": 'MIRRORBALL'}, BLADES),
}


@pytest.mark.feature("depth of field: picture")
@pytest.mark.parametrize("name", LENSES)
def test_lens_lets_through_what_it_does_in_cycles(
    name: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    """From what a pixel sees, through what is in focus there, to a point of the opening."""
    size, (own, lens) = (120, 96), LENSES[name]
    placed = room(size, **own)
    dof = placed.data.dof
    dof.use_dof, dof.focus_object = True, add("Focus", None, location=(0.2, 0.6, 1.3))
    for key, value in {"aperture_fstop": 0.1, **lens}.items():
        setattr(dof, key, value)
    seen_by = read_scene(bpy.context.scene).camera
    assert seen_by is not None and seen_by.aperture is not None
    middle = camera_rays(seen_by, size, centres(size))
    matrix, ahead = seen_by.world_from_camera, middle.directions
    flat = name in ("disc", "blades", "orthographic")
    across = np.broadcast_to(-matrix[:3, 2], ahead.shape) if flat else ahead
    length = 1.0 / np.sum(across * ahead, axis=1)[:, None]
    start = middle.origins - seen_by.clip[0] * length * ahead
    focus = start + seen_by.aperture.focus * length * ahead
    first = np.broadcast_to(matrix[:3, 0], ahead.shape)
    if not flat:
        first = -matrix[:3, 2] - np.sum(ahead * -matrix[:3, 2], axis=1)[:, None] * ahead
        first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(first, across) * (1.0 if flat else -1.0)

    def on_lens(point: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Where lines cross the lens, (n, 2); nan where a panorama shows nothing."""
        far = np.sum((start - point) * across, axis=1) / np.sum(towards * across, axis=1)
        at = point + far[:, None] * towards - start
        found = np.stack([np.sum(at * axis, axis=1) for axis in (first, second)], axis=-1)
        return found[middle.reach > 0.0]

    position = cycles_passes(tmp_path)["Position"].reshape(-1, 3)
    theirs = on_lens(position, focus - position)
    rays = camera_rays(seen_by, size, centres(size), rng.random((len(position), 2)))
    mine = on_lens(rays.origins, rays.directions)
    radius = seen_by.aperture.radius
    assert np.abs(theirs).max(axis=0) == pytest.approx(np.abs(mine).max(axis=0), abs=0.04 * radius)
    for i, j in [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]:
        a, b = (p[:, 0] ** i * p[:, 1] ** j for p in (mine, theirs))
        assert abs(a.mean() - b.mean()) < 5 * np.sqrt((a.var() + b.var()) / len(a)), (i, j)
