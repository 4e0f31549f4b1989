# SPDX-License-Identifier: GPL-3.0-or-later
"""`check` as it is promised, from outside."""

import hashlib
import html
import math
import os
import time
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import blender_rad
from blender_rad.exr import write_exr

from .agreement import cases
from .promised import (
    HEIGHT,
    WIDTH,
    Ran,
    exr,
    inside,
    interrupted,
    layer,
    panel,
    point,
    ran,
    refused,
    scene_file,
    sky,
    square,
    strict,
    tree,
)
from .reading import CUBE, add, instanced, light, polygons, put

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


def cycles(**settings: Any) -> None:
    plain = {"pixel_filter_type": 'BOX', "use_denoising": False, "max_bounces": 0}
    put(bpy.context.scene.cycles, **{**plain, **settings})


def room() -> None:
    corners, faces = CUBE
    corners = [(6 * x, 6 * y, 2.5 + 3.5 * z) for x, y, z in corners]
    add("Room", polygons("Room", corners, faces, bpy.data.materials["Floor"]))


def instances() -> None:
    bulb = light('POINT', "Bulb", energy=30.0, shadow_soft_size=0.0)
    instanced([(x, 0, 2) for x in (-1.0, 0.0, 1.0)], bulb)


def grey() -> None:
    for material in bpy.data.materials:
        material.node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1,) * 4


def moving() -> None:
    lamp = point("Key", (0, 0, 2))
    for frame, height in ((1, 2.0), (3, 1.0)):
        lamp.location.z = height
        lamp.keyframe_insert("location", frame=frame)


def blinds() -> None:
    for i in range(4):
        square(f"Blind {i}", 0.3, (i - 2.0, 0.1 * i, 0.6))


