# SPDX-License-Identifier: GPL-3.0-or-later
"""`check` as it is promised, from outside."""

from __future__ import annotations

import hashlib
import math
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

import blender_rad  # noqa: E402

from .promised import (  # noqa: E402
    HEIGHT,
    ROOT,
    WIDTH,
    Ran,
    command,
    exr,
    inside,
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
    {
        "name": str,
        "type": str,
        "count": int,
        "group": (str, int, list, type(None)),
        "energy_fraction": MAYBE,
        "scale_in_witness": MAYBE,
        "standard_error": MAYBE,
        "verdict": str,
        "diagnosis": (str, dict, type(None)),
    }
]
SCHEMA: dict[str, Any] = {
    "schema": int,
    "verdict": str,
    "scene": {
        "file": str,
        "sha256": str,
        "frame": int,
        "camera": str,
        "resolution": [int],
        "unit_scale_m": NUMBER,
    },
    "versions": dict.fromkeys(("blender_rad", "blender", "numpy", "embree"), str),
    "settings": {
        "tolerance": NUMBER,
        "confidence": NUMBER,
        "model": str,
        "shading": str,
        "efficacy_lm_W": NUMBER,
        "samples": NUMBER,
        "cycles_samples": MAYBE,
        "overridden": dict,
    },
    "pixels": PIXELS,
    "metrics": METRICS,
    "lights": LIGHTS,
    "coverage": {
        "supported_pixel_fraction": NUMBER,
        "unsupported": [{"kind": str, "name": str, "feature": str, "pixels": int}],
    },
    "findings": [
        {"code": str, "severity": str, "object": TEXT, "message": str, "effect_percent": MAYBE}
    ],
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
    scene: Callable[[], Any] = lambda: bpy.context.scene  # noqa: E731

    def stronger() -> None:
        point(energy=102.0)
        panel()

    def hidden() -> None:
        point()
        panel().hide_render = True

    def exposed() -> None:
        scene().cycles.film_exposure = 2.0
        scene().cycles.pixel_filter_type = 'BOX'

    def clamped() -> None:
        scene().cycles.sample_clamp_direct = 0.2
        scene().cycles.pixel_filter_type = 'BOX'

    def names() -> None:
        point(NAME)
        world("Himmel <i>", (0.2, 0.2, 0.2))

    def coincident() -> None:
        point("Left")
        point("Right")

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
        "stronger": (stronger,),
        "hidden": (hidden,),
        "exposed": (point, panel, exposed),
        "clamped": (point, panel, clamped),
        "names": (names,),
        "coincident": (coincident,),
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


def test_settings_that_were_overridden_are_listed(two: tuple[Ran, Path]) -> None:
    settings = two[0].document["settings"]
    assert (settings["tolerance"], settings["confidence"]) == (0.01, 0.99)
    assert (settings["model"], settings["shading"]) == ("cycles", "full")
    assert "cycles.max_bounces" in settings["overridden"]


def test_pictures(two: tuple[Ran, Path]) -> None:
    ours, cycles, apart = (
        layer(exr(two[1] / f"{name}.exr")[1], "") for name in ("ours", "cycles", "difference")
    )
    assert ours.shape == cycles.shape == (HEIGHT, WIDTH, 3)
    assert math.isclose(ours.mean(), cycles.mean(), rel_tol=0.01)
    assert min(np.abs(apart - (ours - cycles)).max(), np.abs(apart + ours - cycles).max()) < 1e-5


class Remote(HTMLParser):
    """Gathers what a page loads, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "srcset", "data", "poster") or (tag == "link" and name == "href"):
                self.loads.append(value or "")

    def handle_data(self, data: str) -> None:
        self.text += data


def test_report_is_one_file(two: tuple[Ran, Path]) -> None:
    text = (two[1] / "report.html").read_text(encoding="utf-8")
    page = Remote()
    page.feed(text)
    assert all(load.startswith("data:") for load in page.loads)
    assert not re.search(r"url\((?!['\"]?data:)|@import", text)
    assert "Key" in page.text and "Fill" in page.text


def test_names_are_kept_and_escaped(files: dict[str, Path], tmp_path: Path) -> None:
    document = blender_rad.check(files["names"], report=tmp_path / "made", samples=32)
    rows = lights(document)
    assert set(rows) == {NAME, "World"}
    assert rows["World"]["type"] == "WORLD"
    page = Remote()
    text = (tmp_path / "made" / "report.html").read_text(encoding="utf-8")
    page.feed(text)
    assert NAME in page.text
    assert NAME not in text
    assert NAME in lights(strict((tmp_path / "made" / "report.json").read_text("utf-8")))


def test_without_report_nothing_is_written(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = inside("check", files["two"], "--samples", 32)
    assert run.code in (0, 3)
    assert run.out.split()[0] in ("agree", "undecided")
    assert not list(tmp_path.iterdir())


def test_one_light_is_two_percent_stronger(files: dict[str, Path], tmp_path: Path) -> None:
    run = inside(
        "check", files["two"], "--witness-scene", files["stronger"], "--json", "--report", tmp_path
    )
    assert run.code == 1, run
    rows = lights(run.document)
    key, fill = rows["Key"], rows["Fill"]
    assert (key["verdict"], fill["verdict"]) == ("differ", "agree")
    assert abs(key["scale_in_witness"] - 1.02) < 4 * key["standard_error"] + 1e-3
    assert key["diagnosis"]
    assert set(tree(tmp_path)) == FILES
    assert "Key" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_light_hidden_on_one_side(files: dict[str, Path]) -> None:
    document = blender_rad.check(files["two"], witness_scene=files["hidden"])
    assert document["verdict"] == "differ"
    fill = lights(document)["Fill"]
    assert fill["verdict"] == "differ"
    assert abs(fill["scale_in_witness"]) < 0.02
    assert fill["diagnosis"]
    assert lights(document)["Key"]["verdict"] == "agree"


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


@pytest.mark.parametrize(
    ("name", "word", "factor"), [("exposed", "exposure", 2.0), ("clamped", "clamp", None)]
)
def test_own_settings_are_named(
    files: dict[str, Path], name: str, word: str, factor: float | None
) -> None:
    document = blender_rad.check(files[name], witness_settings="file", samples=64)
    assert document["verdict"] == "differ"
    assert word in told(document).lower()
    if factor:
        for row in document["lights"]:
            assert math.isclose(row["scale_in_witness"], factor, rel_tol=0.02)


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


def test_instances_are_one_row(files: dict[str, Path]) -> None:
    document = blender_rad.check(files["instances"], samples=32)
    assert [(x["name"], x["count"]) for x in document["lights"]] == [("Bulb", 3)]
    assert document["verdict"] == "agree"


def test_coincident_lights_are_a_group(files: dict[str, Path]) -> None:
    document = blender_rad.check(files["coincident"], samples=32)
    groups = {row["name"]: row["group"] for row in document["lights"]}
    assert set(groups) == {"Left", "Right"}
    assert groups["Left"] == groups["Right"] is not None
    assert document["verdict"] == "agree"


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


def test_against_what_is_there(files: dict[str, Path], tmp_path: Path) -> None:
    assert inside("check", files["two"], "--against", "cycles", "--samples", 16).code in (0, 3)
    refused(inside("check", files["two"], "--against", "oracle"), "oracle", "cycles")
    refused(inside("check", files["two"], "--against", ""), "--against")


BAD: dict[str, tuple[list[str], tuple[str, ...]]] = {
    "tolerance_zero": (["--tolerance", "0"], ("--tolerance",)),
    "tolerance_nan": (["--tolerance", "nan"], ("--tolerance",)),
    "tolerance_minus": (["--tolerance=-1"], ("--tolerance",)),
    "tolerance_inf": (["--tolerance", "inf"], ("--tolerance",)),
    "tolerance_word": (["--tolerance", "tight"], ("--tolerance",)),
    "confidence_one": (["--confidence", "1"], ("--confidence",)),
    "confidence_zero": (["--confidence", "0"], ("--confidence",)),
    "confidence_more": (["--confidence", "99"], ("--confidence",)),
    "exposure_zero": (["--exposure", "0"], ("--exposure",)),
    "exposure_minus": (["--exposure=-2"], ("--exposure",)),
    "samples_zero": (["--samples", "0"], ("--samples",)),
    "threads_zero": (["--threads", "0"], ("--threads",)),
    "frames_back": (["--frames", "5-1"], ("--frames",)),
    "frames_word": (["--frames", "all"], ("--frames",)),
    "frames_open": (["--frames", "1-"], ("--frames",)),
    "frames_late": (["--frames", "1-2000000"], ()),
    "witness_settings": (["--witness-settings", "mine"], ("reference", "file")),
    "witness_scene": (["--witness-scene", "nowhere.blend"], ("nowhere.blend",)),
    "shading": (["--shading", "wet"], ("full", "clay")),
    "model": (["--model", "blue"], ("cycles", "physical")),
    "resolution": (["--resolution", "0x4"], ("--resolution",)),
    "camera": (["--camera", "Nobody"], ("Nobody", "Camera")),
    "scene": (["--scene", "Nowhere"], ("Nowhere", "Scene")),
    "layer": (["--view-layer", "None"], ("None", "ViewLayer")),
    "frame": (["--frame", "1048575"], ()),
    "render": (["--render", "nowhere.exr"], ("nowhere.exr",)),
    "render_none": (["--render"], ("--render",)),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_options(case: str, files: dict[str, Path], tmp_path: Path) -> None:
    options, named = BAD[case]
    refused(inside("check", files["two"], "--report", tmp_path / "report", *options), *named)
    assert not list(tmp_path.iterdir())


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


def test_bad_reports(files: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    before = tree(tmp_path)
    for bad in ("file", "file/below", "/proc/nowhere", 300 * "x"):
        refused(inside("check", files["two"], "--report", tmp_path / bad, "--samples", 1), bad)
    assert tree(tmp_path) == before


def test_bad_witness_scenes(files: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "text.blend").write_text("no scene")
    stage()
    bpy.context.scene.camera = None
    save(tmp_path / "blind.blend")
    for name, word in (("text.blend", "text.blend"), ("blind.blend", "camera")):
        refused(inside("check", files["two"], "--witness-scene", tmp_path / name), word)


def test_json_alone_on_stdout_though_blender_chatters(tmp_path: Path) -> None:
    stage()
    library = save(tmp_path / "library.blend")
    stage()
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.meshes = list(there.meshes)
    assert link("Lost", bpy.data.meshes[-1]).data.library
    point()
    file = save(tmp_path / "chatty.blend")
    library.unlink()
    run = ran("check", file, "--samples", 4, "--json", "-vv")
    assert run.code in (0, 3), run
    holds(run.document, SCHEMA)


def started(*arguments: object, scratch: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(*arguments),
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(scratch)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
    )


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupt_keeps_what_is_finished(files: dict[str, Path], tmp_path: Path) -> None:
    scratch, report = tmp_path / "scratch", tmp_path / "report"
    scratch.mkdir()
    process = started(
        *("check", files["moving"], "--frames", "1-50", "--samples", 16, "--json"),
        *("--report", report),
        scratch=scratch,
    )
    finished = time.monotonic() + 60
    while not (report / "frame_0001/report.json").exists() and time.monotonic() < finished:
        time.sleep(0.05)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, ""), err
    assert "Traceback" not in err
    assert not list(scratch.iterdir())
    left = set(tree(report))
    whole = {f"{path.parent.name}/{n}" for path in report.glob("*/report.json") for n in FILES}
    assert whole <= left
    assert {path.rpartition("/")[2] for path in left} <= FILES


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupt(files: dict[str, Path], tmp_path: Path) -> None:
    scratch, report = tmp_path / "scratch", tmp_path / "report"
    scratch.mkdir()
    arguments = ("check", files["noisy"], "--samples", 999, "--resolution", "320x240", "--json")
    process = started(*arguments, "--report", report, scratch=scratch)
    time.sleep(4)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, ""), err
    assert "Traceback" not in err
    assert not list(scratch.iterdir())
    assert not report.exists() or not tree(report)


def test_a_picture_is_not_overwritten_by_its_own_report(
    files: dict[str, Path], tmp_path: Path
) -> None:
    picture = tmp_path / "cycles.exr"
    picture.write_bytes(b"precious")
    run = inside("check", files["noisy"], "--render", picture, "--report", tmp_path)
    assert run.code == 2, run
    assert picture.read_bytes() == b"precious"
