# SPDX-License-Identifier: GPL-3.0-or-later
"""The report page: five situations of a made-up comparison, and what may never go wrong in them."""

from __future__ import annotations

import base64
import functools
import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from blender_rad.compare.pools import block_sums
from blender_rad.report import ReportData, render_report, wording, write_report
from blender_rad.report.difference import difference, outline, relative_difference, spread
from blender_rad.report.pictures import nice_above, srgb, white_luminance

WEIGHTS = (0.2126390058715104, 0.7151686787677559, 0.0721923153607337)
EFFICACY = 683.002
MAX_BYTES = 3_000_000
HOSTILE = [
    "<script>alert(1)</script>",
    "\" onload='x' & <b>bold</b>",
    "مصباح القراءة",
    "abc\u202egnp.exe",
    "Ctrl\x00\x1b\nname",
    "💡✨ Küche 台所",
    "L" * 300,
    "https://evil.example/x.png",
    "lone \udc80 surrogate",
    "{{ 7 * 7 }}",
]
VOID = {"meta", "img", "br", "link", "input", "hr"}


def lamps(width: int, height: int) -> dict[str, np.ndarray]:
    """Return radiance (h, w, 3) by light of a floor under two lamps, its far end dark."""
    y, x = np.mgrid[0.5:height, 0.5:width] / height
    layers = {}
    for name, u, v, rgb in (("Key", 0.3, 0.4, (6.0, 5.0, 4.0)), ("Fill", 1.1, 0.7, (1, 1.2, 1.6))):
        fall = (0.05 + (x - u) ** 2 + (y - v) ** 2) ** -1.5 * (y > 0.1)
        layers[name] = fall[..., None] * rgb
    return layers


LIGHT = {"type": "POINT", "count": 1, "group": None, "energy_fraction": 0.5, "diagnosis": None}
DOCUMENT = """{
  "schema": 1,
  "scene": {
    "file": "museum_gallery_v012.blend", "sha256": "9f2c9f2c", "frame": 24, "camera": "Cam Front",
    "resolution": [320, 240], "unit_scale_m": 1.0
  },
  "versions": {"blender_rad": "0.1.0", "blender": "4.5.15", "numpy": "1.26.4", "embree": "4.3.3"},
  "settings": {
    "tolerance": 0.01, "confidence": 0.99, "model": "cycles", "shading": "full",
    "efficacy_lm_W": 683.002, "samples": 16, "cycles_samples": 512,
    "overridden": {
      "cycles.max_bounces": {"file": 12, "used": 0},
      "cycles.use_denoising": {"file": true, "used": false}
    }
  },
  "pixels": {
    "compared": 75264, "agree": 74011, "differ": 121, "undecided": 1132, "excluded": 1536
  },
  "metrics": {
    "energy_ratio": 0.99987, "mean_signed_relative_error": -0.00013,
    "p95_absolute_relative_error": 0.0121, "relmse": 3.21e-5
  },
  "coverage": {
    "supported_pixel_fraction": 0.98,
    "unsupported": [
      {"kind": "material", "name": "Glass Vitrine", "feature": "glass BSDF", "pixels": 1536}
    ]
  },
  "witnesses": [],
  "seconds": {"read": 0.42, "ours": 3.1, "cycles": 11.8, "compare": 0.6, "report": 0.4}
}"""


def light(name: str, scale: float | None, error: float | None, verdict: str, **more: Any) -> dict:
    measured = {"name": name, "scale_in_witness": scale, "standard_error": error}
    return LIGHT | measured | {"verdict": verdict} | more


def finding(code: str, severity: str, thing: str, message: str, effect: float | None) -> dict:
    keys = ("code", "severity", "object", "message", "effect_percent")
    return dict(zip(keys, (code, severity, thing, message, effect), strict=True))


def document(verdict: str, lights: list[dict], **more: Any) -> dict[str, Any]:
    soft = finding("soft-falloff", "info", "Key", "Soft falloff is on.", -0.3)
    return json.loads(DOCUMENT) | {"verdict": verdict, "lights": lights, "findings": [soft]} | more


