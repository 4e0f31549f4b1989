# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles as a witness: right against closed forms, seeds apart, the open scene in clay."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

from blender_rad.bpy_io.witness import CyclesWitness  # noqa: E402

HEIGHT, POWER, SIDE, VIEW = 2.0, 10.0, 32, 2.0
SYSTEMATIC = 2e-4  # of Cycles' single precision and of a pixel's curvature
SEEDS = 8


@pytest.fixture
def scene() -> Any:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bl_scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = 'ORTHO', VIEW, (0, 0, 5)
    bl_scene.collection.objects.link(camera)
    bl_scene.camera = camera
    bl_scene.render.resolution_x = bl_scene.render.resolution_y = SIDE
    bl_scene.cycles.film_exposure = 3.0
    return bl_scene


def material(name: str, build: Any) -> Any:
    made = bpy.data.materials.new(name)
    if made.node_tree is None:
        made.use_nodes = True
    made.node_tree.nodes.clear()
    output = made.node_tree.nodes.new('ShaderNodeOutputMaterial')
    closure = build(made.node_tree)
    made.node_tree.links.new(closure.outputs[0], output.inputs["Surface"])
    return made


def diffuse(albedo: float) -> Any:
    def build(tree: Any) -> Any:
        node = tree.nodes.new('ShaderNodeBsdfDiffuse')
        node.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
        return node

    return build


def plane(scene: Any, *materials: Any, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [], [(0, 1, 2, 3)])
    for each in materials:
        mesh.materials.append(each)
    made = bpy.data.objects.new("Plane", mesh)
    made.location = at
    scene.collection.objects.link(made)
    return made


def point(scene: Any, radius: float = 0.0, power: float = POWER) -> Any:
    light = bpy.data.lights.new("Point", 'POINT')
    light.energy, light.shadow_soft_size = power, radius
    made = bpy.data.objects.new("Point", light)
    made.location = (0.3, 0.2, HEIGHT)
    scene.collection.objects.link(made)
    return made


def expected(albedo: float, power: float = POWER) -> np.ndarray:
    """L = albedo/π · Φ cosθ/(4π d²), cosθ = h/d, at the middle of each pixel."""
    x = (np.arange(SIDE) + 0.5) / SIDE * VIEW - VIEW / 2
    d2 = (x[None, :] - 0.3) ** 2 + (-x[:, None] - 0.2) ** 2 + HEIGHT**2
    return albedo / math.pi * power * HEIGHT / (4 * math.pi * d2**1.5)


def pictures(scene: Any, seeds: range, samples: int, **options: Any) -> np.ndarray:
    witness = CyclesWitness(scene, threads=1, **options)
    witness.prepare()
    return np.array([witness.render(seed, samples) for seed in seeds], dtype=np.float64)


def test_point_over_lambert_is_the_closed_form_and_top_is_up(scene: Any) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    point(scene)
    seen = pictures(scene, range(SEEDS), 16)[..., :3]
    error = seen.std(axis=0, ddof=1) / math.sqrt(SEEDS)
    off = np.abs(seen.mean(axis=0) - expected(0.5)[..., None])
    assert np.mean(off < 3 * error + SYSTEMATIC * expected(0.5)[..., None]) > 0.98
    assert seen.mean() == pytest.approx(expected(0.5).mean(), rel=SYSTEMATIC)


def test_seeds_differ_and_each_is_itself_whatever_came_before(scene: Any) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    point(scene, radius=0.5)
    seeds = pictures(scene, range(SEEDS), 4)[..., 0]
    assert len({picture.tobytes() for picture in seeds}) == SEEDS
    scene.render.use_persistent_data = False
    np.testing.assert_array_equal(CyclesWitness(scene).render(3, 4)[..., 0], seeds[3])
    deviations = (seeds - seeds.mean(axis=0)).reshape(SEEDS, -1)
    correlation = np.corrcoef(deviations)[~np.eye(SEEDS, dtype=bool)]
    assert np.mean(correlation) == pytest.approx(-1 / (SEEDS - 1), abs=0.02)


def test_light_changed_between_pictures_is_seen(scene: Any) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    lamp = point(scene)
    witness = CyclesWitness(scene, threads=1)
    witness.prepare()
    before = witness.render(0, 4)
    lamp.data.energy *= 2
    np.testing.assert_allclose(witness.render(0, 4)[..., 0], 2 * before[..., 0], rtol=1e-5)


