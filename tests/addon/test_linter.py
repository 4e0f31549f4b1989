# SPDX-License-Identifier: GPL-3.0-or-later
"""The linter's list: found beside Blender, fixed by a button, undone in one step."""

from typing import Any

import bpy
import pytest

from blender_rad.linting import FIXES

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

BIASED = {
    "film_exposure": 2.0,
    "sample_clamp_direct": 0.2,
    "sample_clamp_indirect": 3.0,
    "use_fast_gi": True,
    "use_denoising": True,
    "use_adaptive_sampling": True,
    "max_bounces": 3,
    "blur_glossy": 1.0,
    "caustics_reflective": False,
}


def state(paths: tuple[str, ...]) -> list[Any]:
    return [bpy.context.scene.path_resolve(f"cycles.{path}") for path in paths]


def listed() -> dict[str, Any]:
    assert bpy.ops.radiometric.lint() == {'FINISHED'}
    group = bpy.context.window_manager.radiometric_lint
    assert not group.busy
    return {finding.code: finding for finding in group.findings}


def test_each_fix_ends_its_finding_in_one_step_that_can_be_undone(addon: Any) -> None:
    bpy.ops.mesh.primitive_plane_add(size=4)
    bpy.ops.object.light_add(type='POINT', location=(0, 0, 1))
    bpy.context.object.data.shadow_soft_size = 0.3
    bpy.ops.object.camera_add(location=(0, 0, 3))
    scene = bpy.context.scene
    scene.radiometric.shading = 'clay'
    scene.camera, lamp = bpy.context.object, bpy.data.objects["Point"].name
    for name, value in BIASED.items():
        setattr(scene.cycles, name, value)
    bpy.ops.ed.undo_push(message="built")
    before = listed()
    assert before["film-exposure"].effect == "+100 %"
    assert (before["soft-falloff"].about, before["soft-falloff"].severity) == (lamp, "error")
    fixed = {code: before[code].about for code in FIXES if code in before}
    assert {"soft-falloff", "film-exposure", "clamp-direct", "bounces", "engine"} <= set(fixed)
    for code, about in fixed.items():
        assert bpy.ops.radiometric.fix('EXEC_DEFAULT', True, code=code, about=about) == {'FINISHED'}
    after = listed()
    assert not (set(fixed) - {"bounces"}) & set(after)
    assert after["bounces"].severity == "info"

    assert not bpy.context.scene.objects[lamp].data.use_soft_falloff
    for _ in fixed:
        assert bpy.ops.ed.undo() == {'FINISHED'}
    assert bpy.context.scene.objects[lamp].data.use_soft_falloff
    assert state(tuple(BIASED)) == pytest.approx(list(BIASED.values()))
    assert bpy.ops.radiometric.fix(code="spot-cone", about=lamp) == {'CANCELLED'}, "none is known"


@pytest.mark.parametrize("code", sorted(FIXES))
def test_every_fix_is_a_setting_that_blender_has(addon: Any, code: str) -> None:
    lamp = bpy.data.lights.new("Lamp", 'POINT')
    for path, value in FIXES[code].items():
        root = lamp if path.startswith("data.") else bpy.context.scene
        parent, _, name = path.removeprefix("data.").rpartition(".")
        owner = root.path_resolve(parent) if parent else root
        setattr(owner, name, value)
        assert getattr(owner, name) == value
