# SPDX-License-Identifier: GPL-3.0-or-later
"""The report page: situations of a made-up comparison, and what may never go wrong in them."""

import base64
import functools
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from blender_rad.compare.pools import block_sums
from blender_rad.report import ReportData, render_report, wording
from blender_rad.report.difference import difference, outline, relative_difference
from blender_rad.report.pictures import srgb, white_luminance
from tests.unit.compare_simulation import layer

HOSTILE = [
    "<script>alert(1)</script>", "\" onload='x' & <b>bold</b>", "مصباح القراءة",
    "abc\u202egnp.exe", "Ctrl\x00\x1b\nname", "💡✨ Küche 台所", "L" * 300,
    "https://evil.example/x.png", "lone \udc80 surrogate", "{{ 7 * 7 }}",
]  # fmt: skip
VOID = {"meta", "img", "br", "link", "input", "hr"}
LAMPS = {"Key": layer(14.0, 20.0, (6.0, 5.0, 4.0)), "Fill": layer(50.0, 30.0, (1.0, 1.2, 1.6))}
LIGHT = {"type": "POINT", "count": 1, "group": None, "energy_fraction": 0.5, "diagnosis": None}
DOCUMENT = {
    "scene": {"file": "a b.blend", "sha256": "9f2c", "frame": 24, "camera": "Cam Front",
              "resolution": [320, 240], "unit_scale_m": 1.0},
    "versions": {"blender_rad": "0.1.0", "blender": "4.5", "numpy": "1.26", "embree": "4.3"},
    "settings": {"tolerance": 0.01, "confidence": 0.99, "model": "cycles", "shading": "full",
                 "efficacy_lm_W": 683.002, "samples": 16, "cycles_samples": 512, "cycles_seeds": 8,
                 "asked": {"--witness-scene": ["b c.blend"]},
                 "overridden": {"cycles.max_bounces": {"file": 12, "used": 0}}},
    "pixels": {"compared": 99, "agree": 90, "differ": 1, "undecided": 8, "excluded": 15},
    "metrics": {"energy_ratio": 0.99987, "mean_signed_relative_error": -0.00013,
                "p95_absolute_relative_error": 0.0121, "relmse": 3.21e-5},
    "coverage": {"supported_pixel_fraction": 0.98, "unsupported": []},
    "witnesses": [],
    "seconds": {"read": 0.4, "ours": 3.1, "cycles": 11.8, "compare": 0.6, "report": 0.4},
}  # fmt: skip


def light(name: str, scale: float | None, error: float | None, verdict: str, **more: Any) -> dict:
    measured = {"name": name, "scale_in_witness": scale, "standard_error": error}
    return LIGHT | measured | {"verdict": verdict} | more


def finding(code: str, severity: str, thing: str, message: str) -> dict:
    named = {"code": code, "severity": severity, "object": thing, "message": message}
    return named | {"effect_percent": -21.5}


def made(
    verdict: str, lights: list[dict], *findings: dict, noise: float = 0.02,
    factors: dict[str, float] | None = None, arrays: dict[str, Any] | None = None, **more: Any,
) -> ReportData:  # fmt: skip
    """A report whose witness shows each light times its factor."""
    ours = np.asarray(sum(LAMPS.values()))
    witness = np.asarray(sum(v * (factors or {}).get(n, 1.0) for n, v in LAMPS.items()))
    excluded = np.zeros(ours.shape[:2], bool)
    excluded[:12, -12:] = True
    z = np.random.default_rng(7).standard_normal((*excluded.shape, 1))
    known = {
        "ours": ours,
        "witness": witness * (1 + noise * z),
        "excluded": excluded,
        "inside": np.ones_like(excluded),
        "variance_ours": (0.002 * ours) ** 2,
        "variance_witness": (noise * witness) ** 2,
    }
    document = DOCUMENT | {"verdict": verdict, "lights": lights, "findings": list(findings)}
    weights = (0.2126390058715104, 0.7151686787677559, 0.0721923153607337)
    document |= {key: DOCUMENT[key] | value for key, value in more.items()}
    return ReportData(document, **known | (arrays or {}), luminance_weights=weights,
                      efficacy_lm_W=683.002)  # fmt: skip


def agree() -> ReportData:
    faint = light("Exit sign", 1.004, 0.011, "undecided", energy_fraction=0.001, count=12)
    both = [light("Key", 1.0003, 0.0009, "agree"), light("Fill", 0.9982, 0.0021, "agree")]
    return made("agree", [*both, faint])


