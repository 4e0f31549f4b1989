# SPDX-License-Identifier: GPL-3.0-or-later
"""`check` as it is promised, from outside."""

from __future__ import annotations

import hashlib
import html
import math
import os
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

import blender_rad  # noqa: E402
from blender_rad.exr import write_exr  # noqa: E402

from .promised import (  # noqa: E402
    HEIGHT,
    WIDTH,
    Ran,
    exr,
    inside,
    interrupted,
    layer,
    link,
    panel,
    point,
    ran,
    refused,
    save,
    scene_file,
    square,
    stage,
    strict,
    tree,
    world,
)
from .reading import CUBE  # noqa: E402

FILES = {"report.html", "report.json", "ours.exr", "cycles.exr", "difference.exr"}
NAME = "<b>'Lámp☀\" & co"
NUMBER = (int, float)
MAYBE = (int, float, type(None))
TEXT = (str, type(None))
PIXELS = dict.fromkeys(("compared", "agree", "differ", "undecided", "excluded"), int)
METRICS = dict.fromkeys(
    ("energy_ratio", "mean_signed_relative_error", "p95_absolute_relative_error", "relmse"), MAYBE
)
LIGHTS = [
    {"name": str, "type": str, "count": int, "verdict": str}
    | dict.fromkeys(("energy_fraction", "scale_in_witness", "standard_error"), MAYBE)
    | {"group": (str, int, list, type(None)), "diagnosis": (str, dict, type(None))}
]
SCENE = {"camera": str, "resolution": [int], "unit_scale_m": NUMBER}
FINDING = {"code": str, "severity": str, "object": TEXT, "message": str, "effect_percent": MAYBE}
SCHEMA: dict[str, Any] = {
    "schema": int,
    "verdict": str,
    "scene": {"file": str, "sha256": str, "frame": int, **SCENE},
    "versions": dict.fromkeys(("blender_rad", "blender", "numpy", "embree"), str),
    "settings": dict.fromkeys(("model", "shading"), str)
    | dict.fromkeys(("tolerance", "confidence", "efficacy_lm_W", "samples"), NUMBER)
    | {"cycles_samples": MAYBE, "overridden": dict},
    "pixels": PIXELS,
    "metrics": METRICS,
    "lights": LIGHTS,
    "coverage": {
        "supported_pixel_fraction": NUMBER,
        "unsupported": [{"kind": str, "name": str, "feature": str, "pixels": int}],
    },
    "findings": [FINDING],
    "witnesses": [{"verdict": str, "pixels": PIXELS, "metrics": METRICS, "lights": LIGHTS}],
    "seconds": dict.fromkeys(("read", "ours", "cycles", "compare", "report"), NUMBER),
}


