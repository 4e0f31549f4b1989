# SPDX-License-Identifier: GPL-3.0-or-later
"""Lux and cd/m² of a closed box whose light is known, through the files of either engine.

Walls of albedo ρ that emit e from every point see the same radiance everywhere, L = e + ρ·L, so
L = e/(1 − ρ) and E = π·L. The wall at the right reflects nothing and emits
e/(1 − ρ) at once: with all bounces it leaves the rest as it is, and has no illuminance to show.
"""

from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.quiet import quiet_stdout
from blender_rad.commands import COMMANDS
from blender_rad.photometry.falsecolor import read_map
from blender_rad.working_space import REC709, luminance_weights

from .agreement import look_at
from .reading import added, empty_scene, material, put, render_layers

EMISSION, ALBEDO = np.array([1.0, 2.0, 0.5]), np.array([0.2, 0.5, 0.8])
RADIANCE = EMISSION / (1 - ALBEDO)
PHOTOMETRIC = 683.002 * np.array(luminance_weights(REC709))
EXPOSURE = 4.0
SIZE = (48, 27)


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The saved scene, with Cycles' picture of it beside it."""
    bl_scene = empty_scene()
    bpy.ops.mesh.primitive_cube_add()
    mesh = bpy.context.object.data
    for emission, albedo in ((EMISSION, ALBEDO), (RADIANCE, np.zeros(3))):
        made = material("Wall", "BsdfDiffuse", Color=tuple(albedo))
        added(made, "Emission", Color=tuple(emission))
        mesh.materials.append(made)
    for face in mesh.polygons:
        face.material_index = int(face.center.x > 0.5)
    look_at((1, 1.5, 0), (-0.5, -0.5, 0), lens=30)
    put(bl_scene.render, engine='CYCLES', resolution_x=SIZE[0], resolution_y=SIZE[1])
    settings = {"sample_clamp_indirect": 0, "use_denoising": False, "use_adaptive_sampling": False}
    bounces = {"max_bounces": 64, "diffuse_bounces": 64}
    put(bl_scene.cycles, samples=128, film_exposure=EXPOSURE, **settings, **bounces)
    passes = [f"use_pass_diffuse_{name}" for name in ("direct", "indirect", "color")]
    put(bl_scene.view_layers[0], **dict.fromkeys(passes, True))
    folder = tmp_path_factory.mktemp("box")
    render_layers(folder / "cycles.exr")
    with quiet_stdout():
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "box.blend"))
    return folder


def test_global_illumination_of_cycles(box: Path) -> None:
    lux = read_map(box / "cycles.exr", "illuminance", exposure=EXPOSURE)
    nits = read_map(box / "cycles.exr", "luminance", exposure=EXPOSURE)
    lost = np.isnan(lux.values)
    assert 0.2 < lost.mean() < 0.8
    assert lost[:, -1].all()
    assert not lost[:, 0].any()
    assert np.mean(lux.values[~lost]) == pytest.approx(np.pi * RADIANCE @ PHOTOMETRIC, rel=2e-3)
    assert np.mean(nits.values) == pytest.approx(RADIANCE @ PHOTOMETRIC, rel=2e-3)
    assert {f.code for f in lux.findings} >= {"lambertian"}


def test_direct_light_of_ours(box: Path, tmp_path: Path) -> None:
    exr, png = tmp_path / "ours.exr", tmp_path / "ours.png"
    COMMANDS["render"](file=box / "box.blend", output=exr, samples=64, threads=2).run()
    lux = read_map(exr, "illuminance")
    right = np.isnan(read_map(box / "cycles.exr", "illuminance").values)
    direct = np.pi * EMISSION @ PHOTOMETRIC  # the right wall sees the other five, that emit e
    seen = lux.values[right]
    assert seen.mean() == pytest.approx(direct, rel=2e-3)
    assert seen.std() < 2e-3 * direct
    assert not lux.findings
    found = COMMANDS["falsecolor"](file=exr, output=png).run().document
    assert found["percentiles"] == lux.percentiles
    assert png.read_bytes().startswith(b"\x89PNG")
