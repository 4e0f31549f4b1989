# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine and the check, in a Blender that has nothing but the installed ZIP of us."""

import importlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import blender_rad
from blender_rad.bpy_io.cameras import read_camera
from tests.blender.reading import channels

AT = (slice(0, 16), slice(12, 36))  # of the border: the upper half's middle, row 0 at the top


def test_f12_gives_the_numbers_of_the_verb(done: Path) -> None:
    how = {"samples": 4, "passes": ["all"], "shading": "clay"}
    blender_rad.render(done / "desk.blend", output=done / "verb.exr", **how)
    verb, f12 = channels(done / "verb.exr"), channels(done / "whole.exr")
    verb |= {f"Combined.{letter}": verb.pop(letter) for letter in "RGBA"}
    assert set(verb) <= set(f12)
    for name, plane in verb.items():
        np.testing.assert_allclose(f12[name], plane, rtol=1e-6, atol=1e-9, err_msg=name)
    assert f12["Illuminance.V"].max() > 0


def test_keyed_lumens_are_rendered_frame_by_frame(done: Path) -> None:
    first, second = (channels(done / f"frame{k}.exr")["Light.Point.R"] for k in (1, 2))
    np.testing.assert_allclose(second, 3.0 * first, rtol=1e-5)
    assert first.max() > 0


def test_a_render_and_a_check_can_be_cancelled(story: dict[str, Any]) -> None:
    told = story["cancelled_render"]
    assert "test_break" in told and "error_set" not in told
    assert told[-1] == "end_result", "what is there is kept, nothing else is said"
    assert story["cancelled_check"] == "cancelled"


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


@pytest.mark.parametrize("kind", ['PERSP', 'ORTHO'])
def test_a_viewport_in_a_camera_sees_what_the_camera_sees(addon: Any, kind: str) -> None:
    bpy.ops.object.camera_add(location=(1, -4, 2), rotation=(1.1, 0.2, 0.3))
    camera, render = bpy.context.object, bpy.context.scene.render
    data, size = camera.data, (90, 60)
    data.type, data.lens, data.shift_x, data.ortho_scale = kind, 28.0, 0.1, 3.0
    data.dof.use_dof, data.dof.aperture_fstop, data.dof.focus_distance = True, 1.4, 3.0
    bpy.context.view_layer.update()
    window = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(), x=size[0], y=size[1], scale_x=1, scale_y=1
    )
    engine = importlib.import_module(f"{addon.__name__}.viewport")
    view = camera.matrix_world.normalized().inverted()
    found, expected = engine.region_camera(view, window), read_camera(camera, render, size)
    assert found.kind == expected.kind
    np.testing.assert_allclose(found.plane, expected.plane, atol=1e-5)
    np.testing.assert_allclose(found.world_from_camera, expected.world_from_camera, atol=1e-5)
    np.testing.assert_allclose(found.clip, expected.clip, rtol=1e-3)
    lens = engine.region_camera(view, window, camera).aperture
    assert asdict(lens) == asdict(expected.aperture)