def holds(value: Any, schema: Any, where: str = "report") -> None:
    """Hold a document against a schema: more keys are fine, fewer are not."""
    if isinstance(schema, dict):
        assert isinstance(value, dict), where
        assert set(schema) <= set(value), (where, set(schema) - set(value))
        for key, part in schema.items():
            holds(value[key], part, f"{where}.{key}")
    elif isinstance(schema, list):
        assert isinstance(value, list), where
        for i, part in enumerate(value):
            holds(part, schema[0], f"{where}[{i}]")
    else:
        assert isinstance(value, schema) and not (schema is int and value is True), (where, value)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("check_scenes")

    def cycles(**settings: Any) -> None:
        plain = {"pixel_filter_type": 'BOX', "use_denoising": False, "max_bounces": 0}
        for name, value in {**plain, **settings}.items():
            setattr(bpy.context.scene.cycles, name, value)

    def room() -> None:
        mesh = bpy.data.meshes.new("Room")
        corners, faces = CUBE
        mesh.from_pydata([(6 * x, 6 * y, 2.5 + 3.5 * z) for x, y, z in corners], [], faces)
        mesh.materials.append(bpy.data.materials["Floor"])
        link("Room", mesh)

    def instances() -> None:
        lamps = bpy.data.collections.new("Lamps")
        lamp = bpy.data.lights.new("Bulb", 'POINT')
        lamp.energy, lamp.shadow_soft_size = 30.0, 0.0
        lamps.objects.link(bpy.data.objects.new("Bulb", lamp))
        for x in (-1.0, 0.0, 1.0):
            empty = link(f"Empty {x}", None, (x, 0, 2))
            empty.instance_type, empty.instance_collection = 'COLLECTION', lamps

    def mirror() -> None:
        for material in bpy.data.materials:
            material.node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1,) * 4

    def moving() -> None:
        lamp = point("Key", (0, 0, 2))
        for frame, height in ((1, 2.0), (3, 1.0)):
            lamp.location.z = height
            lamp.keyframe_insert("location", frame=frame)

    def noisy() -> None:
        panel()
        for i in range(4):
            square(f"Blind {i}", 0.3, (i - 2.0, 0.1 * i, 0.6))

    builds: dict[str, tuple[Any, ...]] = {
        "two": (point, panel),
        "stronger": (partial(point, energy=102.0), panel),
        "hidden": (point, lambda: setattr(panel(), "hide_render", True)),
        "exposed": (point, panel, partial(cycles, film_exposure=2.0)),
        "clamped": (point, panel, partial(cycles, sample_clamp_direct=0.2)),
        "closed": (point, room, partial(cycles, max_bounces=4)),
        "ambient": (
            point,
            partial(world, "Black", (0.0, 0.0, 0.0)),
            partial(cycles, use_fast_gi=True, fast_gi_method='ADD'),
        ),
        "filtered": (point, panel, partial(cycles, pixel_filter_type='GAUSSIAN', filter_width=5.0)),
        "names": (partial(point, NAME), partial(world, "Himmel <i>", (0.2, 0.2, 0.2))),
        "coincident": (partial(point, "Left"), partial(point, "Right")),
        "instances": (instances,),
        "dark": (),
        "grey": (point, panel, mirror),
        "moving": (moving,),
        "noisy": (noisy,),
    }
    return {name: scene_file(folder, name, *build) for name, build in builds.items()}