SCENES: dict[str, tuple[Any, ...]] = {
    "two": (point, panel),
    "stronger": (partial(point, energy=102.0), panel),
    "hidden": (point, partial(panel, hide_render=True)),
    "exposed": (point, panel, partial(cycles, film_exposure=2.0)),
    "clamped": (point, panel, partial(cycles, sample_clamp_direct=0.2)),
    "closed": (point, room, partial(cycles, max_bounces=4)),
    "ambient": (
        point,
        partial(sky, "Black", (0.0, 0.0, 0.0)),
        partial(cycles, use_fast_gi=True, fast_gi_method='ADD'),
    ),
    "filtered": (point, panel, partial(cycles, pixel_filter_type='GAUSSIAN', filter_width=5.0)),
    "names": (partial(point, NAME), partial(sky, "Himmel <i>", (0.2, 0.2, 0.2))),
    "coincident": (partial(point, "Left"), partial(point, "Right")),
    "instances": (instances,),
    "dark": (),
    "grey": (point, panel, grey),
    "moving": (moving,),
    "noisy": (panel, blinds),
    "soft": (partial(point, "Soft", (0, 0, 2), radius=0.3, soft=True),),
    "blind": (lambda: put(bpy.context.scene, camera=None),),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("check_scenes")
    return {name: scene_file(folder, name, *build) for name, build in SCENES.items()}


@pytest.fixture(scope="module")
def two(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """Run it by itself, into a folder that holds somebody else's file."""
    folder, scratch = tmp_path_factory.mktemp("two"), tmp_path_factory.mktemp("scratch")
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
    return str([document["findings"], [light["diagnosis"] for light in document["lights"]]])


def written(path: Path) -> dict[str, Any]:
    return strict((path / "report.json").read_text(encoding="utf-8"))


def test_agreement(two: tuple[Ran, Path], files: dict[str, Path]) -> None:
    run, folder = two
    assert run.code == 0, run
    assert set(tree(folder)) == FILES | {"mine.txt"}
    document = run.document
    assert document == written(folder)
    holds(document, SCHEMA)
    assert (document["schema"], document["verdict"]) == (1, "agree")
    scene = {"camera": "Camera", "frame": 1, "resolution": [WIDTH, HEIGHT]}
    scene["sha256"] = hashlib.sha256(files["two"].read_bytes()).hexdigest()
    assert document["scene"].items() >= scene.items()
    assert document["versions"]["blender"] == bpy.app.version_string.split()[0]
    pixels, settings = document["pixels"], document["settings"]
    assert pixels["compared"] == pixels["agree"] + pixels["differ"] + pixels["undecided"]
    assert pixels["compared"] + pixels["excluded"] == WIDTH * HEIGHT
    defaults = {"tolerance": 0.01, "confidence": 0.99, "model": "cycles", "shading": "full"}
    assert settings.items() >= defaults.items()
    assert "cycles.max_bounces" in settings["overridden"]
    (witness,) = document["witnesses"]
    assert all(witness[key] == document[key] for key in ("pixels", "metrics", "lights"))


def test_agreement_light_by_light(two: tuple[Ran, Path]) -> None:
    document = two[0].document
    assert math.isclose(document["metrics"]["energy_ratio"], 1, abs_tol=0.01)
    rows = lights(document)
    kinds = {(n, r["type"], r["count"]) for n, r in rows.items()}
    assert kinds == {("Key", "POINT", 1), ("Fill", "AREA", 1)}
    assert math.isclose(sum(row["energy_fraction"] for row in rows.values()), 1, rel_tol=1e-3)
    for row in rows.values():
        assert (row["verdict"], row["group"]) == ("agree", None)
        assert abs(row["scale_in_witness"] - 1) < 0.01
        assert 0 < row["standard_error"] < 0.01


def test_pictures(two: tuple[Ran, Path]) -> None:
    names = ("ours", "cycles", "difference")
    ours, theirs, apart = (layer(exr(two[1] / f"{name}.exr")[1], "") for name in names)
    assert ours.shape == theirs.shape == (HEIGHT, WIDTH, 3)
    assert math.isclose(ours.mean(), theirs.mean(), rel_tol=0.01)
    assert min(np.abs(apart - (ours - theirs)).max(), np.abs(apart + ours - theirs).max()) < 1e-5


def test_names_are_kept_and_escaped(files: dict[str, Path], tmp_path: Path) -> None:
    document = blender_rad.check(files["names"], report=tmp_path, samples=32)
    rows = lights(document)
    assert set(rows) == {NAME, "World"}
    assert rows["World"]["type"] == "WORLD"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert NAME in html.unescape(page) and NAME not in page
    assert NAME in lights(written(tmp_path))


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


def test_soft_falloff_is_named(files: dict[str, Path]) -> None:
    document = blender_rad.check(files["soft"], model="physical")
    assert (document["verdict"], document["settings"]["model"]) == ("differ", "physical")
    assert "soft-falloff" in told(document)
    effects = [f["effect_percent"] for f in document["findings"] if "soft-falloff" in f["code"]]
    diagnosis = str(lights(document)["Soft"]["diagnosis"])
    assert any(e is not None and 0.5 < abs(e) < 5 for e in effects) or "%" in diagnosis


OWN = {
    "exposed": ("film-exposure", "film exposure"),
    "clamped": ("clamp-direct", "clamp direct left on"),
    "closed": ("bounces", "bounces left on"),
    "ambient": ("fast-gi", "fast gi left on"),
    "filtered": ("pixel-filter", "pixel filter left on"),
}


@pytest.mark.parametrize("name", cases(OWN, ("exposed", "clamped", "ambient")))
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
    scales = [row["scale_in_witness"] for row in document["lights"]]
    assert name != "exposed" or scales == pytest.approx([2.0, 2.0], rel=0.02)


def test_clay(files: dict[str, Path]) -> None:
    full = blender_rad.check(files["two"], witness_scene=files["grey"], samples=64)
    clay = blender_rad.check(files["two"], witness_scene=files["grey"], shading="clay")
    assert (full["verdict"], clay["verdict"]) == ("differ", "agree")
    assert clay["settings"]["shading"] == "clay"


FEW = ("noisy", "--tolerance", 0.001, "--samples")


@pytest.mark.parametrize("words", [("dark",), (*FEW, 1), (*FEW, 2)])
def test_undecided_where_nothing_emits_or_is_sampled(
    words: tuple[Any, ...], files: dict[str, Path]
) -> None:
    run = inside("check", files[words[0]], *words[1:], "--json")
    assert (run.code, run.document["verdict"]) == (3, "undecided"), run
    holds(run.document, SCHEMA)
    if words == ("dark",):
        assert run.document["findings"]
    else:
        taken = {run.document["settings"][key] for key in ("samples", "cycles_samples")}
        assert taken == {words[-1]}


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


@pytest.fixture(scope="module")
def pictures(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Direct light by Cycles alone, film exposure 2."""
    folder, found = tmp_path_factory.mktemp("pictures"), []
    bpy.ops.wm.open_mainfile(filepath=str(files["two"]))
    render = bpy.context.scene.render
    cycles(film_exposure=2.0, samples=64, use_adaptive_sampling=False, sample_clamp_indirect=0.0)
    put(render.image_settings, file_format='OPEN_EXR', color_depth='32')
    for seed in (1, 2):
        bpy.context.scene.cycles.seed = seed
        found.append(folder / f"picture{seed}.exr")
        render.filepath = str(found[-1])
        bpy.ops.render.render(write_still=True)
    return found


def test_pictures_that_exist(files: dict[str, Path], pictures: list[Path]) -> None:
    before = tree(pictures[0].parent)
    one = inside("check", files["two"], "--render", pictures[0], "--exposure", 2, "--json")
    assert one.code == 3, one
    assert one.document["verdict"] == "undecided", "with one picture nothing is said to agree"
    wrong = inside("check", files["two"], "--render", *pictures, "--json")
    assert wrong.code == 1, wrong
    scales = [row["scale_in_witness"] for row in wrong.document["lights"]]
    assert scales == pytest.approx([2.0, 2.0], rel=0.02)
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
    scales = [row["scale_in_witness"] for row in document["lights"]]
    assert scales == pytest.approx([1.0, 1.0], rel=0.01)
    assert math.isclose(document["metrics"]["energy_ratio"], 1, rel_tol=0.003)


def test_frames(files: dict[str, Path], tmp_path: Path) -> None:
    options = ("--frames", "1-2", "--report", tmp_path, "--samples", 64, "--json")
    run = inside("check", files["moving"], *options)
    assert run.code in (0, 3), run
    folders = [f"frame_000{number}" for number in (1, 2)]
    expected = {f"{folder}/{name}" for folder in folders for name in FILES}
    assert set(tree(tmp_path)) == expected | {"report.json"}
    document = written(tmp_path)
    assert len(document["frames"]) == 2 and run.document == document
    for number, folder in enumerate(folders, 1):
        frame = written(tmp_path / folder)
        holds(frame, SCHEMA)
        assert frame["scene"]["frame"] == number
    energies = [layer(exr(tmp_path / f / "ours.exr")[1], "").sum() for f in folders]
    assert energies[1] > 1.05 * energies[0]


BAD = {
    "--against radiance": ("radiance", "cycles"),
    "--render text.exr": ("text.exr",),
    "--render cut.exr": ("cut.exr",),
    "--render folder.exr": ("folder.exr",),
    "--render whole.exr --resolution 16x12": ("whole.exr", f"{WIDTH}", "16"),
    "--witness-scene text.blend": ("text.blend",),
    "--witness-scene blind.blend": ("camera",),
}


@pytest.mark.parametrize("words", BAD)
def test_bad_witnesses(
    words: str, files: dict[str, Path], pictures: list[Path], tmp_path: Path
) -> None:
    whole = pictures[0].read_bytes()
    made = {"text.exr": b"no picture", "cut.exr": whole[:700], "whole.exr": whole}
    made |= {"text.blend": b"no scene", "blind.blend": files["blind"].read_bytes()}
    for name, content in made.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder.exr").mkdir()
    before = tree(tmp_path)
    options = [tmp_path / word if "." in word else word for word in words.split()]
    run = inside("check", files["two"], *options, "--report", tmp_path / "report")
    refused(run, *BAD[words])
    assert tree(tmp_path) == before and not (tmp_path / "report").exists()


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
