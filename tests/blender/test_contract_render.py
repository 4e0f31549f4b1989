# SPDX-License-Identifier: GPL-3.0-or-later
"""`render` as it is promised, from outside."""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import blender_rad

from .promised import (
    ALBEDO,
    HEIGHT,
    WIDTH,
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
    stage,
    tree,
    world,
)

SINGLE = 1e-5  # of sums of single-precision pixels
REC709 = np.array([0.2126, 0.7152, 0.0722])
STANDARD = {
    *"RGBA",
    *(f"{name}.{c}" for name in ("Irradiance", "StandardError") for c in "RGB"),
    "Illuminance.V",
    "Luminance.V",
    "Depth.V",
    *(f"Normal.{c}" for c in "XYZ"),
}
TRICKY = ("Rim.001", "Rim_001", "Tab\there", "<b>'é☀\"")


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("render_scenes")

    def names() -> None:
        for i, name in enumerate(TRICKY):
            point(name, (0.3 * i - 0.4, 0.1 * i, 2.0 + 0.1 * i))

    def sky() -> None:
        world("Himmel", (0.5, 0.25, 0.125))

    def transparent() -> None:
        bpy.context.scene.render.film_transparent = True

    def border() -> None:
        render = bpy.context.scene.render
        render.use_border, render.use_crop_to_border = True, False
        render.border_min_x, render.border_max_x = 0.25, 0.75
        render.border_min_y, render.border_max_y = 0.5, 1.0

    def choices() -> None:
        point()
        link("Other camera", bpy.data.cameras.new("Other"), (0, 0, 3))
        scene = bpy.context.scene
        scene.view_layers.new("Second layer")
        bpy.data.scenes.new("Empty scene")
        floor, lamp = bpy.data.objects["Floor"], bpy.data.objects["Key"].data
        for frame, height in ((1, 0.0), (11, 1.0)):
            floor.location.z = height
            floor.keyframe_insert("location", frame=frame)
        lamp.energy = 100.0

    def blind() -> None:
        bpy.context.scene.camera = None
        point()

    builds: dict[str, tuple[Any, ...]] = {
        "two": (point, panel),
        "dark": (),
        "names": (names,),
        "sky": (sky, point),
        "transparent": (sky, point, transparent),
        "border": (point, sky, border),
        "choices": (choices,),
        "blind": (blind,),
    }
    return {name: scene_file(folder, name, *build) for name, build in builds.items()}


@pytest.fixture(scope="session")
def two(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, ...]:
    """A point and an area light over a floor: the document, the header, the channels."""
    folder = tmp_path_factory.mktemp("two")
    before = tree(files["two"].parent)
    run = ran(
        "render", files["two"], "-o", folder / "o.exr", "--passes", "all", "--json", "--threads", 1
    )
    assert (run.code, set(tree(folder))) == (0, {"o.exr"}), run
    assert tree(files["two"].parent) == before
    return run.document, *exr(folder / "o.exr")


@pytest.fixture
def rendered(tmp_path: Path) -> Any:
    """Render in this process: the document, the header, the channels."""

    def render(scene: Path, **options: Any) -> tuple[Any, ...]:
        document = blender_rad.render(scene, output=tmp_path / "o.exr", **options)
        return document, *exr(tmp_path / "o.exr")

    return render


def inner(channels: dict[str, Any]) -> Any:
    """Return which pixels hold floor only: (h, w)."""
    floor = np.isfinite(channels["Depth.V"])
    padded = np.pad(floor, 1)
    h, w = floor.shape
    return np.logical_and.reduce([padded[i : i + h, j : j + w] for i in range(3) for j in range(3)])


def test_document(two: tuple[Any, ...]) -> None:
    document, _, _ = two
    assert Path(document["output"]).name == "o.exr"
    assert document["samples_per_pixel"] > 0
    assert 0 < document["relative_standard_error"] <= 0.01
    assert document["coverage"] == {"supported_pixel_fraction": 1.0, "unsupported": []}
    assert document["findings"] == []
    assert {"read", "build", "render", "write"} <= set(document["seconds"])
    assert all(seconds >= 0 for seconds in document["seconds"].values())
    assert math.isclose(document["efficacy_lm_W"], 683.002, rel_tol=1e-6)
    assert document["model"] == "cycles"


def test_header(two: tuple[Any, ...], files: dict[str, Path]) -> None:
    _, header, _ = two
    primaries = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    assert np.allclose(header["chromaticities"], primaries, atol=1e-4)
    said = "\n".join(str(value) for value in header.values())
    digest = hashlib.sha256(files["two"].read_bytes()).hexdigest()
    program = f"blender-rad {blender_rad.__version__}"
    for part in (program, digest, "cycles", "683.002", "Key", "Fill"):
        assert part in said
    assert any("samples" in name.lower() for name in header)


