# SPDX-License-Identifier: GPL-3.0-or-later
"""`render` as it is promised, from outside."""

import hashlib
import json
import math
import os
import time
from functools import cache, partial
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
    panel,
    point,
    ran,
    refused,
    save,
    scene_file,
    sky,
    stage,
    tree,
)
from .reading import add, put

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


def names() -> None:
    for i, name in enumerate(TRICKY):
        point(name, (0.3 * i - 0.4, 0.1 * i, 2.0 + 0.1 * i))


def rendering(**settings: Any) -> Any:
    return lambda: put(bpy.context.scene.render, **settings)


def choices() -> None:
    point()
    add("Other camera", bpy.data.cameras.new("Other"), location=(0, 0, 3))
    bpy.context.scene.view_layers.new("Second layer")
    bpy.data.scenes.new("Empty scene")
    floor = bpy.data.objects["Floor"]
    for frame, height in ((1, 0.0), (11, 1.0)):
        floor.location.z = height
        floor.keyframe_insert("location", frame=frame)


HIMMEL = partial(sky, "Himmel", (0.5, 0.25, 0.125))
BORDER = {"border_min_x": 0.25, "border_max_x": 0.75, "border_min_y": 0.5, "border_max_y": 1.0}
SCENES: dict[str, tuple[Any, ...]] = {
    "two": (point, panel),
    "dark": (),
    "names": (names,),
    "sky": (HIMMEL, point),
    "transparent": (HIMMEL, point, rendering(film_transparent=True)),
    "border": (point, HIMMEL, rendering(use_border=True, use_crop_to_border=False, **BORDER)),
    "choices": (choices,),
    "blind": (point, lambda: put(bpy.context.scene, camera=None)),
    "soft": (partial(point, "Soft", (0, 0, 2), radius=0.3, soft=True),),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("render_scenes")
    return {name: scene_file(folder, name, *build) for name, build in SCENES.items()}


@pytest.fixture(scope="module")
def two(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, ...]:
    """A point and an area light over a floor: the document, the header, the channels."""
    out = tmp_path_factory.mktemp("two") / "o.exr"
    before = tree(files["two"].parent)
    options = ("--passes", "all", "--json", "--threads", 1)
    run = ran("render", files["two"], "-o", out, *options)
    assert (run.code, set(tree(out.parent))) == (0, {"o.exr"}), run
    assert tree(files["two"].parent) == before
    return run.document, *exr(out)


@pytest.fixture(scope="module")
def rendered(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Render a scene by its name in this process: the document, the header, the channels."""
    out = tmp_path_factory.mktemp("rendered") / "o.exr"

    @cache
    def render(scene: str, **options: Any) -> tuple[Any, ...]:
        return blender_rad.render(files[scene], output=out, **options), *exr(out)

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


def test_standard_error_covers(rendered: Any) -> None:
    floors: list[Any] = []
    for samples in (16, 256):
        document, _, channels = rendered("two", samples=samples)
        assert document["samples_per_pixel"] == samples
        floor = inner(channels)
        floors.append((layer(channels, "")[floor], layer(channels, "StandardError")[floor]))
    (few, error), (many, rest) = floors
    assert (error > 0).all()
    z = (few - many) / np.hypot(error, rest)
    assert 0.7 < math.sqrt((z**2).mean()) < 1.3
    assert 0.88 < (np.abs(z) < 2).mean() <= 1


def test_error_is_a_target(rendered: Any) -> None:
    found = {target: rendered("two", error=target) for target in (0.05, 0.003)}
    for target, (document, _, channels) in found.items():
        assert 0 < document["relative_standard_error"] <= target
        assert np.isfinite(channels["StandardError.R"]).all()
    rough, fine = found.values()
    assert fine[0]["samples_per_pixel"] > rough[0]["samples_per_pixel"]
    assert math.isclose(*(layer(c, "").mean() for _, _, c in (rough, fine)), rel_tol=0.05)


def test_time_limit(rendered: Any) -> None:
    start = time.monotonic()
    document, _, channels = rendered("two", error=1e-7, time_limit=0.5)
    assert time.monotonic() - start < 10
    assert document["relative_standard_error"] > 1e-7
    assert layer(channels, "").any()


def rgb(name: str, axes: str = "RGB") -> set[str]:
    return {f"{name}.{axis}" for axis in axes}


@pytest.mark.parametrize(
    ("passes", "wanted"),
    [
        ({}, STANDARD),
        ({"passes": "Depth"}, {*"RGBA", "Depth.V"}),
        ({"passes": "Normal,Light.Key"}, {*"RGBA", *rgb("Normal", "XYZ"), *rgb("Light.Key")}),
    ],
)
def test_passes_are_those_named(rendered: Any, passes: dict[str, str], wanted: set[str]) -> None:
    document, _, channels = rendered("two", samples=1, **passes)
    assert set(channels) == wanted
    assert document["samples_per_pixel"] == 1
    assert layer(channels, "").any()


def test_names_are_safe_and_kept(rendered: Any) -> None:
    document, header, channels = rendered("names", samples=1, passes="all")
    safe = {name.removeprefix("Light.")[:-2] for name in channels if name.startswith("Light.")}
    assert len(safe) == len(TRICKY)
    assert not any("." in name or "\t" in name for name in safe)
    assert {"Tab_here", TRICKY[3]} <= safe
    kept = json.loads(header["lightNames"])
    assert {kept[name] for name in safe} == set(TRICKY)
    total = sum(layer(channels, f"Light.{name}") for name in safe)
    np.testing.assert_allclose(layer(channels, ""), total, rtol=SINGLE, atol=1e-7)
    heights = {layer(channels, f"Light.{name}").max() for name in safe}
    assert len(heights) == len(TRICKY), "each layer is its own light"
    assert document["findings"] == []


def test_world_shows(rendered: Any) -> None:
    _, header, channels = rendered("sky", samples=4, passes="all")
    shown = layer(channels, "")[np.isposinf(channels["Depth.V"])]
    np.testing.assert_allclose(shown, np.broadcast_to([0.5, 0.25, 0.125], shown.shape), rtol=1e-6)
    assert (channels["A"] == 1).all()
    assert {"Light.World.R", "Light.Key.R"} <= set(channels)
    assert set(json.loads(header["lightNames"]).values()) == {"World", "Key"}


def test_transparent_film(rendered: Any) -> None:
    _, _, channels = rendered("transparent", samples=4)
    alpha, outside = channels["A"], np.isposinf(channels["Depth.V"])
    assert (alpha[inner(channels)] == 1).all()
    assert ((alpha >= 0) & (alpha <= 1)).all()
    empty = outside & (alpha == 0)
    assert empty.sum() > 0.9 * outside.sum()
    assert not layer(channels, "")[empty].any(), "premultiplied"


def test_border(rendered: Any) -> None:
    _, _, channels = rendered("border", samples=4)
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[: HEIGHT // 2, WIDTH // 4 : 3 * WIDTH // 4] = True
    assert (layer(channels, "")[shown] > 0).all()
    assert not [name for name, pixels in channels.items() if pixels[~shown].any()]


def test_nothing_emits(files: dict[str, Path], tmp_path: Path) -> None:
    run = inside("render", files["dark"], "-o", tmp_path / "o.exr", "--json")
    assert run.code == 0, run
    assert run.document["findings"]
    assert not layer(exr(tmp_path / "o.exr")[1], "").any()


@pytest.mark.parametrize(
    ("options", "nearest"),
    [
        ({"frame": 1}, 5.0),
        ({"frame": 11, "view_layer": "Second layer"}, 4.0),
        ({"frame": 1, "camera": "Other camera", "resolution": "16x8"}, 3.0),
    ],
)
def test_one_asks_for_frame_camera_and_layer(
    rendered: Any, options: dict[str, Any], nearest: float
) -> None:
    depth = rendered("choices", samples=1, **options)[2]["Depth.V"]
    assert depth.shape == ((8, 16) if "resolution" in options else (HEIGHT, WIDTH))
    assert math.isclose(depth.min(), nearest, rel_tol=SINGLE)


def test_clay(rendered: Any) -> None:
    _, _, channels = rendered("two", samples=4, shading="clay")
    floor = inner(channels)
    expected = layer(channels, "Irradiance") * 0.8 / math.pi
    np.testing.assert_allclose(layer(channels, "")[floor], expected[floor], rtol=SINGLE)


def test_efficacy_scales_what_is_seen(rendered: Any) -> None:
    document, _, radiance = rendered("two", samples=1, efficacy="radiance")
    assert document["efficacy_lm_W"] == 179
    luminance = 179 * layer(radiance, "") @ REC709
    np.testing.assert_allclose(radiance["Luminance.V"], luminance, rtol=2e-4, atol=1e-6)
    assert rendered("two", samples=1, efficacy="cycles-ies")[0]["efficacy_lm_W"] == 177.83


def test_model_physical(rendered: Any) -> None:
    cycles, physical = (
        layer(rendered("soft", error=0.005, model=m)[2], "Irradiance")[11:13, 15:17].mean()
        for m in ("cycles", "physical")
    )
    assert math.isclose(cycles / physical, 4 / 4.09, rel_tol=0.005)


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


def bad_scenes(folder: Path, good: Path) -> list[Path]:
    whole = good.read_bytes()
    made = {"empty.blend": b"", "text.blend": b"I am no scene\n", "scene.txt": whole}
    made |= {"text.glb": made["text.blend"], "text.gltf": made["text.blend"]}
    made |= {f"cut{share}.blend": whole[: int(share * len(whole))] for share in (0.02, 0.5, 0.97)}
    for name, content in made.items():
        (folder / name).write_bytes(content)
    (folder / "folder.blend").mkdir()
    return [folder / name for name in (*made, "folder.blend", "missing.blend")]


@pytest.mark.parametrize(("verb", "option"), [("render", "-o"), ("check", "--report")])
def test_bad_scenes(verb: str, option: str, files: dict[str, Path], tmp_path: Path) -> None:
    bad = bad_scenes(tmp_path, files["two"])
    before = tree(tmp_path)
    for path in bad:
        refused(inside(verb, path, option, tmp_path / "out.exr"), str(path))
    for scene in ((files["blind"],), (files["choices"], "--scene", "Empty scene")):
        refused(inside(verb, *scene, option, tmp_path / "out.exr"), "camera")
    assert tree(tmp_path) == before and not (tmp_path / "out.exr").exists()


def test_bad_scene_by_itself_is_one_line(tmp_path: Path) -> None:
    bad = tmp_path / "text.glb"
    bad.write_text("I am no scene\n")
    refused(ran("render", bad, "-o", tmp_path / "o.exr"), str(bad))


def test_json_alone_on_stdout_though_blender_chatters(tmp_path: Path) -> None:
    stage()
    library = save(tmp_path / "library.blend")
    stage()
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.meshes = list(there.meshes)
    lost = add("Lost", bpy.data.meshes[-1])
    assert lost.data.library
    point()
    file = save(tmp_path / "chatty.blend")
    library.unlink()
    run = ran("render", file, "-o", tmp_path / "o.exr", "--samples", 1, "--json", "-vv")
    assert run.code == 0, run
    assert run.document["output"] == str(tmp_path / "o.exr")


def test_threads(files: dict[str, Path], tmp_path: Path) -> None:
    start, before = time.monotonic(), time.process_time()
    options = ("--samples", 512, "--threads", 1)
    assert inside("render", files["two"], "-o", tmp_path / "o.exr", *options).code == 0
    assert time.process_time() - before < 1.2 * (time.monotonic() - start)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("wait", [0.0, 1.5])  # while it reads, and while it renders
def test_interrupt(files: dict[str, Path], tmp_path: Path, wait: float) -> None:
    options = ("--error", 1e-7, "--json", "--resolution", "320x240")
    arguments = ("render", files["two"], "-o", tmp_path / "o.exr", *options)
    interrupted(lambda: time.sleep(wait), *arguments)
    assert not list(tmp_path.iterdir())