@pytest.fixture(scope="session")
def two(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """Run it by itself, into a folder that holds somebody else's file."""
    folder = tmp_path_factory.mktemp("two")
    scratch = tmp_path_factory.mktemp("scratch")
    (folder / "mine.txt").write_text("mine")
    before, scenes = tree(folder), tree(files["two"].parent)
    run = ran("check", files["two"], "--report", folder, "--json", TMPDIR=str(scratch))
    assert tree(files["two"].parent) == scenes, "the user's files are as they were"
    assert tree(folder)["mine.txt"] == before["mine.txt"]
    assert not list(scratch.iterdir()), "no scratch file is left"
    return run, folder


def lights(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {light["name"]: light for light in document["lights"]}


def told(document: dict[str, Any]) -> str:
    """Return all that is said about why."""
    return str([document["findings"], [light["diagnosis"] for light in document["lights"]]])


def test_agreement(two: tuple[Ran, Path], files: dict[str, Path]) -> None:
    run, folder = two
    assert run.code == 0, run
    assert set(tree(folder)) == FILES | {"mine.txt"}
    document = run.document
    assert document == strict((folder / "report.json").read_text(encoding="utf-8"))
    holds(document, SCHEMA)
    assert (document["schema"], document["verdict"]) == (1, "agree")
    assert document["scene"]["sha256"] == hashlib.sha256(files["two"].read_bytes()).hexdigest()
    assert document["scene"]["resolution"] == [WIDTH, HEIGHT]
    assert (document["scene"]["camera"], document["scene"]["frame"]) == ("Camera", 1)
    assert document["versions"]["blender"] == bpy.app.version_string.split()[0]
    pixels = document["pixels"]
    assert pixels["compared"] == pixels["agree"] + pixels["differ"] + pixels["undecided"]
    assert pixels["compared"] + pixels["excluded"] == WIDTH * HEIGHT
    settings = document["settings"]
    assert (settings["tolerance"], settings["confidence"]) == (0.01, 0.99)
    assert (settings["model"], settings["shading"]) == ("cycles", "full")
    assert "cycles.max_bounces" in settings["overridden"]
    assert len(document["witnesses"]) == 1
    for key in ("pixels", "metrics", "lights"):
        assert document["witnesses"][0][key] == document[key]


def test_agreement_light_by_light(two: tuple[Ran, Path]) -> None:
    document = two[0].document
    assert math.isclose(document["metrics"]["energy_ratio"], 1, abs_tol=0.01)
    rows = lights(document)
    assert {(n, r["type"], r["count"]) for n, r in rows.items()} == {
        ("Key", "POINT", 1),
        ("Fill", "AREA", 1),
    }
    assert math.isclose(sum(row["energy_fraction"] for row in rows.values()), 1, rel_tol=1e-3)
    for row in rows.values():
        assert (row["verdict"], row["group"]) == ("agree", None)
        assert abs(row["scale_in_witness"] - 1) < 0.01
        assert 0 < row["standard_error"] < 0.01


def test_pictures(two: tuple[Ran, Path]) -> None:
    ours, cycles, apart = (
        layer(exr(two[1] / f"{name}.exr")[1], "") for name in ("ours", "cycles", "difference")
    )
    assert ours.shape == cycles.shape == (HEIGHT, WIDTH, 3)
    assert math.isclose(ours.mean(), cycles.mean(), rel_tol=0.01)
    assert min(np.abs(apart - (ours - cycles)).max(), np.abs(apart + ours - cycles).max()) < 1e-5


def test_names_are_kept_and_escaped(files: dict[str, Path], tmp_path: Path) -> None:
    document = blender_rad.check(files["names"], report=tmp_path, samples=32)
    rows = lights(document)
    assert set(rows) == {NAME, "World"}
    assert rows["World"]["type"] == "WORLD"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert NAME in html.unescape(page)
    assert NAME not in page
    assert NAME in lights(strict((tmp_path / "report.json").read_text("utf-8")))


def test_without_report_nothing_is_written(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = inside("check", files["two"], "--samples", 32, "--against", "cycles")
    assert run.code in (0, 3)
    assert run.out.split()[0] in ("agree", "undecided")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("witness", "light", "scale"), [("stronger", "Key", 1.02), ("hidden", "Fill", 0.0)]
)
def test_one_light_is_off(
    witness: str, light: str, scale: float, files: dict[str, Path], tmp_path: Path
) -> None:
    options = ("--witness-scene", files[witness], "--json", "--report", tmp_path)
    run = inside("check", files["two"], *options)
    assert run.code == 1, run
    rows = lights(run.document)
    row, right = rows.pop(light), *rows.values()
    assert (row["verdict"], right["verdict"]) == ("differ", "agree")
    assert abs(row["scale_in_witness"] - scale) < 4 * row["standard_error"] + 1e-3
    assert row["diagnosis"]
    assert set(tree(tmp_path)) == FILES
    assert light in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_soft_falloff_is_named(tmp_path: Path) -> None:
    def build() -> None:
        point("Soft", (0, 0, 2), radius=0.3, soft=True)

    document = blender_rad.check(scene_file(tmp_path, "soft", build), model="physical")
    assert (document["verdict"], document["settings"]["model"]) == ("differ", "physical")
    assert "soft-falloff" in told(document)
    assert any(
        finding["effect_percent"] is not None and 0.5 < abs(finding["effect_percent"]) < 5
        for finding in document["findings"]
        if "soft-falloff" in finding["code"]
    ) or "%" in str(lights(document)["Soft"]["diagnosis"])


OWN = {
    "exposed": ("film-exposure", "film exposure"),
    "clamped": ("clamp-direct", "clamp direct left on"),
    "closed": ("bounces", "bounces left on"),
    "ambient": ("fast-gi", "fast gi left on"),
    "filtered": ("pixel-filter", "pixel filter left on"),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n in ("closed", "filtered"))) for n in OWN],
)
def test_own_settings_are_named_and_explain_the_energy(files: dict[str, Path], name: str) -> None:
    document = blender_rad.check(files[name], witness_settings="file", samples=32)
    assert document["verdict"] == "differ"
    code, words = OWN[name]
    named = {f["code"]: f for f in document["findings"] if f["severity"] == "error"}
    assert words in told(document).lower().replace("-", " ")
    assert code in named, document["findings"]
    assert not set(named) & {code for code, _ in OWN.values()} - {code}, "nothing else is blamed"
    if name != "filtered":
        ours_over_theirs = document["metrics"]["energy_ratio"]
        explained = 1 + named[code]["effect_percent"] / 100
        assert math.isclose(explained * ours_over_theirs, 1, rel_tol=0.01)
    overridden = set(document["settings"]["overridden"])
    assert "render.use_compositing" in overridden
    assert not {name for name in overridden if "bounces" in name or "clamp" in name}
    if name == "exposed":
        for row in document["lights"]:
            assert math.isclose(row["scale_in_witness"], 2.0, rel_tol=0.02)


