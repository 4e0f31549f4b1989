# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras and shading normals as read, against Cycles' Position and Normal passes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.direct import Visibility
from blender_rad.scene import Scene
from blender_rad.surfaces import Geometry, normalized

from .reading import (
    SQUARE,
    add,
    camera,
    cycles_passes,
    empty_scene,
    geometry_nodes,
    polygons,
    put,
    sphere,
)

PIXEL = 0.02  # Cycles' own rays stray by 0.007 pixel within its narrowest filter
NORMAL = 2e-3  # normals are packed into 32 bits in Blender 5.2

CAMERAS = {
    "auto": {},
    "horizontal": {"sensor_fit": 'HORIZONTAL', "sensor_height": 12},
    "vertical": {"sensor_fit": 'VERTICAL', "sensor_height": 20},
    "shift": {"shift_x": 0.13, "shift_y": -0.21},
    "vertical-shift": {"sensor_fit": 'VERTICAL', "shift_x": 0.13, "shift_y": -0.21},
    "field-of-view": {"lens_unit": 'FOV', "angle": 0.7},
    "orthographic": {"type": 'ORTHO', "ortho_scale": 5, "shift_x": 0.1, "shift_y": 0.05},
    "orthographic-vertical": {"type": 'ORTHO', "ortho_scale": 3, "sensor_fit": 'VERTICAL'},
}
FRAMES = {
    "wide": (48, 30, 1, 1),
    "tall": (30, 48, 1, 1),
    "aspect": (40, 40, 1.7, 1),
    "aspect-tall": (50, 30, 1, 2),
}


def view(width: int, height: int, aspect_x: float = 1, aspect_y: float = 1, **options: Any) -> Any:
    """Put a camera before what is there, and return it."""
    size = {"resolution_x": width, "resolution_y": height}
    aspect = {"pixel_aspect_x": aspect_x, "pixel_aspect_y": aspect_y}
    put(bpy.context.scene.render, **size, **aspect)
    return camera(**options)


def wall(*size: Any, **options: Any) -> Any:
    """A wall that fills the view of a camera, which is returned."""
    empty_scene()
    add("Wall", polygons("Wall", *SQUARE), scale=(50, 50, 1))
    return view(*size, **options)


def read() -> Scene:
    return read_scene(bpy.context.scene)


def strayed(scene: Scene, path: Path) -> np.ndarray[Any, Any]:
    """Return how far Cycles' hits appear from its pixels' centres, in pixels."""
    assert scene.camera is not None
    passes = cycles_passes(path)
    rows, columns = np.nonzero(np.isfinite(passes["Depth"]) & (passes["Depth"] < 1e9))
    assert len(rows) > 200
    world = scene.camera.world_from_camera
    local = (passes["Position"][rows, columns] - world[:3, 3]) @ world[:3, :3]
    if scene.camera.kind == "perspective":
        local = local / -local[:, 2:]
    plane = np.reshape(scene.camera.plane, (2, 2))  # left to right, bottom to top
    seen = (local[:, :2] - plane[:, 0]) / np.ptp(plane, axis=1) * scene.resolution
    centres = np.stack([columns + 0.5, scene.resolution[1] - rows - 0.5], axis=-1)
    return np.abs(seen - centres).max(axis=1)


@pytest.mark.parametrize("size", FRAMES)
@pytest.mark.parametrize("kind", CAMERAS)
def test_pixels_of_cycles_lie_on_our_rays(kind: str, size: str, tmp_path: Path) -> None:
    wall(*FRAMES[size], **CAMERAS[kind]).scale = (2, 0.5, 3)
    assert strayed(read(), tmp_path).max() < PIXEL


def test_resolution_percentage_cuts_pixels(tmp_path: Path) -> None:
    wall(101, 67)
    bpy.context.scene.render.resolution_percentage = 33
    assert read().resolution == (33, 22)
    assert cycles_passes(tmp_path)["Depth"].shape == (22, 33)


@pytest.mark.parametrize("crop", [False, True])
def test_border_is_what_cycles_renders(crop: bool, tmp_path: Path) -> None:
    wall(60, 40)
    across = {"border_min_x": 0.21, "border_max_x": 0.66}
    along = {"border_min_y": 0.33, "border_max_y": 0.71}
    put(bpy.context.scene.render, use_border=True, use_crop_to_border=crop, **across, **along)
    scene = read()
    assert scene.border is not None
    x0, y0, x1, y1 = scene.border
    seen = np.abs(cycles_passes(tmp_path)["Position"]).max(axis=-1) > 0
    if crop:
        assert seen.shape == (y1 - y0, x1 - x0)
    else:
        expected = np.zeros((40, 60), bool)
        expected[40 - y1 : 40 - y0, x0:x1] = True
        assert (seen == expected).all()


