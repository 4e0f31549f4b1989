# SPDX-License-Identifier: GPL-3.0-or-later
"""What `lights` says, against what Cycles' light brings to the walls of a closed box.

Each light stands alone in the middle of a box of albedo 1 without bounces, seen from the middle by
a panorama whose middle is the lights' axis: a pixel is E/π on a wall. Σ E dA over the walls is the
flux, and E d²/cos θ the intensity. Suns and worlds light the floor alone.
"""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import blender_rad
from blender_rad.bpy_io.quiet import quiet_stdout
from blender_rad.bpy_io.witness import CyclesWitness

from . import reading
from .agreement import cases, glow

HALF = 5.0  # of the box [bu]
SIZE, SAMPLES = (192, 96), 16
FLUX = AXIS = 2e-3  # pixels of 1.9°; meshes come out 0.03 % low in Cycles itself
SCALES_M = (1.0, 0.25)
SOFT = 0.2
IES = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 2 7 1 1 2 0 0 0\n1 1 0\n0 30 60 90 120 150 180\n0\n"

BALL = {"shadow_soft_size": SOFT, "use_soft_falloff": False}
LIGHTS: dict[str, tuple[str, dict[str, Any]]] = {
    "point": ('POINT', {}),
    "spot-hard": ('SPOT', {"spot_size": 1.0, "spot_blend": 0.0}),
    "area": ('AREA', {"shape": 'SQUARE', "size": 0.2}),
    "sheet": ('MESH', {}),
    "ball": ('MESH', {}),
    "ies": ('POINT', {}),
    "sun": ('SUN', {"angle": 0.2}),
    "World": ('WORLD', {}),
    "soft": ('POINT', {"shadow_soft_size": SOFT}),
    "sphere": ('POINT', BALL),
    "colour": ('POINT', {"color": (0.2, 0.5, 1.0), "exposure": -1.5}),
    "warm": ('POINT', {"use_temperature": True, "temperature": 2700.0}),
    "bare-point": ('POINT', {"normalize": False}),
    "bare-sphere": ('POINT', {**BALL, "normalize": False}),
    "spot": ('SPOT', {"spot_size": 1.5, "spot_blend": 0.5}),
    "spot-elliptic": ('SPOT', {"spot_size": 1.0, "spot_blend": 0.3, "scale": (1, 2, 0.7)}),
    "spot-ball": ('SPOT', {**BALL, "spot_size": 1.5, "spot_blend": 1.0}),
    "area-disc": ('AREA', {"shape": 'DISK', "size": 0.15, "scale": (2, 1.5, 1)}),
    "area-spread": ('AREA', {"shape": 'RECTANGLE', "size": 0.1, "size_y": 0.2, "spread": 1.2}),
    "area-narrow": ('AREA', {"shape": 'SQUARE', "size": 0.1, "spread": 0.3}),
    "area-bare": ('AREA', {"shape": 'ELLIPSE', "size": 0.3, "size_y": 0.2, "normalize": False}),
    "sun-bare": ('SUN', {"angle": 0.5, "normalize": False}),
    "sun-delta": ('SUN', {"angle": 0.0}),
}
# Peaks elsewhere, or finer than a pixel; of IES, Cycles 4.5 makes a ring of what is one direction.
OFF_AXIS = ("ball", "soft", "area-spread", "area-narrow", "ies")
QUICK = tuple(name for name in LIGHTS if name != "ball")[:7]

RING, FACE = [(-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF)], (0, 1, 2, 3)
CORNERS = [(x, y, z) for z in (-HALF, HALF) for x, y in RING]
SIDES = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]


class Box:
    """Floor and walls, all lights in their middle, and what `lights` says of them by unit scale."""

    def __init__(self, folder: Path) -> None:
        scene = reading.empty_scene()
        white = reading.material("White", "BsdfDiffuse", Color=(1,) * 4)
        for name, faces in (("Box", [FACE, (4, 5, 6, 7), *SIDES]), ("Floor", [FACE])):
            reading.add(name, reading.polygons(name, CORNERS, faces, white))
        for name, (kind, properties) in LIGHTS.items():
            if kind not in ('MESH', 'WORLD'):
                add_light(name, kind, **properties)
        glowing, thin = glow(3.0, (1, 0.5, 0.2)), {"scale": (0.1, 0.05, 0.1)}
        sheet, ball = reading.polygons("sheet", *reading.SQUARE), reading.sphere("ball", 24, 13)
        for mesh in (sheet, ball):
            mesh.materials[0] = glowing
            reading.add(mesh.name, mesh, visible_camera=False, **thin)
        reading.world(Color=(0.3, 0.4, 0.5, 1))
        add_light("hidden", 'POINT', hide_render=True)
        driver = add_light("driven", 'POINT').data.driver_add("energy").driver
        driver.expression = "len(bpy.data.objects) * 0.0"
        self.documents = {}
        for metre in SCALES_M:
            scene.unit_settings.system, scene.unit_settings.scale_length = 'METRIC', metre
            path = folder / f"every-{metre}.blend"
            with quiet_stdout():
                bpy.ops.wm.save_as_mainfile(filepath=str(path))
            self.documents[metre] = blender_rad.lights(str(path))
            scene = bpy.context.scene
        lens = {"type": 'PANO', "panorama_type": 'EQUIRECTANGULAR', "clip_start": 0.01}
        reading.camera(**lens, location=(0, 0, 0), rotation_euler=(0, 0, 0))
        self.witness = CyclesWitness(scene, resolution=SIZE, threads=1)
        self.witness.prepare()

    def irradiance(self, name: str) -> np.ndarray:
        """Return E on the walls (or the floor) by direction, (h, w, 3), of one light alone."""
        scene, kind = bpy.context.scene, LIGHTS[name][0]
        outside = kind in ('SUN', 'WORLD')
        for thing in scene.objects:
            wall = {"Box": not outside, "Floor": outside}.get(thing.name, thing.name == name)
            thing.hide_render = not (wall or thing.type == 'CAMERA')
        background = scene.world.node_tree.nodes["Background"]
        background.inputs["Strength"].default_value = float(kind == 'WORLD')
        samples = 4 * SAMPLES if name == "ball" else SAMPLES  # of its many faces, one at a time
        return self.witness.render(0, samples)[..., :3] * np.pi