def test_overrides_are_recorded_and_file_settings_kept(scene: Any) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    point(scene)
    scene.cycles.use_denoising, scene.cycles.pixel_filter_type = False, 'BOX'
    witness = CyclesWitness(scene, resolution=(8, 6), settings="file", threads=1)
    witness.prepare()
    assert "cycles.film_exposure" not in witness.overridden
    assert witness.overridden["render.resolution_x"] == (SIDE, 8)
    kept = witness.render(0, 16)
    assert kept.shape == (6, 8, 4)
    reference = CyclesWitness(scene, threads=1)
    reference.prepare()
    assert reference.overridden["cycles.film_exposure"] == (3.0, 1.0)
    assert reference.overridden["cycles.max_bounces"] == (12, 0)
    unbiased = reference.render(0, 16)[..., 0].mean()
    assert kept[..., 0].mean() == pytest.approx(3 * unbiased, rel=SYSTEMATIC)


def test_border_leaves_the_rest_black(scene: Any) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    point(scene)
    scene.render.use_border, scene.render.use_crop_to_border = True, True
    scene.render.border_min_x, scene.render.border_max_y = 0.5, 0.25
    seen = pictures(scene, range(1), 4)[0]
    assert seen.shape == (SIDE, SIDE, 4)
    lit = seen[..., 0] > 0
    assert lit[SIDE * 3 // 4 :, SIDE // 2 :].all()
    assert lit.sum() == SIDE * SIDE // 8


def test_clay_turns_glass_bare_and_object_slots(scene: Any) -> None:
    glass = material("Glass", lambda tree: tree.nodes.new('ShaderNodeBsdfGlass'))
    point(scene)
    for slots in ((glass,), (None,), ()):
        made = plane(scene, *slots)
        seen = pictures(scene, range(4), 16, shading="clay")[..., :3]
        assert seen.mean() == pytest.approx(expected(0.8).mean(), rel=SYSTEMATIC)
        bpy.data.objects.remove(made)


def test_clay_keeps_emission_beside_reflection(scene: Any) -> None:
    def build(tree: Any) -> Any:
        node = tree.nodes.new('ShaderNodeBsdfPrincipled')
        node.inputs["Emission Strength"].default_value = 2.0
        node.inputs["Emission Color"].default_value = (0.5, 1, 0, 1)
        return node

    plane(scene, material("Glowing", build))
    point(scene)
    seen = pictures(scene, range(4), 16, shading="clay")[..., :3].mean(axis=(0, 1, 2))
    assert seen == pytest.approx(expected(0.8).mean() + np.array([1, 2, 0]), rel=SYSTEMATIC)


def test_clay_leaves_pure_emitters_black_to_light(scene: Any) -> None:
    def build(tree: Any) -> Any:
        node = tree.nodes.new('ShaderNodeEmission')
        node.inputs["Strength"].default_value = 0.5
        return node

    plane(scene, material("Lamp", build))
    point(scene)
    assert pictures(scene, range(1), 4, shading="clay")[..., :3] == pytest.approx(0.5)


def test_progress_is_told_and_nothing_stays_behind(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    plane(scene, material("Grey", diffuse(0.5)))
    point(scene)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    told: list[float] = []
    witness = CyclesWitness(scene, threads=1)
    witness.prepare()
    capfd.readouterr()
    witness.render(0, 8, told.append)
    assert told[-1] == 1.0
    assert told == sorted(told)
    assert not list(tmp_path.iterdir())
    assert not bpy.app.handlers.render_stats
    assert capfd.readouterr().out == ""


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to a single process there")
def test_interrupt_while_rendering_is_not_swallowed(tmp_path: Path) -> None:
    work = """
        import bpy, os, signal, threading
        from blender_rad.bpy_io.witness import CyclesWitness
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        scene = bpy.context.scene
        scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(scene.camera)
        witness = CyclesWitness(scene, resolution=(64, 64), threads=1)
        witness.prepare()
        def press(done):
            os.kill(os.getpid(), signal.SIGINT)
        try:
            witness.render(0, 8, press)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
            raise SystemExit(130)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(work)],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert (done.returncode, done.stdout) == (130, "interrupted\n"), done.stderr
    assert not list(tmp_path.iterdir())