def test_channels_and_that_the_picture_is_the_sum_of_its_lights(two: tuple[Any, ...]) -> None:
    _, _, channels = two
    lights = {f"Light.{name}.{c}" for name in ("Key", "Fill") for c in "RGB"}
    assert set(channels) == STANDARD | lights
    assert {pixels.shape for pixels in channels.values()} == {(HEIGHT, WIDTH)}
    total = layer(channels, "Light.Key") + layer(channels, "Light.Fill")
    assert total.max() > 0
    np.testing.assert_allclose(layer(channels, ""), total, rtol=SINGLE, atol=1e-7)


def test_geometry(two: tuple[Any, ...]) -> None:
    _, _, channels = two
    floor = inner(channels)
    outside = np.isposinf(channels["Depth.V"])
    assert floor.any() and outside.any()
    np.testing.assert_allclose(channels["Depth.V"][floor], 5.0, rtol=SINGLE)
    normal = np.stack([channels[f"Normal.{c}"] for c in "XYZ"], axis=-1)
    np.testing.assert_allclose(normal[floor], np.broadcast_to([0, 0, 1], normal[floor].shape))
    assert not layer(channels, "")[outside].any()
    assert (channels["A"] == 1).all()


def test_quantities_hang_together(two: tuple[Any, ...]) -> None:
    _, _, channels = two
    floor = inner(channels)
    picture, irradiance = layer(channels, ""), layer(channels, "Irradiance")
    expected = irradiance * np.array(ALBEDO) / math.pi
    np.testing.assert_allclose(picture[floor], expected[floor], rtol=SINGLE)
    for name, triple in (("Luminance.V", picture), ("Illuminance.V", irradiance)):
        np.testing.assert_allclose(
            channels[name], 683.002 * triple @ REC709, rtol=2e-4, atol=1e-6
        )  # of the four digits of the weights


def test_point_light_has_its_closed_form(two: tuple[Any, ...]) -> None:
    _, _, channels = two
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    step = 5.0 / WIDTH
    dx, dy = (x - WIDTH / 2) * step - 0.4, -(y - HEIGHT / 2) * step - 0.2
    irradiance = 100 / (4 * math.pi) * 2 / (dx**2 + dy**2 + 4) ** 1.5
    expected = irradiance[..., None] * np.array(ALBEDO) / math.pi
    floor = inner(channels)
    # A pixel's mean differs from its centre by its curvature, and by its own standard error.
    found, error = layer(channels, "Light.Key")[floor], layer(channels, "StandardError")[floor]
    assert np.all(np.abs(found - expected[floor]) <= 2e-3 * expected[floor] + 4 * error)
    assert found.mean() == pytest.approx(expected[floor].mean(), rel=1e-3)


def test_standard_error_covers(files: dict[str, Path], rendered: Any) -> None:
    document, _, few = rendered(files["two"], samples=16)
    assert document["samples_per_pixel"] == 16
    document, _, many = rendered(files["two"], samples=256)
    assert document["samples_per_pixel"] == 256
    floor = inner(many)
    error = layer(few, "StandardError")[floor]
    assert (error > 0).all()
    z = (layer(few, "") - layer(many, ""))[floor] / np.hypot(
        error, layer(many, "StandardError")[floor]
    )
    assert 0.7 < math.sqrt((z**2).mean()) < 1.3
    assert 0.88 < (np.abs(z) < 2).mean() <= 1


def test_error_is_a_target(files: dict[str, Path], rendered: Any) -> None:
    rough = rendered(files["two"], error=0.05)
    fine = rendered(files["two"], error=0.003)
    for (document, _, channels), target in ((rough, 0.05), (fine, 0.003)):
        assert 0 < document["relative_standard_error"] <= target
        assert np.isfinite(channels["StandardError.R"]).all()
    assert fine[0]["samples_per_pixel"] > rough[0]["samples_per_pixel"]
    means = [layer(channels, "").mean() for _, _, channels in (rough, fine)]
    assert math.isclose(*means, rel_tol=0.05)


def test_time_limit(files: dict[str, Path], rendered: Any) -> None:
    start = time.monotonic()
    document, _, channels = rendered(files["two"], error=1e-7, time_limit=0.5)
    assert time.monotonic() - start < 10
    assert document["relative_standard_error"] > 1e-7
    assert layer(channels, "").any()


@pytest.mark.parametrize(
    ("passes", "wanted"),
    [
        ({}, STANDARD),
        ({"passes": "Depth"}, {*"RGBA", "Depth.V"}),
        (
            {"passes": "Normal,Light.Key"},
            {*"RGBA", *(f"Normal.{c}" for c in "XYZ"), *(f"Light.Key.{c}" for c in "RGB")},
        ),
    ],
)
def test_passes_are_those_named(
    files: dict[str, Path], rendered: Any, passes: dict[str, str], wanted: set[str]
) -> None:
    document, _, channels = rendered(files["two"], samples=1, **passes)
    assert set(channels) == wanted
    assert document["samples_per_pixel"] == 1
    assert layer(channels, "").any()