def add_light(name: str, kind: str, **properties: Any) -> Any:
    point = {"shadow_soft_size": 0.0} if kind in ('POINT', 'SPOT') else {}
    turned = {"energy": 40.0, "rotation_euler": (0.0, 0.0, 0.3)}
    placed = reading.light(kind, name, **{**turned, **point, **properties})
    if name == "ies":
        tree, text = reading.with_nodes(placed.data), bpy.data.texts.new("ies")
        text.write(IES + "100 90 70 40 20 10 5\n")
        made = reading.node(tree, "TexIES", ies=text)
        tree.links.new(made.outputs[0], tree.nodes["Emission"].inputs["Strength"])
    return placed


def directions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return solid angles (h, 1), distance to the wall and cosine on it, (h, w)."""
    width, height = SIZE
    edges = np.sin(np.linspace(-np.pi / 2, np.pi / 2, height + 1))
    solid_angle = np.diff(edges)[:, None] * 2 * np.pi / width
    latitude = (np.arange(height)[:, None] + 0.5) / height * np.pi - np.pi / 2
    longitude = (np.arange(width)[None] + 0.5) / width * 2 * np.pi
    x, y = np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude)
    cosine = np.maximum(np.maximum(abs(x), abs(y)), abs(np.sin(latitude)))
    return solid_angle, HALF / cosine, cosine


def on_axis(picture: np.ndarray) -> np.ndarray:
    width, height = SIZE
    return picture[height // 2 - 1 : height // 2 + 1, width // 2 - 1 : width // 2 + 1].mean((0, 1))


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Box:
    return Box(tmp_path_factory.mktemp("box"))


@pytest.mark.parametrize("name", cases(LIGHTS, QUICK))
def test_the_walls_catch_what_lights_says(box: Box, name: str) -> None:
    measured = box.irradiance(name)
    solid_angle, distance, cosine = directions()
    area = (distance**2 / cosine)[..., None]
    for metre, document in box.documents.items():
        row = next(r for r in document["lights"] if r["name"] == name)
        assert row["type"] == LIGHTS[name][0]
        if row["radiant_flux_W"] is None:
            assert row["irradiance_W_m2_rgb"] == pytest.approx(on_axis(measured), rel=FLUX)
            assert row["illuminance_lx"] > 0.0 and row["peak_luminous_intensity_cd"] is None
            continue
        intensity = measured * area * metre**2
        flux = np.sum(intensity * solid_angle[..., None], axis=(0, 1))
        if name == "soft":  # its disc gives d²/(d²+r²) of what its power says
            flux *= 4 * np.pi / np.sum(solid_angle / (1 + (SOFT / distance) ** 2))
        assert row["radiant_flux_W_rgb"] == pytest.approx(flux, rel=FLUX)
        lumens = document["efficacy_lm_W"] * flux @ (0.2126, 0.7152, 0.0722)
        assert row["luminous_flux_lm"] == pytest.approx(lumens, rel=FLUX)
        if name not in OFF_AXIS:
            peak = row["peak_radiant_intensity_W_sr_rgb"]
            assert peak == pytest.approx(on_axis(intensity), rel=AXIS)


def test_what_does_not_shine_has_a_row_too(box: Box) -> None:
    rows = {row["name"]: row for row in box.documents[1.0]["lights"]}
    assert set(rows) == {*LIGHTS, "hidden", "driven"}
    assert rows["hidden"]["radiant_flux_W"] == 0.0 and rows["hidden"]["blender_energy"] == 40.0
    assert "emits nothing: it is hidden in renders" in rows["hidden"]["notes"]
    assert any("driver of energy cannot run" in note for note in rows["driven"]["notes"])