def pictures(
    factors: dict[str, float], noise: float = 0.02, size: tuple[int, int] = (320, 240)
) -> dict[str, Any]:
    """Return the arrays of a `ReportData` whose witness shows each light times its factor."""
    rng = np.random.default_rng(7)
    width, height = size
    layers = lamps(width, height)
    ours = sum(layers.values())
    witness = sum(layers[name] * factors.get(name, 1.0) for name in layers)
    excluded = np.zeros((height, width), bool)
    excluded[: height // 4, -width // 5 :] = True
    return {
        "ours": ours,
        "witness": witness * (1 + noise * rng.standard_normal((height, width, 1))),
        "excluded": excluded,
        "inside": np.ones((height, width), bool),
        "variance_ours": (0.002 * ours) ** 2,
        "variance_witness": (noise * witness) ** 2,
        "luminance_weights": WEIGHTS,
        "efficacy_lm_W": 683.002,
    }


def agree() -> ReportData:
    lights = [
        light("Key", 1.0003, 0.0009, "agree", energy_fraction=0.78, type="SPOT"),
        light("Fill", 0.9982, 0.0021, "agree", energy_fraction=0.219, type="AREA"),
        light("Exit sign", 1.004, 0.011, "undecided", energy_fraction=0.001, type="MESH", count=12),
    ]
    return ReportData(document("agree", lights), **pictures({}))


def differ() -> ReportData:
    code = "area-four-over-pi"
    fill = light("Fill", 0.785, 0.0021, "differ", energy_fraction=0.219, diagnosis=code)
    made = document("differ", [fill, light("Key", 1.0003, 0.0009, "agree", energy_fraction=0.781)])
    message = "area light powers of before Blender 4.0; predicted 0.7854, measured 0.785 ± 0.0021"
    made["findings"].append(finding(code, "error", "Fill", message, -21.5))
    return ReportData(made, **pictures({"Fill": 0.785}))


def undecided() -> ReportData:
    lights = [
        light("Key", 1.004, 0.009, "undecided", energy_fraction=0.7, group=1),
        light("Fill", 0.985, 0.031, "undecided", energy_fraction=0.3, group=1),
    ]
    made = document("undecided", lights, findings=[])
    return ReportData(made, **pictures({}, 0.6, size=(160, 120)))


def half_excluded() -> ReportData:
    arrays = pictures({}, size=(1010, 570))
    arrays["excluded"][:, 370:] = True
    arrays["inside"][:100] = False
    arrays["witness"][250:260, 50:65] = np.nan
    hair = {"kind": "object", "name": "Curtain", "feature": "hair", "pixels": 901_220}
    coverage = {"supported_pixel_fraction": 0.36, "unsupported": [hair]}
    findings = [
        finding("coverage", "warning", "", "Less than half can be compared.", None),
        finding("driver-blocked", "error", "Fill", "Its power is driven by a script.", -100.0),
    ]
    lights = [light("Key", 1.0, 0.001, "agree"), light("Fill", None, None, "undecided")]
    made = document("undecided", lights, coverage=coverage, findings=findings)
    return ReportData(made, **arrays)


def hostile() -> ReportData:
    names = HOSTILE + [f"Downlight.{i:03}" for i in range(40 - len(HOSTILE))]
    verdicts = ["differ", "agree", "undecided"]
    scales = 1 + 0.03 * np.random.default_rng(3).standard_normal(40)
    scales[0] = 3.84
    lights = [
        light(name, float(scales[i]), 0.002, verdicts[i % 3], energy_fraction=1 / 40, count=i + 1)
        | {"group": i // 20, "diagnosis": name if i % 4 == 0 else None}
        for i, name in enumerate(names)
    ]
    made = document("differ", lights)
    made["scene"] |= {"file": HOSTILE[0] + ".blend", "camera": HOSTILE[1]}
    made["findings"] = [finding("c", "warning", name, f"About {name}.", None) for name in HOSTILE]
    made["coverage"]["unsupported"] = [
        {"kind": "material", "name": name, "feature": name, "pixels": 3} for name in HOSTILE
    ]
    return ReportData(made, **pictures({"Key": 1.1}))


def empty() -> ReportData:
    arrays = pictures({}, size=(16, 9))
    arrays |= {"ours": np.zeros((9, 16, 3)), "witness": np.zeros((9, 16, 3))}
    arrays |= {"variance_witness": None, "excluded": np.ones((9, 16), bool)}
    made = document("undecided", [])
    made["pixels"] |= {"compared": 0}
    made["metrics"] = dict.fromkeys(made["metrics"])
    return ReportData(made, **arrays)


def rivals() -> ReportData:
    made = document("differ", [light("Key", 1.2, 0.01, "differ")])
    made["scene"]["file"] = "a b.blend"
    made["settings"]["overridden"] = {}
    made["witnesses"] = [
        {"name": name, "verdict": verdict} | {k: made[k] for k in ("pixels", "metrics", "lights")}
        for name, verdict in (("Cycles", "differ"), ("Radiance", "agree"))
    ]
    return ReportData(made, **pictures({"Key": 1.2}, size=(64, 48)))


MAKERS = (agree, differ, undecided, half_excluded, hostile, empty, rivals)
SITUATIONS = {make.__name__: make for make in MAKERS}


@functools.cache
def page_of(situation: str) -> str:
    return render_report(SITUATIONS[situation]())


@pytest.fixture(params=SITUATIONS)
def page(request: pytest.FixtureRequest) -> str:
    return page_of(request.param)


class Reader(HTMLParser):
    """Collects text and attributes, and insists that every element is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    return reader


def test_page_is_well_formed_small_and_more_than_colours(page: str) -> None:
    reader = read(page)
    assert reader.open == []
    assert len(page.encode()) < MAX_BYTES
    assert all(word in reader.text for word in ("Agrees", "Differs", "Undecided"))


def test_page_fetches_and_runs_nothing(page: str) -> None:
    reader = read(page)
    assert {tag for tag, _ in reader.tags}.isdisjoint({"script", "link", "iframe", "object", "b:"})
    for tag, attributes in reader.tags:
        assert not any(key.startswith("on") for key in attributes), tag
        assert all(not (value or "").startswith("http") for value in attributes.values())
        assert attributes.get("src", "data:image/").startswith("data:image/")
    css = re.search(r"<style>(.*?)</style>", page, re.S).group(1)
    assert "url(" not in css
    assert "@import" not in css


def test_pictures_have_alternatives_and_sizes(page: str) -> None:
    images = [attributes for tag, attributes in read(page).tags if tag == "img"]
    assert len(images) == 3
    for image in images:
        assert len(image["alt"]) > 30
        assert int(image["width"]) > 0
        payload = base64.b64decode(image["src"].split(",")[1])
        assert payload[:4] in (b"\x89PNG", b"\xff\xd8\xff\xe0")


def test_hostile_names_are_shown_and_harmless() -> None:
    page = page_of("hostile")
    assert "<script" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "\x00" not in page
    assert "\x1b" not in page
    assert "Ctrl␀␛␊name" in page
    assert "49" not in re.search(r"<h2>Findings.*?</section>", page, re.S).group()
    text = read(page).text
    for name in HOSTILE[:4]:
        assert name in text


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (0.98, "is 2.00 % ± 0.20 % too dark"),
        (0.0, "is missing"),
        (-1.0, "has the wrong sign"),
        (4.0, "is 4 times as bright as it should be"),
        (None, "cannot be measured"),
    ],
)
def test_deviation_in_words(scale: float | None, words: str) -> None:
    said = wording.deviation(light("Key", scale, 0.002, "differ"))
    assert said == words.replace(" %", "\u202f%")


@pytest.mark.parametrize(
    ("situation", "said"),
    [
        ("agree", "Cycles agrees with the physics of this scene within 1 %, at 99 % confidence."),
        ("differ", "Cycles differs: light “Fill” is 21.50 % ± 0.21 % too dark."),
        ("undecided", "Undecided: the noise is still too high to tell within 1 %."),
        ("half_excluded", "Undecided: only 36 % of the lit picture could be compared."),
        ("hostile", "14 of 40 lights are off"),
        ("hostile", "3.84 times as bright as it should be"),
        ("hostile", "not told apart from 19 others of group 1"),
        ("hostile", "the plot ends at ± 10 %"),  # one wild light does not flatten the others
        ("differ", "the plot ends at ± 25 %"),
        ("differ", "Cause: area light powers"),
        ("differ", "Area four over pi"),
        ("undecided", "not told apart from Fill"),
        ("undecided", "More samples or a wider --tolerance"),
        ("half_excluded", "--shading clay checks the lights alone"),
        ("half_excluded", "outside the render border"),
        ("agree", "Lights that agree2 of 2"),
        ("agree", "1 too faint to judge"),  # and not undecided
        ("empty", "there is nothing to compare"),
        ("empty", "Nothing in this scene emits"),
        ("rivals", "with the file’s own settings"),
        ("rivals", "RadianceAgrees"),
        ("rivals", "blender-rad check 'a b.blend' --report report"),
        ("rivals", "--camera 'Cam Front' --resolution 320x240"),
    ],
)
def test_words_of_a_situation(situation: str, said: str) -> None:
    assert said in re.sub(r"[ \n\u202f]+", " ", read(page_of(situation)).text)


def test_what_does_not_apply_is_not_said() -> None:
    assert 'class="next"' not in page_of("agree")
    assert "outside the render border" not in page_of("agree")
    assert not re.search(r"\bnan\b", read(page_of("empty")).text)


def test_write_report_leaves_one_file(tmp_path: Any) -> None:
    write_report(tmp_path / "report.html", undecided())
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_sums_of_blocks_with_ragged_edges() -> None:
    values = np.arange(35.0).reshape(5, 7)
    sums = block_sums(values, 4, 0)
    assert sums.shape == (2, 2)
    assert sums[1, 1] == values[4, 4:].sum()
    assert sums.sum() == values.sum()
    assert spread(sums, 4, (5, 7)).shape == (5, 7)


def test_map_is_silent_on_noise_and_shows_a_bias() -> None:
    data = ReportData(document("agree", []), **pictures({}, 0.05))
    relative, tiles = difference(data, 0.01)
    assert np.mean(relative[data.compared] != 0) < 0.01
    assert not tiles.any()
    data = ReportData(document("differ", []), **pictures({"Key": 1.1, "Fill": 1.1}, 0.01))
    relative, tiles = difference(data, 0.01)
    assert np.nanmedian(relative) == pytest.approx(0.1, abs=0.01)
    assert (tiles == 1).mean() > 0.8
    assert np.isnan(relative[data.excluded]).all()
    assert "parts of the picture did not come out right" in render_report(data)


def test_block_noise_is_calibrated_for_independent_pixels() -> None:
    data = ReportData(document("agree", []), **pictures({}, 0.05))
    relative, noise = relative_difference(data, 16)
    whole = block_sums(data.compared.astype(float), 16, 0) == 256
    # variance_ours adds (0.2 %)² that the made-up picture does not have: under 1 % of the noise.
    assert np.std(relative[whole] / noise[whole]) == pytest.approx(1.0, abs=0.15)


def test_outline_runs_around_a_tile_once() -> None:
    mask = np.zeros((2, 2), bool)
    mask[1, 1] = True
    assert outline(mask, (20, 30)) == "M16 16H30M16 20H30M16 16V20M30 16V20"


def test_white_maps_to_white() -> None:
    assert (srgb(np.full((1, 1, 3), 2.0), 2.0, np.eye(3)) == 255).all()
    assert nice_above(1.01e-3) == pytest.approx(1.2e-3)
    data = agree()
    lit = data.luminance(data.ours)
    assert np.mean(lit > white_luminance(data)) <= 0.02