def test_layers_without_surfaces_show_none(tmp_path: Path) -> None:
    wall(8, 8)
    bpy.context.scene.view_layers[0].use_solid = False
    assert not read().instances
    assert not cycles_passes(tmp_path)["Position"].any()


def normal_errors(scene: Scene, path: Path) -> np.ndarray[Any, Any]:
    """Return the difference between Cycles' normals and ours where its camera rays hit."""
    assert scene.camera is not None
    passes, eye = cycles_passes(path), scene.camera.world_from_camera[:3, 3]
    hit = np.isfinite(passes["Depth"]) & (passes["Depth"] < 1e9)
    assert hit.sum() > 200
    towards = normalized(passes["Position"][hit] - eye)
    hits = Visibility(scene).camera.intersect(np.tile(eye, (len(towards), 1)), towards)
    ours = Geometry(scene).surface(hits, towards).normal
    return np.abs(ours - passes["Normal"][hit]).max(axis=1)


def sharp_edges(mesh: Any) -> None:
    mesh.attributes.new("sharp_edge", 'BOOLEAN', 'EDGE')
    for edge in mesh.edges:
        edge.use_edge_sharp = edge.index % 3 == 0


def sharp_faces(mesh: Any) -> None:
    for face in mesh.polygons:
        face.use_smooth = face.index % 4 != 0


def bent(vectors: Any) -> Any:
    normals = np.array([tuple(v) for v in vectors])
    normals += 0.3 * np.random.default_rng(3).normal(size=normals.shape)
    return (normals / np.linalg.norm(normals, axis=1, keepdims=True)).tolist()


def custom_normals(mesh: Any) -> None:
    mesh.normals_split_custom_set_from_vertices(bent(v.normal for v in mesh.vertices))


def custom_corners(mesh: Any) -> None:
    mesh.normals_split_custom_set(bent(n.vector for n in mesh.corner_normals))


def as_it_is(mesh: Any) -> None:
    """Smooth everywhere."""


TURNED = {"rotation_euler": (0.3, 0.4, 0.1)}


@pytest.mark.parametrize("users", [1, 2])
@pytest.mark.parametrize(
    ("change", "scale"),
    [
        (as_it_is, (2.0, 1.0, 0.4)),
        (as_it_is, (-1.5, 1.0, 0.5)),
        (as_it_is, (-1, -1, -0.6)),
        (sharp_edges, (1.5, 1, 0.7)),
        (sharp_faces, (1.5, 1, 0.7)),
        (custom_normals, (1.5, 1, 0.7)),
        (custom_corners, (1.5, 1, 0.7)),
    ],
)
def test_normals_are_moved_as_cycles_moves_them(
    change: Any, scale: tuple[float, float, float], users: int, tmp_path: Path
) -> None:
    empty_scene()
    mesh = sphere("Sphere")
    change(mesh)
    add("One", mesh, scale=scale, **TURNED)
    if users == 2:
        add("Two", mesh, location=(0, 0, -40), scale=(1, 2, 1))
    view(48, 36)
    scene = read()
    assert scene.instances[0].normals_in_world == (users == 1)
    errors = normal_errors(scene, tmp_path)
    assert np.quantile(errors, 0.99) < NORMAL


def test_the_two_ways_of_moving_normals_differ(tmp_path: Path) -> None:
    """The test above could not fail if both rules gave the same normals."""
    empty_scene()
    add("One", sphere("Sphere"), scale=(2, 1, 0.4), **TURNED)
    view(48, 36)
    scene = read()
    wrong = tuple(replace(i, normals_in_world=not i.normals_in_world) for i in scene.instances)
    errors = normal_errors(replace(scene, instances=wrong), tmp_path)
    assert np.quantile(errors, 0.5) > 3 * NORMAL


@pytest.mark.parametrize("change", [sharp_edges, custom_corners])
def test_normals_of_divided_meshes_in_geometry_nodes(change: Any, tmp_path: Path) -> None:
    empty_scene()
    mesh = sphere("Sphere")
    change(mesh)
    host = add("Host", polygons("Host", *SQUARE), scale=(1.5, 1, 0.7))
    source = bpy.data.objects.new("Source", mesh)
    geometry_nodes(host, "GeometryNodeObjectInfo", Object=source, As_Instance=True)
    view(48, 36)
    scene = read()
    errors = normal_errors(scene, tmp_path)
    assert np.quantile(errors, 0.99) < NORMAL
