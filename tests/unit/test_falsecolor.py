# SPDX-License-Identifier: GPL-3.0-or-later
"""False colour: what the numbers are, that pixels stay pixels, and files that are not as hoped."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from matplotlib import colormaps
from matplotlib.image import imread

from blender_rad import cli
from blender_rad.photometry.falsecolor import LightMap, read_map, value_range, write_map
from blender_rad.report.pictures import HATCH
from blender_rad.working_space import ACESCG, REC709, luminance_weights

H, W = 9, 16
RAMP = np.geomspace(1.0, 1000.0, H * W).reshape(H, W)
COLOUR = np.array([0.5, 1.0, 2.0])
ALBEDO = np.array([0.2, 0.5, 0.9])
NEW = {"DiffDir": "Diffuse Direct", "DiffInd": "Diffuse Indirect", "DiffCol": "Diffuse Color"}


def rgb(image: np.ndarray, name: str, letters: str = "RGB") -> dict[str, np.ndarray]:
    return {f"{name}{c}": image[..., k].astype(np.float32) for k, c in enumerate(letters)}


def diffuse(radiance_share: float = 0.25) -> dict[str, np.ndarray]:
    """A Lambertian scene of irradiance RAMP·COLOUR; the top row has no diffuse albedo."""
    irradiance = RAMP[..., None] * COLOUR / np.pi
    albedo = np.broadcast_to(ALBEDO, (H, W, 3)).copy()
    albedo[0, :, 1] = 0.9e-4
    passes = {"DiffDir": radiance_share, "DiffInd": 1 - radiance_share}
    return {name: irradiance * share for name, share in passes.items()} | {"DiffCol": albedo}


def one_part(path: Path, channels: Mapping[str, Any], **header: Any) -> Path:
    attributes = {"type": OpenEXR.scanlineimage, **header}
    with OpenEXR.File(attributes, dict(channels)) as file:
        file.write(str(path))
    return path


def old_blender(path: Path, passes: Mapping[str, np.ndarray], **header: Any) -> Path:
    """One part, as Blender 4 writes, after a view layer without the passes."""
    first = rgb(np.ones((H, W, 3)), "First.Combined.")
    named = [rgb(image, f"Second.1.{name}.") for name, image in passes.items()]
    return one_part(path, {k: v for part in [first, *named] for k, v in part.items()}, **header)


def new_blender(path: Path, passes: Mapping[str, np.ndarray], **header: Any) -> Path:
    """A part per pass, as Blender 5 writes."""
    parts = [
        OpenEXR.Part(
            {"type": OpenEXR.scanlineimage, **header},
            rgb(image, f"ViewLayer.{NEW.get(name, name)}."),
            f"ViewLayer.{NEW.get(name, name)}",
        )
        for name, image in passes.items()
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    return path


def ours(path: Path, **header: Any) -> Path:
    radiance = np.dstack([RAMP[..., None] * COLOUR, np.ones((H, W))])
    radiance[0] = 0  # outside the border
    depth = np.where(np.arange(H)[:, None] > 0, 2.0, np.inf) * np.ones((H, W))
    planes = {"Illuminance.V": 700 * RAMP, "Depth.V": depth}
    channels = rgb(radiance, "", "RGBA") | {k: v.astype(np.float32) for k, v in planes.items()}
    return one_part(path, channels, **{"efficacy_lm_W": 179.0, "chromaticities": REC709} | header)


WRITERS = {
    "4.5": (old_blender, {}, REC709),
    "4.5 with chromaticities": (old_blender, {"chromaticities": ACESCG}, ACESCG),
    "5.2": (new_blender, {"colorInteropID": "lin_ap1_scene"}, ACESCG),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_illuminance_of_diffuse_passes(kind: str, tmp_path: Path) -> None:
    write, header, space = WRITERS[kind]
    light = read_map(write(tmp_path / "a.exr", diffuse(), **header), "illuminance", exposure=4.0)
    expected = 683.002 / 4 * RAMP * (COLOUR @ luminance_weights(space))
    expected[0] = np.nan
    np.testing.assert_allclose(light.values, expected, rtol=1e-6)
    codes = {finding.code for finding in light.findings}
    assert codes == {"lambertian"} | ({"no-chromaticities"} if not header else set())


def test_our_layers_keep_their_efficacy_unless_told(tmp_path: Path) -> None:
    path = ours(tmp_path / "a.exr")
    weight = COLOUR @ luminance_weights(REC709)
    for given, factor in ((None, 1.0), (358.0, 2.0)):
        lux = read_map(path, "illuminance", efficacy_lm_W=given)
        nits = read_map(path, "luminance", efficacy_lm_W=given)
        np.testing.assert_allclose(lux.values[1:], 700 * factor * RAMP[1:], rtol=1e-6)
        np.testing.assert_allclose(nits.values[1:], 179 * factor * weight * RAMP[1:], rtol=1e-6)
        assert np.isnan(lux.values[0]).all()
        assert np.isnan(nits.values[0]).all()
        assert not lux.findings + nits.findings


@pytest.mark.parametrize(("height", "width"), [(90, 160), (481, 30), (1, 1)])
@pytest.mark.parametrize("scale", ["log", "linear"])
def test_pixels_stay_pixels(height: int, width: int, scale: Any, tmp_path: Path) -> None:
    values = np.geomspace(0.5, 200.0, height * width).reshape(height, width)
    values[0, 0] = 0.0
    values[-1, -1] = np.nan
    light = LightMap("illuminance", values, 683.0, ())
    write_map(light, tmp_path / "a.png", scale, (1.0, 100.0))
    drawn = np.round(imread(tmp_path / "a.png") * 255).astype(int)[..., :3]
    grow = max(1, 960 // max(height, width))
    inch = grow * max(height, width) / 10
    top, left = round(0.45 * inch), round(0.25 * inch)
    drawn = drawn[top : top + grow * height, left : left + grow * width]
    clipped = np.clip(np.nan_to_num(values, nan=1.0), 1.0, 100.0)
    share = np.log10(clipped) / 2 if scale == "log" else (clipped - 1) / 99
    expected = np.array(colormaps["viridis"](share, bytes=True), int)[..., :3]
    expected = np.repeat(np.repeat(expected, grow, 0), grow, 1)
    known = np.repeat(np.repeat(np.isfinite(values), grow, 0), grow, 1)
    step = np.abs(drawn - expected)[known]
    assert step.max(initial=0) <= 3  # a colour of 256 beside it, where rounding decides
    hatching = {tuple(colour) for colour in drawn[~known]}
    assert hatching <= {colour[:3] for colour in HATCH}


def test_ranges() -> None:
    assert value_range(np.geomspace(30, 900, 1000), "log") == (25.0, 1000.0)
    assert value_range(np.geomspace(1e-6, 900, 1000), "log") == (0.06, 600.0)
    assert value_range(np.full((4, 4), 100.0), "log") == (20.0, 100.0)
    assert value_range(np.array([np.nan, -1.0, 0.0, 80.0]), "linear") == (0.0, 80.0)
    assert value_range(np.zeros(3), "log", high=5.0) == (1.0, 5.0)


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = cli.run(["falsecolor", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_document_and_isolines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.pdf"
    given = ("--min", 50, "--max", 5000, "--isolines", "auto", "--efficacy", 179, "--json")
    code, text, _ = run(capsys, ours(tmp_path / "a.exr"), "-o", out, *given)
    found = json.loads(text)
    assert code == 0
    assert out.read_bytes().startswith(b"%PDF")
    assert (found["quantity"], found["unit"], found["range"]) == ("illuminance", "lx", [50, 5000])
    assert found["isolines"] == [50, 100, 200, 500, 1000, 2000, 5000]
    assert found["percentiles"]["50"] == pytest.approx(np.median(700 * RAMP[1:]), rel=1e-5)
    assert (found["output"], found["findings"]) == (str(out), [])


@pytest.mark.parametrize(
    ("value", "codes"),
    [(0.0, {"nothing-lit"}), (np.inf, {"not-finite", "nothing-lit"}), (np.nan, {"not-finite"})],
)
def test_dark_and_broken_pixels_are_drawn(
    value: float, codes: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radiance = np.full((H, W, 3), 0.0 if not np.isnan(value) else 1.0)
    radiance[2:5, 3:5] = value
    path = one_part(tmp_path / "a.exr", rgb(radiance, ""), chromaticities=REC709)
    out = tmp_path / "a.png"
    given = ("--quantity", "luminance", "--isolines", "auto", "--json")
    code, text, _ = run(capsys, path, "-o", out, *given)
    assert (code, {f["code"] for f in json.loads(text)["findings"]}) == (0, codes)
    assert out.exists()


@pytest.mark.parametrize("kind", ["tiled", "half"])
def test_tiles_and_half_floats_read_alike(kind: str, tmp_path: Path) -> None:
    values = np.full((H, W, 3), 0.25)
    channels = (
        rgb(values, "") if kind == "tiled" else {c: np.full((H, W), 0.25, "e") for c in "RGB"}
    )
    header = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    path = one_part(tmp_path / "a.exr", channels, **(header if kind == "tiled" else {}))
    assert read_map(path, "luminance").values == pytest.approx(683.002 / 4)


BAD: dict[str, tuple[tuple[object, ...], str]] = {
    "no passes": (
        ("--view-layer", "First"),
        r"expected Illuminance.V, or DiffDir.*; has Combined.RGB$",
    ),
    "no layer": (("--view-layer", "Third"), r"unknown view layer 'Third'.* First, Second.1$"),
    "min over max": (("--min", 5, "--max", 5), "empty range, 5 to 5"),
    "log of 0": (("--min", 0), "0 on a log scale"),
    "isolines": (("--isolines", "1,-2"), "auto, or numbers above 0"),
    "exposure": (("--exposure", 0), "above 0"),
    "suffix": (("-o", "a.jpg"), ".png or .pdf"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_options(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options, said = BAD[case]
    out = tmp_path / "out.png"
    path = old_blender(tmp_path / "a.exr", diffuse())
    code, _, error = run(capsys, path, "-o", out, *options)
    assert (code, out.exists()) == (2, False)
    assert re.search(said, error.strip()), error


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", None])
def test_what_is_no_exr(
    content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = ours(tmp_path / "whole.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(whole[:900] if content is None else content)
    code, _, error = run(capsys, tmp_path / "a.exr", "-o", tmp_path / "out.png")
    assert code == 2
    assert "a.exr" in error
