# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes open, are what their scripts build, and mean what is derived there."""

import importlib
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.open import open_scene
from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.meters import LuxMeter
from blender_rad.rendering import Settings, render

SCENES = Path(__file__).parents[2] / "scenes"
NAMES = ("lecture_point", "studio", "office", "hundred")
LARGEST = 300_000
OURS, NOISE = 1e-3, 1e-3  # relative
WITNESS = 0.01


@pytest.fixture(autouse=True)
def _scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCENES))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)


def saved(name: str) -> Any:
    return open_scene(SCENES / f"{name}.blend", need_camera=True)


def built(name: str) -> Any:
    return importlib.import_module(name).build()


def summary(scene: Any) -> dict[str, Any]:
    """What stands where, of what kind, and what it emits."""
    return {
        bl.name: (
            bl.type,
            np.round(np.array(bl.matrix_world), 5).tolist(),
            len(bl.data.vertices) if bl.type == 'MESH' else None,
            round(bl.data.energy, 4) if bl.type == 'LIGHT' else None,
            [slot.material.name for slot in bl.material_slots],
        )
        for bl in scene.objects
    }


@pytest.mark.parametrize("name", NAMES)
def test_file_is_what_its_script_builds(name: str) -> None:
    assert (SCENES / f"{name}.blend").stat().st_size < LARGEST
    kept = summary(saved(name))
    built(name)
    assert kept == summary(bpy.context.scene)


@pytest.mark.parametrize("name", NAMES)
def test_engine_finds_the_answers_derived_on_paper(name: str) -> None:
    answers = built(name)
    scene = read_scene(saved(name))
    assert not scene.unsupported + scene.unknown_lights
    places, normals = np.array([(a.position, a.normal) for a in answers]).swapaxes(0, 1)
    expected = np.array([a.irradiance for a in answers])
    read = LuxMeter(scene, efficacy=1.0, error=NOISE, threads=2).read(places, normals)
    error = read.standard_error / read.illuminance
    assert (error < NOISE).all()
    assert (np.abs(read.irradiance / expected - 1.0) < OURS + 3 * error[:, None]).all()


@pytest.mark.parametrize("name", NAMES)
def test_cycles_agrees_on_the_picture(name: str) -> None:
    bl_scene = saved(name)
    ours = render(read_scene(bl_scene, resolution=(48, 32)), Settings(samples=32, threads=2))
    witness = CyclesWitness(bl_scene, resolution=(48, 32), threads=2)
    witness.prepare()
    theirs = np.mean([witness.render(seed, 16)[..., :3] for seed in range(4)], axis=0)
    lit = ~ours.seen.any(axis=2)  # the edges of what glows are all noise at so few pixels
    assert ours.radiance[lit].mean(axis=0) == pytest.approx(theirs[lit].mean(axis=0), rel=WITNESS)


def test_benchmark_has_what_it_says(tmp_path: Path) -> None:
    built("bench")
    scene = read_scene(bpy.context.scene)
    assert sum(len(mesh.triangles) for mesh in scene.meshes) == 300_000
    assert scene.resolution == (640, 480)
    assert len({light.kind for light in scene.lights}) == 4
    assert scene.unsupported == ()