def test_names_are_safe_and_kept(files: dict[str, Path], rendered: Any) -> None:
    document, header, channels = rendered(files["names"], samples=1, passes="all")
    safe = {name.removeprefix("Light.")[:-2] for name in channels if name.startswith("Light.")}
    assert len(safe) == len(TRICKY)
    assert not any("." in name or "\t" in name for name in safe)
    assert {"Tab_here", TRICKY[3]} <= safe
    kept = json.loads(header["lightNames"])
    assert {kept[name] for name in safe} == set(TRICKY)
    total = sum(layer(channels, f"Light.{name}") for name in safe)
    np.testing.assert_allclose(layer(channels, ""), total, rtol=SINGLE, atol=1e-7)
    heights = [layer(channels, f"Light.{n}").max() for n in sorted(safe, key=lambda n: kept[n])]
    assert len(set(heights)) == len(TRICKY), "each layer is its own light"
    assert document["findings"] == []


def test_world_shows(files: dict[str, Path], rendered: Any) -> None:
    _, header, channels = rendered(files["sky"], samples=4, passes="all")
    outside = np.isposinf(channels["Depth.V"])
    shown = layer(channels, "")[outside]
    np.testing.assert_allclose(shown, np.broadcast_to([0.5, 0.25, 0.125], shown.shape), rtol=1e-6)
    assert (channels["A"] == 1).all()
    assert {"Light.World.R", "Light.Key.R"} <= set(channels)
    assert set(json.loads(header["lightNames"]).values()) == {"World", "Key"}


def test_transparent_film(files: dict[str, Path], rendered: Any) -> None:
    _, _, channels = rendered(files["transparent"], samples=4)
    floor, outside = inner(channels), np.isposinf(channels["Depth.V"])
    assert (channels["A"][floor] == 1).all()
    assert ((channels["A"] >= 0) & (channels["A"] <= 1)).all()
    empty = outside & ~np.isfinite(channels["Depth.V"]) & (channels["A"] == 0)
    assert empty.sum() > 0.9 * outside.sum()
    assert not layer(channels, "")[empty].any(), "premultiplied"


