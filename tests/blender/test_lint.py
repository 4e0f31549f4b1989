# SPDX-License-Identifier: GPL-3.0-or-later
"""`lint`: silent about an unbiased file, and a finding for everything that biases one."""

import math
from pathlib import Path
from typing import Any

import bpy
import pytest

from .promised import inside, panel, point, save, sky, square, stage
from .reading import add, light, material, put

HARMLESS = {
    "sample_clamp_indirect": 0.0,
    "use_denoising": False,
    "use_adaptive_sampling": False,
    "light_sampling_threshold": 0.0,
    "pixel_filter_type": 'BOX',
    "blur_glossy": 0.0,
    "max_bounces": 64,
    "diffuse_bounces": 64,
}
BIASED: dict[str, Any] = {
    "film_exposure": 2.0,
    "sample_clamp_direct": 0.2,
    "sample_clamp_indirect": 3.0,
    "use_fast_gi": True,
    "max_bounces": 3,
    "caustics_reflective": False,
    "time_limit": 9.0,
}


def quiet() -> Any:
    scene = stage()
    put(scene.cycles, **HARMLESS)
    put(scene.render.image_settings, file_format='OPEN_EXR', color_depth='32')
    point()
    return scene


def lint(file: Path, *options: object) -> tuple[int, dict[str, dict[str, Any]]]:
    run = inside("lint", file, "--json", "--threads", 1, *options)
    assert set(run.document) == {"findings", "efficacy_lm_W", "model"}
    order = [f["severity"] for f in run.document["findings"]]
    assert order == sorted(order, key=["error", "warning", "info"].index)
    return run.code, {f["code"]: f for f in reversed(run.document["findings"])}


def test_an_unbiased_file_has_nothing_but_information(tmp_path: Path) -> None:
    quiet()
    code, found = lint(save(tmp_path / "quiet.blend"))
    assert code == 0
    assert {f["severity"] for f in found.values()} == {"info"}, found
    assert set(found) == {"view-exposure", "bounces"}


def test_blenders_own_defaults_warn_and_are_no_errors(tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    code, found = lint(save(tmp_path / "default.blend"))
    assert code == 0
    expected = {"engine", "denoising", "adaptive-sampling", "clamp-indirect", "default-world"}
    assert expected <= {c for c, f in found.items() if f["severity"] == "warning"}, found
    assert found["light-threshold"]["effect_percent"] == 0.0, "noise is no bias"


def test_every_bias_is_named_with_its_effect(tmp_path: Path) -> None:
    scene = quiet()
    put(scene.cycles, **BIASED)
    scene.unit_settings.scale_length = 0.5
    scene.render.use_simplify, scene.render.resolution_percentage = True, 50
    scene.view_layers[0].material_override = bpy.data.materials["Floor"]
    cone = {"energy": -1.0, "spot_size": math.pi / 3, "spot_blend": 0.0}
    light('SPOT', "Cone", location=(0, 0, 1), **cone)
    point("Soft", (1, 0, 1), radius=0.5, soft=True)
    fill = panel(parent=add("Askew", scale=(2, 1, 1)))
    fill.rotation_euler.z = 0.7
    sky("World", (0.05087609,) * 3)
    driven = point("Driven", energy=0.0).data
    put(driven.driver_add("energy").driver, type='SCRIPTED', expression="[5 for x in (1,)][0]")
    code, found = lint(save(tmp_path / "biased.blend"))
    assert code == 1
    errors = {
        "film-exposure": 100.0,
        "clamp-direct": None,
        "fast-gi": None,
        "material-override": None,
        "negative-energy": -200.0,
        "unit-scale": -75.0,
        "blocked-driver": -100.0,
        "soft-falloff": None,
    }
    for name, effect in errors.items():
        assert found[name]["severity"] == "error", (name, found)
        assert effect is None or math.isclose(found[name]["effect_percent"], effect, rel_tol=1e-6)
    assert -99.0 < found["clamp-direct"]["effect_percent"] < -5.0
    assert -25.0 < found["soft-falloff"]["effect_percent"] < -5.0, "r = 0.5 one metre away: -20 %"
    mean = (0.8 + 0.5 + 0.25) / 3
    assert math.isclose(found["bounces"]["effect_percent"], -100 * mean**4, rel_tol=1e-3)
    share = 100 * ((1 - math.cos(math.pi / 6)) / 2 - 1)
    assert math.isclose(found["spot-cone"]["effect_percent"], share, rel_tol=1e-4)
    warnings = {"clamp-indirect", "simplify", "area-sheared", "spot-cone", "default-world"}
    assert warnings <= {c for c, f in found.items() if f["severity"] == "warning"}, found
    assert {"caustics", "time-limit", "resolution-percentage"} <= set(found)


@pytest.mark.slow
def test_bounds_hold_against_cycles(tmp_path: Path) -> None:
    scene = quiet()
    scene.cycles.sample_clamp_direct, scene.cycles.film_exposure = 0.3, 2.0
    scene.cycles.use_denoising = True
    scene.cycles.max_bounces = 0
    panel()
    file = save(tmp_path / "clamped.blend")
    (_, derived), (code, measured) = lint(file), lint(file, "--measure", 64)
    bound, truth = (found["clamp-direct"]["effect_percent"] for found in (derived, measured))
    assert -99.0 < truth < bound < -10.0, "one light a sample: brighter samples, a larger loss"
    for found in (derived, measured):
        assert math.isclose(found["film-exposure"]["effect_percent"], 100.0, rel_tol=1e-4)
    assert derived["denoising"]["effect_percent"] is None
    assert 0.0 < abs(measured["denoising"]["effect_percent"]) < 3.0, "it keeps means, nearly"
    assert code == 1


@pytest.mark.parametrize("verb", ["lint", "check"])
def test_glass_is_named_with_the_light_that_it_stops(tmp_path: Path, verb: str) -> None:
    """Half of the floor's light: a pane right below a lamp in the middle, on one side of it."""
    quiet()
    lamp = bpy.data.objects["Key"]
    lamp.location = (0, 0, 2)
    pane = square("Pane", 20.0, (20.0, 0, 1.999))
    pane.data.materials[0] = material("Glass", "BsdfGlass")
    pane.visible_camera = False
    run = inside(verb, save(tmp_path / "glass.blend"), "--json", "--threads", 1)
    (found,) = (f for f in run.document["findings"] if f["code"] == "glass-blocks-light")
    assert "Pane" in found["message"]
    assert math.isclose(found["effect_percent"], -50.0, abs_tol=1.0)
    assert verb == "lint" or run.document["verdict"] == "agree"
    bpy.data.objects["Pane"].visible_shadow = False
    assert "glass-blocks-light" not in lint(save(tmp_path / "clear.blend"))[1]


def test_faces_in_one_another_are_named_with_the_light_that_may_be_lost(tmp_path: Path) -> None:
    """A second floor in the first one."""
    quiet()
    square("Double", 2.0)
    _, found = lint(save(tmp_path / "double.blend"))
    assert found["coincident-faces"]["object"] == "Double"
    assert math.isclose(found["coincident-faces"]["effect_percent"], -100.0, abs_tol=1e-6)
