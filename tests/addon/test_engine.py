# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine and the check, in a Blender that has nothing but the installed ZIP of us."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import blender_rad
from tests.addon.building import run

pytestmark = pytest.mark.blender

SIZE = (48, 32)  # pixels
AT = (slice(0, 16), slice(12, 36))  # of the border: the upper half's middle, row 0 at the top


@pytest.fixture(scope="module")
def done(zip_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder with what the installed extension made of a scene."""
    import bpy

    folder = tmp_path_factory.mktemp("engine")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.ops.object.light_add(type='POINT', location=(0, 0, 2))
    bpy.context.object.data.shadow_soft_size = 0.0
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "desk.blend"))
    script = Path(__file__).with_name("_render_and_check.py")
    user = {"BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("user")), "PYTHONPATH": ""}
    run(script, zip_path, folder / "desk.blend", folder, **user)
    return folder


@pytest.fixture(scope="module")
def story(done: Path) -> dict[str, object]:
    return json.loads((done / "story.json").read_text())


def channels(path: Path) -> dict[str, np.ndarray]:
    """Return the channels (h, w) of a file by the end of their names: view layers do not count."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            name.partition("ViewLayer.")[2] or name: np.array(channel.pixels)
            for part in file.parts
            for name, channel in part.channels.items()
        }


def test_f12_gives_the_numbers_of_the_verb(done: Path) -> None:
    how = {"samples": 4, "passes": ["all"], "shading": "clay"}
    blender_rad.render(done / "desk.blend", output=done / "verb.exr", **how)
    verb, f12 = channels(done / "verb.exr"), channels(done / "whole.exr")
    verb |= {f"Combined.{letter}": verb.pop(letter) for letter in "RGBA"}
    assert set(verb) <= set(f12)
    for name, plane in verb.items():
        np.testing.assert_allclose(f12[name], plane, rtol=1e-6, atol=1e-9, err_msg=name)
    assert f12["Illuminance.V"].max() > 0


def test_a_border_renders_its_part_and_nothing_else(done: Path) -> None:
    whole, border, cropped = (
        channels(done / f"{name}.exr")["Illuminance.V"] for name in ("whole", "border", "cropped")
    )
    inside = np.zeros(whole.shape, dtype=bool)
    inside[AT] = True
    np.testing.assert_allclose(border[inside], whole[inside], rtol=1e-6)
    assert not border[~inside].any()
    np.testing.assert_allclose(cropped, whole[AT], rtol=1e-6)


def test_stock_panels_open_for_the_engine_and_close_again(story: dict[str, object]) -> None:
    opened = set(story["opened"])
    assert {"RENDER_PT_output", "DATA_PT_lens", "CYCLES_LIGHT_PT_light"} <= opened
    assert not {name for name in opened if name.startswith("CYCLES_RENDER_PT_")}
    assert story["closed"]


def test_the_check_comes_to_a_verdict_and_shows_where(story: dict[str, object]) -> None:
    assert story["results"] == [["FINISHED"]] * 3
    assert story["verdict"] == "agree"
    assert story["format"] == "OPEN_EXR_MULTILAYER", "false colours put the file format back"
    names = set(story["images"])
    assert "Illuminance [lx]" in names and any(name.startswith("Cycles") for name in names)