def test_clay(files: dict[str, Path]) -> None:
    full = blender_rad.check(files["two"], witness_scene=files["grey"], samples=64)
    clay = blender_rad.check(files["two"], witness_scene=files["grey"], shading="clay")
    assert (full["verdict"], clay["verdict"]) == ("differ", "agree")
    assert clay["settings"]["shading"] == "clay"


def test_nothing_emits(files: dict[str, Path]) -> None:
    run = inside("check", files["dark"], "--json")
    assert run.code == 3, run
    assert run.document["verdict"] == "undecided"
    assert run.document["findings"]
    holds(run.document, SCHEMA)


@pytest.mark.parametrize("samples", [1, 2])
def test_too_few_samples(files: dict[str, Path], samples: int) -> None:
    run = inside("check", files["noisy"], "--samples", samples, "--tolerance", 0.001, "--json")
    assert (run.code, run.document["verdict"]) == (3, "undecided"), run
    assert run.document["settings"]["samples"] == samples
    assert run.document["settings"]["cycles_samples"] == samples


@pytest.mark.parametrize(
    ("scene", "counts"), [("instances", {"Bulb": 3}), ("coincident", {"Left": 1, "Right": 1})]
)
def test_instances_are_a_row_and_coincident_lights_a_group(
    scene: str, counts: dict[str, int], files: dict[str, Path]
) -> None:
    document = blender_rad.check(files[scene], samples=32)
    assert document["verdict"] == "agree"
    assert {row["name"]: row["count"] for row in document["lights"]} == counts
    groups = {row["group"] for row in document["lights"]}
    assert len(groups) == 1
    assert (groups == {None}) == (scene == "instances")


def picture(file: Path, folder: Path, seed: int) -> Path:
    """Render direct light with Cycles alone, film exposure 2."""
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    cycles, render = scene.cycles, scene.render
    cycles.max_bounces, cycles.samples, cycles.seed = 0, 64, seed
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type, cycles.film_exposure = 'BOX', 2.0
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0.0
    render.image_settings.file_format = 'OPEN_EXR'
    render.image_settings.color_depth = '32'
    render.filepath = str(folder / f"picture{seed}.exr")
    bpy.ops.render.render(write_still=True)
    return Path(render.filepath)