def differ() -> ReportData:
    fill = light("Fill", 0.785, 0.0021, "differ", diagnosis="area-four-over-pi")
    why = finding("area-four-over-pi", "error", "Fill", "area light powers of before Blender 4.0")
    return made("differ", [fill, light("Key", 1.0, 0.001, "agree")], why, factors={"Fill": 0.785})


def undecided() -> ReportData:
    pair = [light(name, 1.004, 0.009, "undecided", group=1) for name in ("Key", "Fill")]
    return made("undecided", pair, noise=0.6)


def late() -> ReportData:
    key = light("Key", 1.1, 0.001, "differ", diagnosis="scale")
    why = finding("scale", "error", "Key", "no known cause; 1.1 ± 0.001 times ours")
    message = "the time limit came after 9 of the first 16 pictures"
    return made("undecided", [key], why, finding("out-of-time", "warning", "", message))


def half_excluded() -> ReportData:
    arrays = {name: np.zeros((48, 64), bool) for name in ("excluded", "inside")}
    arrays["excluded"][:, 23:], arrays["inside"][8:] = True, True
    hair = {"kind": "object", "name": "Curtain", "feature": "hair", "pixels": 901_220}
    coverage = {"supported_pixel_fraction": 0.36, "unsupported": [hair]}
    blocked = finding("driver-blocked", "error", "Fill", "Its power is driven by a script.")
    lights = [light("Key", 1.0, 0.001, "agree"), light("Fill", None, None, "undecided")]
    return made("undecided", lights, blocked, arrays=arrays, coverage=coverage)


