# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles as a witness: right against closed forms, seeds apart, the open scene in clay."""

import math
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.witness import CyclesWitness

from .promised import python
from .reading import add, camera, empty_scene, light, material, polygons

HEIGHT, POWER, SIDE, VIEW, FINE = 2.0, 10.0, 32, 2.0, 4
CORNERS = [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)]
SYSTEMATIC = 2e-4  # of Cycles' single precision
SEEDS = 8


@pytest.fixture
def scene() -> Any:
    """A camera above a grey plane under a lamp."""
    bl_scene = empty_scene()
    camera(type='ORTHO', ortho_scale=VIEW, location=(0, 0, 5), rotation_euler=(0, 0, 0))
    bl_scene.render.resolution_x = bl_scene.render.resolution_y = SIDE
    bl_scene.cycles.film_exposure = 3.0
    grey = material("Grey", "BsdfDiffuse", Color=(0.5,) * 3)
    add("Plane", polygons("Plane", CORNERS, [(0, 1, 2, 3)], grey))
    light('POINT', energy=POWER, shadow_soft_size=0.0, location=(0.3, 0.2, HEIGHT))
    return bl_scene


def expected(albedo: float) -> np.ndarray:
    """L = albedo/π · Φ cosθ/(4π d²), cosθ = h/d, the mean of `FINE`² points of each pixel."""
    x = (np.arange(SIDE * FINE) + 0.5) / (SIDE * FINE) * VIEW - VIEW / 2
    d2 = (x[None, :] - 0.3) ** 2 + (-x[:, None] - 0.2) ** 2 + HEIGHT**2
    radiance = albedo / math.pi * POWER * HEIGHT / (4 * math.pi * d2**1.5)
    return radiance.reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))


def prepared(scene: Any, **options: Any) -> CyclesWitness:
    witness = CyclesWitness(scene, threads=1, **options)
    witness.prepare()
    return witness


def pictures(scene: Any, seeds: int, samples: int, **options: Any) -> np.ndarray:
    witness = prepared(scene, **options)
    return np.array([witness.render(s, samples)[..., :3] for s in range(seeds)], dtype=np.float64)


def test_point_over_lambert_is_the_closed_form_and_top_is_up(scene: Any) -> None:
    seen = pictures(scene, SEEDS, 16)
    error = seen.std(axis=0, ddof=1) / math.sqrt(SEEDS)
    off = np.abs(seen.mean(axis=0) - expected(0.5)[..., None])
    assert np.mean(off < 3 * error + SYSTEMATIC * expected(0.5)[..., None]) > 0.98
    assert seen.mean() == pytest.approx(expected(0.5).mean(), rel=SYSTEMATIC)


def test_seeds_differ_and_each_is_itself_whatever_came_before(scene: Any) -> None:
    bpy.data.lights[0].shadow_soft_size = 0.5
    seeds = pictures(scene, SEEDS, 4)[..., 0]
    assert len({picture.tobytes() for picture in seeds}) == SEEDS
    scene.render.use_persistent_data = False
    np.testing.assert_array_equal(CyclesWitness(scene).render(3, 4)[..., 0], seeds[3])
    deviations = (seeds - seeds.mean(axis=0)).reshape(SEEDS, -1)
    correlation = np.corrcoef(deviations)[~np.eye(SEEDS, dtype=bool)]
    assert np.mean(correlation) == pytest.approx(-1 / (SEEDS - 1), abs=0.02)


def test_no_sample_is_bound_to_the_middle_of_its_pixel(scene: Any) -> None:
    """The plane ends a quarter into a column of pixels: Cycles' very first samples all miss it."""
    bpy.data.objects["Plane"].location.x = 0.25 * VIEW / SIDE - 4
    seen = pictures(scene, SEEDS, 2).mean(axis=(0, 1, 3))
    assert seen[SIDE // 2] / seen[SIDE // 2 - 1] == pytest.approx(0.25, abs=0.04)


def test_light_changed_between_pictures_is_seen(scene: Any) -> None:
    witness = prepared(scene)
    before = witness.render(0, 4)
    bpy.data.lights[0].energy *= 2
    np.testing.assert_allclose(witness.render(0, 4)[..., 0], 2 * before[..., 0], rtol=1e-5)


def test_overrides_are_recorded_and_file_settings_kept(scene: Any) -> None:
    scene.cycles.use_denoising, scene.cycles.pixel_filter_type = False, 'BOX'
    witness = prepared(scene, resolution=(8, 6), settings="file")
    assert "cycles.film_exposure" not in witness.overridden
    assert witness.overridden["render.resolution_x"] == (SIDE, 8)
    kept = witness.render(0, 16)
    assert kept.shape == (6, 8, 4)
    reference = prepared(scene)
    assert reference.overridden["cycles.film_exposure"] == (3.0, 1.0)
    assert reference.overridden["cycles.max_bounces"] == (12, 0)
    unbiased = reference.render(0, 16)[..., 0].mean()
    assert kept[..., 0].mean() == pytest.approx(3 * unbiased, rel=SYSTEMATIC)


GLOWING = {"Emission_Strength": 2.0, "Emission_Color": (0.5, 1, 0)}
CLAY: dict[str, tuple[tuple[Any, ...], float, Any]] = {  # slots, albedo, what is emitted
    "glass": (("BsdfGlass", {}), 0.8, 0.0),
    "empty slot": ((None,), 0.8, 0.0),
    "no slots": ((), 0.8, 0.0),
    "emission beside reflection": (("BsdfPrincipled", GLOWING), 0.8, (1, 2, 0)),
    "pure emission": (("Emission", {"Strength": 0.5}), 0.0, 0.5),
}


@pytest.mark.parametrize("name", CLAY)
def test_clay(scene: Any, name: str) -> None:
    slots, albedo, emitted = CLAY[name]
    materials = bpy.data.meshes[0].materials
    materials.clear()
    if slots:
        materials.append(slots[0] and material("M", slots[0], **slots[1]))
    seen = pictures(scene, 4, 16, shading="clay").mean(axis=(0, 1, 2))
    wanted = expected(albedo).mean() + np.broadcast_to(emitted, 3)
    assert seen == pytest.approx(wanted, rel=SYSTEMATIC)


def test_progress_is_told_and_nothing_stays_behind(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    told: list[float] = []
    witness = prepared(scene)
    capfd.readouterr()
    witness.render(0, 8, told.append)
    assert told[-1] == 1.0 and told == sorted(told)
    assert not list(tmp_path.iterdir())
    assert not bpy.app.handlers.render_stats
    assert capfd.readouterr().out == ""


INTERRUPTED = """
import os, signal
from tests.blender.test_witness import camera, empty_scene, prepared
scene = empty_scene()
camera()
try:
    prepared(scene, resolution=(64, 64)).render(0, 8, lambda _: os.kill(os.getpid(), signal.SIGINT))
except KeyboardInterrupt:
    raise SystemExit(130)
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to a single process there")
def test_interrupt_while_rendering_is_not_swallowed(tmp_path: Path) -> None:
    done = python("-c", INTERRUPTED, TMPDIR=str(tmp_path))
    assert (done.code, done.out) == (130, ""), done.err
    assert not list(tmp_path.iterdir())