@pytest.fixture(scope="session")
def pictures(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("pictures")
    return [picture(files["two"], folder, seed) for seed in (1, 2)]


def test_pictures_that_exist(files: dict[str, Path], pictures: list[Path]) -> None:
    before = tree(pictures[0].parent)
    one = inside("check", files["two"], "--render", pictures[0], "--exposure", 2, "--json")
    assert one.code == 3, one
    assert one.document["verdict"] == "undecided", "with one picture nothing is said to agree"
    wrong = inside("check", files["two"], "--render", *pictures, "--json")
    assert wrong.code == 1, wrong
    for row in wrong.document["lights"]:
        assert math.isclose(row["scale_in_witness"], 2, rel_tol=0.02)
    both = inside("check", files["two"], "--render", *pictures, "--exposure", 2, "--json")
    assert both.code in (0, 3), both
    holds(both.document, SCHEMA)
    assert tree(pictures[0].parent) == before


@pytest.mark.filterwarnings("ignore:.*related API features are not available")
def test_pictures_of_another_colour_space_in_layers(
    files: dict[str, Path], pictures: list[Path], tmp_path: Path
) -> None:
    import colour

    matrix = colour.matrix_RGB_to_RGB(*map(colour.RGB_COLOURSPACES.get, ("sRGB", "ITU-R BT.2020")))
    wide = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
    for path in pictures:
        rgb = layer(exr(path)[1], "") @ matrix.T
        names = [f"ViewLayer.Combined.{letter}" for letter in "RGB"]
        channels = dict(zip(names, np.moveaxis(rgb, -1, 0), strict=True))
        write_exr(tmp_path / path.name, channels, {"chromaticities": wide})
    taken = [tmp_path / path.name for path in pictures]
    document = blender_rad.check(files["two"], render=taken, exposure=2.0)
    assert document["verdict"] != "differ", document["findings"]
    for row in document["lights"]:
        assert math.isclose(row["scale_in_witness"], 1, rel_tol=0.01)
    assert math.isclose(document["metrics"]["energy_ratio"], 1, rel_tol=0.003)


def test_frames(files: dict[str, Path], tmp_path: Path) -> None:
    run = inside(
        "check", files["moving"], "--frames", "1-2", "--report", tmp_path, "--samples", 64, "--json"
    )
    assert run.code in (0, 3), run
    folders = {"frame_0001", "frame_0002"}
    expected = {f"{folder}/{name}" for folder in folders for name in FILES}
    assert set(tree(tmp_path)) == expected | {"report.json"}
    document = strict((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(document["frames"]) == 2
    assert run.document == document
    for number in (1, 2):
        frame = strict((tmp_path / f"frame_000{number}/report.json").read_text("utf-8"))
        holds(frame, SCHEMA)
        assert frame["scene"]["frame"] == number
    energies = [layer(exr(tmp_path / f / "ours.exr")[1], "").sum() for f in sorted(folders)]
    assert energies[1] > 1.05 * energies[0]


def test_a_witness_that_is_not_there(files: dict[str, Path]) -> None:
    refused(inside("check", files["two"], "--against", "radiance"), "radiance", "cycles")


def test_bad_pictures(files: dict[str, Path], pictures: list[Path], tmp_path: Path) -> None:
    (tmp_path / "text.exr").write_text("no picture")
    (tmp_path / "cut.exr").write_bytes(pictures[0].read_bytes()[:700])
    (tmp_path / "folder.exr").mkdir()
    before = tree(tmp_path)
    for name in ("text.exr", "cut.exr", "folder.exr"):
        refused(inside("check", files["two"], "--render", tmp_path / name), name)
    arguments = ("--render", pictures[0], "--resolution", "16x12", "--report", tmp_path / "r")
    refused(inside("check", files["two"], *arguments), pictures[0].name, f"{WIDTH}", "16")
    assert tree(tmp_path) == before
    assert not (tmp_path / "r").exists()


def test_bad_witness_scenes(files: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "text.blend").write_text("no scene")
    stage()
    bpy.context.scene.camera = None
    save(tmp_path / "blind.blend")
    for name, word in (("text.blend", "text.blend"), ("blind.blend", "camera")):
        refused(inside("check", files["two"], "--witness-scene", tmp_path / name), word)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupt_keeps_what_is_finished(files: dict[str, Path], tmp_path: Path) -> None:
    def reached() -> None:
        end = time.monotonic() + 60
        while not (tmp_path / "frame_0001/report.json").exists() and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(0.3)

    options = ("--frames", "1-50", "--samples", 16, "--json", "--report", tmp_path)
    interrupted(reached, "check", files["moving"], *options)
    left = set(tree(tmp_path))
    whole = {f"{p.parent.name}/{name}" for p in tmp_path.glob("*/report.json") for name in FILES}
    assert whole and whole <= left
    assert {path.rpartition("/")[2] for path in left} <= FILES


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupt(files: dict[str, Path], tmp_path: Path) -> None:
    options = ("--samples", 999, "--resolution", "320x240", "--json", "--report", tmp_path)
    interrupted(lambda: time.sleep(3), "check", files["noisy"], *options)
    assert not tree(tmp_path)
