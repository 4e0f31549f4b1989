# SPDX-License-Identifier: GPL-3.0-or-later
"""False colour: what the numbers are, that pixels stay pixels, and files that are not as hoped."""

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
COLOUR, ALBEDO = np.array([0.5, 1.0, 2.0]), np.array([0.2, 0.5, 0.9])
NAMES_5 = [f"ViewLayer.Diffuse {what}" for what in ("Direct", "Indirect", "Color")]


def planes(image: np.ndarray, name: str = "", letters: str = "RGB") -> dict[str, np.ndarray]:
    return {f"{name}{c}": image[..., k].astype(np.float32) for k, c in enumerate(letters)}


def diffuse() -> dict[str, np.ndarray]:
    """A Lambertian scene of irradiance RAMP·COLOUR; the top row has too little green albedo."""
    light, albedo = RAMP[..., None] * COLOUR / np.pi, np.tile(ALBEDO, (H, W, 1))
    albedo[0, :, 1] = 0.9e-4
    return {"DiffDir": 0.25 * light, "DiffInd": 0.75 * light, "DiffCol": albedo}


def write(path: Path, channels: Mapping[str, Any], **header: Any) -> Path:
    with OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, dict(channels)) as file:
        file.write(str(path))
    return path


def blender_4(path: Path, **header: Any) -> Path:
    """One part; a view layer without the passes comes first."""
    channels = planes(np.ones((H, W, 3)), "First.Combined.")
    for name, image in diffuse().items():
        channels |= planes(image, f"Second.1.{name}.")
    return write(path, channels, **header)


def blender_5(path: Path, **header: Any) -> Path:
    """A part a pass, with new names."""
    parts: list[Any] = []
    for name, image in zip(NAMES_5, diffuse().values(), strict=True):
        attributes = {"type": OpenEXR.scanlineimage, **header}
        parts.append(OpenEXR.Part(attributes, planes(image, f"{name}."), name))
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    return path


def ours(path: Path) -> Path:
    """Illuminance 700·RAMP at 179 lm/W; the top row is background outside the border."""
    inside = np.arange(H)[:, None] > 0
    radiance = np.dstack([RAMP[..., None] * COLOUR, np.ones((H, W))]) * inside[..., None]
    layers = np.dstack([700 * RAMP, np.where(inside, 2.0, np.inf) * np.ones(W)])
    channels = planes(radiance, letters="RGBA") | planes(layers[..., :1], "Illuminance.", "V")
    channels |= planes(layers[..., 1:], "Depth.", "V")
    return write(path, channels, efficacy_lm_W=179.0, chromaticities=REC709)


@pytest.mark.parametrize(
    ("make", "header", "space"),
    [
        (blender_4, {}, REC709),
        (blender_4, {"chromaticities": ACESCG}, ACESCG),
        (blender_5, {"colorInteropID": "lin_ap1_scene"}, ACESCG),
    ],
)
def test_illuminance_of_diffuse_passes(make, header, space, tmp_path):
    light = read_map(make(tmp_path / "a.exr", **header), "illuminance", exposure=4.0)
    expected = 683.002 / 4 * RAMP * (COLOUR @ luminance_weights(space))
    expected[0] = np.nan
    np.testing.assert_allclose(light.values, expected, rtol=1e-6)
    unknown = set() if header else {"no-chromaticities"}
    assert {finding.code for finding in light.findings} == {"lambertian"} | unknown


@pytest.mark.parametrize(("given", "factor"), [(None, 1.0), (358.0, 2.0)])
def test_our_layers_keep_their_efficacy_unless_told(given, factor, tmp_path):
    path = ours(tmp_path / "a.exr")
    lux, nits = (read_map(path, q, efficacy_lm_W=given) for q in ("illuminance", "luminance"))
    weight = COLOUR @ luminance_weights(REC709)
    np.testing.assert_allclose(lux.values[1:], 700 * factor * RAMP[1:], rtol=1e-6)
    np.testing.assert_allclose(nits.values[1:], 179 * factor * weight * RAMP[1:], rtol=1e-6)
    assert np.isnan([lux.values[0], nits.values[0]]).all()
    assert not lux.findings + nits.findings