def test_border(files: dict[str, Path], rendered: Any) -> None:
    _, _, channels = rendered(files["border"], samples=4)
    assert channels["R"].shape == (HEIGHT, WIDTH)
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[: HEIGHT // 2, WIDTH // 4 : 3 * WIDTH // 4] = True
    assert (layer(channels, "")[shown] > 0).all()
    for name, pixels in channels.items():
        assert not pixels[~shown].any(), name


def test_nothing_emits(files: dict[str, Path], tmp_path: Path) -> None:
    run = inside("render", files["dark"], "-o", tmp_path / "o.exr", "--json")
    assert run.code == 0, run
    assert run.document["findings"]
    assert not layer(exr(tmp_path / "o.exr")[1], "").any()


def test_one_asks_for_frame_camera_scene_and_layer(files: dict[str, Path], rendered: Any) -> None:
    file = files["choices"]
    _, _, first = rendered(file, samples=1, frame=1)
    _, _, last = rendered(file, samples=1, frame=11, view_layer="Second layer")
    assert math.isclose(first["Depth.V"].min(), 5.0, rel_tol=SINGLE)
    assert math.isclose(last["Depth.V"].min(), 4.0, rel_tol=SINGLE)
    _, _, near = rendered(file, samples=1, frame=1, camera="Other camera", resolution="16x8")
    assert near["Depth.V"].shape == (8, 16)
    assert math.isclose(near["Depth.V"].min(), 3.0, rel_tol=SINGLE)


def test_clay(rendered: Any, files: dict[str, Path]) -> None:
    _, _, channels = rendered(files["two"], samples=4, shading="clay")
    floor = inner(channels)
    expected = layer(channels, "Irradiance") * 0.8 / math.pi
    np.testing.assert_allclose(layer(channels, "")[floor], expected[floor], rtol=SINGLE)


def test_efficacy_scales_what_is_seen(rendered: Any, files: dict[str, Path]) -> None:
    document, _, radiance = rendered(files["two"], samples=1, efficacy="radiance")
    assert document["efficacy_lm_W"] == 179
    luminance = 179 * layer(radiance, "") @ REC709
    np.testing.assert_allclose(radiance["Luminance.V"], luminance, rtol=2e-4, atol=1e-6)
    document, _, _ = rendered(files["two"], samples=1, efficacy="cycles-ies")
    assert document["efficacy_lm_W"] == 177.83


def test_model_physical(tmp_path: Path, rendered: Any) -> None:
    def build() -> None:
        point("Soft", (0, 0, 2), 100, radius=0.3, soft=True)

    file = scene_file(tmp_path, "soft", build)
    pictures = {m: rendered(file, error=0.002, model=m)[2] for m in ("cycles", "physical")}
    middle = {m: layer(p, "Irradiance")[11:13, 15:17].mean() for m, p in pictures.items()}
    assert math.isclose(middle["cycles"] / middle["physical"], 4 / 4.09, rel_tol=0.005)


BAD = {
    "--camera Nobody": ("Nobody", "Camera", "Other camera"),
    "--camera Floor": ("Floor", "Other camera"),
    "--scene Nowhere": ("Nowhere", "Empty scene"),
    "--view-layer None": ("None", "Second layer"),
    "--passes Depth,Sparkle": ("Sparkle", "Irradiance"),
    "--passes Light.Nobody": ("Nobody", "Key"),
}


@pytest.mark.parametrize("options", BAD)
def test_what_is_not_there_is_refused_with_what_is(
    options: str, files: dict[str, Path], tmp_path: Path
) -> None:
    arguments = ("render", files["choices"], "-o", tmp_path / "o.exr", *options.split())
    refused(inside(*arguments), *BAD[options])
    assert not tree(tmp_path)


def bad_scenes(folder: Path, good: Path) -> dict[str, Path]:
    made = {name: folder / name for name in ("text.blend", "empty.blend", "text.glb", "text.gltf")}
    for name, path in made.items():
        path.write_text("" if "empty" in name else "I am no scene\n")
    for share in (0.02, 0.5, 0.97):
        path = folder / f"cut{share}.blend"
        whole = good.read_bytes()
        path.write_bytes(whole[: int(share * len(whole))])
        made[path.name] = path
    made["missing"] = folder / "missing.blend"
    made["folder"] = folder / "folder.blend"
    made["folder"].mkdir()
    made["ending"] = folder / "scene.txt"
    shutil.copy(good, made["ending"])
    return made


@pytest.mark.parametrize("verb", ["render", "check"])
def test_bad_scenes(verb: str, files: dict[str, Path], tmp_path: Path) -> None:
    to = ["-o", tmp_path / "o.exr"] if verb == "render" else ["--report", tmp_path / "report"]
    bad = bad_scenes(tmp_path, files["two"])
    before = tree(tmp_path)
    for path in bad.values():
        refused(inside(verb, path, *to), str(path))
        assert tree(tmp_path) == before
        assert not (tmp_path / "report").exists()


def test_bad_scene_by_itself_is_one_line(tmp_path: Path) -> None:
    bad = tmp_path / "text.glb"
    bad.write_text("I am no scene\n")
    refused(ran("render", bad, "-o", tmp_path / "o.exr"), str(bad))


@pytest.mark.parametrize("options", [("blind",), ("choices", "--scene", "Empty scene")])
@pytest.mark.parametrize(("verb", "output"), [("render", "-o"), ("check", "--report")])
def test_no_camera(
    verb: str, output: str, options: tuple[str, ...], files: dict[str, Path], tmp_path: Path
) -> None:
    run = inside(verb, files[options[0]], output, tmp_path / "o.exr", *options[1:])
    refused(run, "camera")
    assert not list(tmp_path.iterdir())


def test_json_alone_on_stdout_though_blender_chatters(tmp_path: Path) -> None:
    stage()
    library = save(tmp_path / "library.blend")
    stage()
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.meshes = list(there.meshes)
    lost = link("Lost", bpy.data.meshes[-1])
    assert lost.data.library
    point()
    file = save(tmp_path / "chatty.blend")
    library.unlink()
    run = ran("render", file, "-o", tmp_path / "o.exr", "--samples", 1, "--json", "-vv")
    assert run.code == 0, run
    assert run.document["output"] == str(tmp_path / "o.exr")


def test_threads(files: dict[str, Path], tmp_path: Path) -> None:
    start, before = time.monotonic(), time.process_time()
    options = ("--samples", 2048, "--threads", 1)
    assert inside("render", files["two"], "-o", tmp_path / "o.exr", *options).code == 0
    assert time.process_time() - before < 1.2 * (time.monotonic() - start)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("wait", [0.0, 1.5])  # while it reads, and while it renders
def test_interrupt(files: dict[str, Path], tmp_path: Path, wait: float) -> None:
    options = ("--error", 1e-7, "--json", "--resolution", "320x240")
    arguments = ("render", files["two"], "-o", tmp_path / "o.exr", *options)
    interrupted(lambda: time.sleep(wait), *arguments)
    assert not list(tmp_path.iterdir())