def hostile() -> ReportData:
    scales = 1 + 0.03 * np.random.default_rng(3).standard_normal(40)
    scales[0] = 3.84
    names = HOSTILE + [f"Downlight.{i:03}" for i in range(30)]
    lights = [
        light(name, float(scale), 0.002, ["differ", "agree", "undecided"][i % 3], group=i // 20)
        | {"energy_fraction": 1 / 40, "diagnosis": name if i % 4 == 0 else None}
        for i, (name, scale) in enumerate(zip(names, scales, strict=True))
    ]
    found = [finding("c", "warning", name, f"About {name}.") for name in HOSTILE]
    left = [{"kind": "material", "name": name, "feature": name, "pixels": 3} for name in HOSTILE]
    scene, coverage = {"file": HOSTILE[0], "camera": HOSTILE[1]}, {"unsupported": left}
    return made("differ", lights, *found, factors={"Key": 1.1}, scene=scene, coverage=coverage)


def empty() -> ReportData:
    dark = {name: np.zeros((9, 16, 3)) for name in ("ours", "witness", "variance_ours")}
    flat = {"variance_witness": None, "excluded": np.ones((9, 16), bool)}
    arrays = dark | flat | {"inside": np.ones((9, 16), bool)}
    metrics = dict.fromkeys(DOCUMENT["metrics"])
    return made("undecided", [], arrays=arrays, pixels={"compared": 0}, metrics=metrics)


def rivals() -> ReportData:
    data = made("differ", [light("Key", 1.2, 0.01, "differ")], factors={"Key": 1.2})
    data.document["settings"] = data.document["settings"] | {"overridden": {}}
    own = {key: data.document[key] for key in ("pixels", "metrics", "lights")}
    both = (("Cycles", "differ"), ("Radiance", "agree"))
    data.document["witnesses"] = [{"name": n, "verdict": verdict} | own for n, verdict in both]
    return data


MAKERS = (agree, differ, undecided, late, half_excluded, hostile, empty, rivals)
SITUATIONS = {make.__name__: make for make in MAKERS}


class Reader(HTMLParser):
    """Collects text and attributes, and insists that every element is closed in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(page)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in VOID or self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@functools.cache
def page_of(situation: str) -> str:
    return render_report(SITUATIONS[situation]())


def text_of(situation: str) -> str:
    return re.sub(r"[ \n\u202f]+", " ", Reader(page_of(situation)).text)


@pytest.mark.parametrize("situation", SITUATIONS)
def test_page_is_whole_and_fetches_and_runs_nothing(situation):
    page = page_of(situation)
    reader = Reader(page)
    assert len(page.encode()) < 3_000_000
    assert all(word in reader.text for word in ("Agrees", "Differs", "Undecided"))
    assert {tag for tag, _ in reader.tags}.isdisjoint({"script", "link", "iframe", "object"})
    for tag, attributes in reader.tags:
        assert not any(key.startswith("on") for key in attributes), tag
        assert all(not (value or "").startswith("http") for value in attributes.values())
    css = re.search(r"<style>(.*?)</style>", page, re.S).group(1)
    assert "url(" not in css and "@import" not in css
    images = [attributes for tag, attributes in reader.tags if tag == "img"]
    assert len(images) == 3
    for image in images:
        assert len(image["alt"]) > 30 and int(image["width"]) > 0
        head, payload = image["src"].split(",")
        assert head.startswith("data:image/")
        assert base64.b64decode(payload)[:4] in (b"\x89PNG", b"\xff\xd8\xff\xe0")


def test_hostile_names_are_shown_and_harmless():
    page = page_of("hostile")
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page and "Ctrl␀␛␊name" in page
    assert not any(bad in page for bad in ("<script", "\x00", "\x1b"))
    assert "49" not in re.search(r"<h2>Findings.*?</section>", page, re.S).group()
    text = Reader(page).text
    assert all(name in text for name in HOSTILE[:4])


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
def test_deviation_in_words(scale, words):
    said = wording.deviation(light("Key", scale, 0.002, "differ"))
    assert said == words.replace(" %", "\u202f%")


@pytest.mark.parametrize(
    ("situation", "said"),
    [
        ("agree", "Cycles agrees with the physics of this scene within 1 %, at 99 % confidence."),
        ("agree", "1 too faint to judge"),  # and not undecided
        ("differ", "Cycles differs: light “Fill” is 21.50 % ± 0.21 % too dark."),
        ("differ", "Cause: area light powers"),
        ("undecided", "Undecided: the noise is still too high to tell within 1 %."),
        ("undecided", "or a wider --tolerance"),
        ("late", "Undecided: the time limit came after 9 of the first 16 pictures."),
        ("late", "So far light “Key” is 10.00 % ± 0.10 % too bright."),
        ("half_excluded", "Undecided: only 36 % of the lit picture could be compared."),
        ("half_excluded", "--shading clay checks the lights alone"),
        ("hostile", "14 of 40 lights are off"),
        ("hostile", "3.84 times as bright as it should be"),
        ("hostile", "not told apart from 19 others of group 1"),
        ("hostile", "the plot ends at ± 10 %"),  # one wild light does not flatten the others
        ("empty", "there is nothing to compare"),
        ("rivals", "RadianceAgrees"),
        ("rivals", "blender-rad check 'a b.blend' --report report"),
        ("rivals", "--camera 'Cam Front' --resolution 320x240"),
        ("rivals", "--witness-scene 'b c.blend'"),
        ("rivals", "--witness-scene b c.blend"),
    ],
)
def test_words_of_a_situation(situation, said):
    assert said in text_of(situation)


def test_what_does_not_apply_is_not_said():
    assert 'class="next"' not in page_of("agree")
    assert "outside the render border" not in page_of("agree")
    assert not re.search(r"\bnan\b", text_of("empty"))


def test_map_is_silent_on_calibrated_noise_and_shows_a_bias():
    data = made("agree", [], noise=0.05)
    relative, tiles = difference(data, 0.01)
    assert np.mean(relative[data.compared] != 0) < 0.01 and not tiles.any()
    relative, noise = relative_difference(data, 4)
    whole = block_sums(data.compared.astype(float), 4, 0) == 16
    # variance_ours adds (0.2 %)² that the made-up picture does not have: under 1 % of the noise.
    assert np.std(relative[whole] / noise[whole]) == pytest.approx(1.0, abs=0.15)
    data = made("differ", [], noise=0.01, factors={"Key": 1.1, "Fill": 1.1})
    relative, tiles = difference(data, 0.01)
    assert np.nanmedian(relative) == pytest.approx(0.1, abs=0.01)
    assert (tiles == 1).mean() > 0.8 and np.isnan(relative[data.excluded]).all()
    assert "parts of the picture did not come out right" in render_report(data)


def test_outline_runs_around_a_tile_once_and_white_maps_to_white():
    mask = np.zeros((2, 2), bool)
    mask[1, 1] = True
    assert outline(mask, (20, 30)) == "M16 16H30M16 20H30M16 16V20M30 16V20"
    assert (srgb(np.full((1, 1, 3), 2.0), 2.0, np.eye(3)) == 255).all()
    data = agree()
    assert np.mean(data.luminance(data.ours) > white_luminance(data)) <= 0.02
