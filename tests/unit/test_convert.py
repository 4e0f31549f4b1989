# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb: what it prints, and that bad input is one line and exit code 2."""

from __future__ import annotations

import json

import pytest

import blender_rad
from blender_rad import cli


def test_the_document(capsys: pytest.CaptureFixture[str]) -> None:
    line = "convert 100 W --to lx --emitter spot --cone 60 --blend 0 --distance 2 --json"
    assert cli.run([*line.split(), "--spectrum", "LED-B3", "--limits", "400,700"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["value"] == pytest.approx(100 * 326.3 / 0.8418 / 4, rel=1e-3)
    assert (document["unit"], document["quantity"]) == ("lx", "illuminance")
    assert document["from"] == {"value": 100.0, "unit": "W", "quantity": "radiant_flux"}
    assert document["efficacy_lm_W"] == pytest.approx(326.3, rel=1e-3)
    assert "400–700 nm" in document["formula"]
    light = document["spectrum"]
    assert (light["name"], light["limits_nm"]) == ("LED-B3", [400.0, 700.0])
    assert light["correlated_colour_temperature_K"] == pytest.approx(4103, rel=2e-3)
    assert blender_rad.convert(
        100, "W", to="lx", emitter="spot", cone=60, blend=0, distance=2, spectrum="LED-B3",
        limits=(400, 700),
    ) == document  # fmt: skip


@pytest.mark.parametrize(
    ("line", "start"),
    [
        ("1 W --to lm --efficacy photopic", "683.002 lm luminous flux"),
        ("-3 EV100 --to cd/m2", "0.015625 cd/m2 luminance"),
        ("f/8,1/125,ISO100 EV100 --to nit", "1000 nit"),
        ("solar-constant W/m2 --to W --emitter sun --area 1", "1361 W"),
        ("solar-constant-1971 W/m2 --to W/m2", "1353 W"),
        ("1 lm --to cd --emitter area --spread 180", "0.3183099 cd"),
        ("3 cd/m² --to nit", "3 nit"),
    ],
)
def test_people_get_a_line_and_its_formula(
    line: str, start: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["convert", *line.split()]) == 0
    first, formula = capsys.readouterr().out.splitlines()
    assert first.startswith(start)
    assert "=" in formula


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("nan lm --to cd", "'nan' is not allowed, VALUE"),
        ("f/8,1/0,ISO100 EV100 --to nit", "VALUE"),
        ("solar-constant lx --to W/m2", "UNIT, expected W/m2"),
        ("1 lm", "--to"),
        ("1 lm --to lx --emitter point --distance 0", "--distance, expected a number above 0"),
        ("1 lm --to cd --emitter spot --cone 181", "--cone, expected degrees above 0, up to 180"),
        ("1 lm --to cd --emitter spot --cone 0", "--cone, expected degrees above 0"),
        ("1 lm --to cd --emitter spot --cone 60 --blend 1.1", "--blend, expected 0 to 1"),
        ("1 W --to lm --spectrum D65 --efficacy 179", "exclude each other"),
        ("1 W --to lm --limits 400,700", "expected --spectrum as well"),
        ("1 lm --to W --spectrum laser:1064", "no finite number of W"),
    ],
)
def test_bad_input_is_one_line(line: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["convert", *line.split()]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("blender-rad: error: ")
    assert words in err