@pytest.mark.parametrize(("height", "width", "scale"), [(90, 160, "log"), (481, 30, "linear")])
def test_pixels_stay_pixels(height, width, scale, tmp_path):
    values = np.geomspace(0.5, 200.0, height * width).reshape(height, width)
    values[0, 0], values[-1, -1] = 0.0, np.nan
    write_map(LightMap("illuminance", values, 683.0, ()), tmp_path / "a.png", scale, (1.0, 100.0))
    grow = 960 // max(height, width)
    top, left = (round(inch * grow * max(height, width) / 10) for inch in (0.45, 0.25))
    drawn = np.round(imread(tmp_path / "a.png") * 255).astype(int)[..., :3]
    drawn = drawn[top : top + grow * height, left : left + grow * width]
    values = np.repeat(np.repeat(values, grow, 0), grow, 1)
    known, shown = np.isfinite(values), np.clip(np.nan_to_num(values), 1.0, 100.0)
    share = np.log10(shown) / 2 if scale == "log" else (shown - 1) / 99
    expected = np.array(colormaps["viridis"](share, bytes=True), int)[..., :3]
    # At most the colour beside it, of 256, where rounding decides.
    assert np.abs(drawn - expected)[known].max(initial=0) <= 3
    assert {tuple(x) for x in np.unique(drawn[~known], axis=0)} <= {x[:3] for x in HATCH}


def test_ranges():
    assert value_range(np.geomspace(1e-6, 900, 1000), "log") == (0.06, 600.0)
    assert value_range(np.array([np.nan, -1.0, 0.0, 80.0]), "linear") == (0.0, 80.0)


def run(capsys: Any, path: Path, out: Path, *options: object) -> tuple[int, str, str]:
    code = cli.run(["falsecolor", str(path), "-o", str(out), *map(str, options), "--json"])
    return code, *capsys.readouterr()


def test_document_and_isolines(tmp_path, capsys):
    out, limits = tmp_path / "a.pdf", ("--min", 50, "--max", 5000)
    code, text, _ = run(capsys, ours(tmp_path / "a.exr"), out, *limits, "--isolines", "auto")
    found = json.loads(text)
    assert (code, found["output"], found["findings"]) == (0, str(out), [])
    assert (found["quantity"], found["unit"], found["range"]) == ("illuminance", "lx", [50, 5000])
    assert found["isolines"] == [50, 100, 200, 500, 1000, 2000, 5000]
    assert found["percentiles"]["50"] == pytest.approx(np.median(700 * RAMP[1:]), rel=1e-5)
    assert found["no_data_fraction"] == pytest.approx(1 / H)
    assert out.read_bytes().startswith(b"%PDF")


TILED = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}


@pytest.mark.parametrize(
    ("value", "header", "code"),
    [(0.0, {}, "nothing-lit"), (np.inf, {}, "not-finite"), (np.nan, TILED, "not-finite")],
)
def test_other_pixels(value, header, code, tmp_path):
    image = np.full((H, W), 0.0 if value == 0 else 1.0, np.float16)
    image[2:5, 3:5] = value
    path = write(tmp_path / "a.exr", dict.fromkeys("RGB", image), chromaticities=REC709, **header)
    light = read_map(path, "luminance")
    assert [finding.code for finding in light.findings] == [code]
    assert light.percentiles["100"] == pytest.approx(0.0 if value == 0 else 683.002)


BAD: dict[str, tuple[tuple[object, ...], str]] = {
    "no passes": (("--view-layer", "First"), r"expected Illuminance.V, .*; has Combined.RGB$"),
    "no layer": (("--view-layer", "Third"), r"unknown view layer 'Third'.* First, Second.1$"),
    "min is max": (("--min", 5, "--max", 5), "empty range, 5 to 5"),
    "log of 0": (("--min", 0), "0 or less.* more than 0 on a log scale"),
    "isolines": (("--isolines", "1,-2"), "auto, or numbers above 0"),
    "exposure": (("--exposure", 0), "above 0"),
    "no EXR": ((), "a.exr"),
    "cut": ((), "a.exr"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(case, tmp_path, capsys):
    options, said = BAD[case]
    path = blender_4(tmp_path / "a.exr")
    if case in ("no EXR", "cut"):
        path.write_bytes(b"\x89PNG\r\n" if case == "no EXR" else path.read_bytes()[:1000])
    code, _, error = run(capsys, path, tmp_path / "out.png", *options)
    assert (code, list(tmp_path.iterdir())) == (2, [path])
    assert re.search(said, error.strip()), error
