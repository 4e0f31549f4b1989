# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of lights, and the notes on what Blender's numbers hide, from records made by hand."""

from typing import Any

import numpy as np
import pytest

from blender_rad.errors import Finding
from blender_rad.inspection import PHOTOPIC, inspect_lights
from blender_rad.lights import LightRecord, SkyMap
from blender_rad.quantities import K_M
from blender_rad.scene import Instance, Linking, Material, World
from tests.handmade import ball, moved, scene, square

STRENGTH = 10.0


def record(kind: str = 'POINT', *, name: str = "Lamp", scale: Any = 1.0, **given: Any) -> Any:
    own = {k: given.pop(k) for k in ("shown", "unknown", "unit_scale_m") if k in given}
    properties = {"energy": STRENGTH, "color": (1.0, 1.0, 1.0), "shape": 'SQUARE', "size": 0.5}
    properties |= {"spot_size": np.pi / 3, "shadow_soft_size": 0.0} | given
    matrix = np.diag([*np.broadcast_to(scale, 3), 1.0])
    metre = own.pop("unit_scale_m", 1.0)
    return LightRecord(name, kind, properties, matrix, metre, (4, 5, 0), data="Lamp data", **own)


def inspect(*records: LightRecord, efficacy: float = 1.0, **others: Any) -> Any:
    made = scene([], [], [], light_records=records, **others)
    rows, findings = inspect_lights(made, efficacy)
    return rows[0], findings


NOTES = {
    "the cone takes (1 - cos 30°)/2": (record('SPOT'), "60° cone", "6.7 % of its power"),
    "soft falloff": (record(shadow_soft_size=0.5), "soft falloff", "gives 80 % of"),
    "exposure": (record(exposure=2.0), "exposure 2", "makes its 10 40"),
    "negative": (record(energy=-3.0), "below 0", "takes light away"),
    "colour": (record(color=(0.0, 0.0, 1.0)), "colour", "0.0722 times the lm and 0.333 times"),
    "temperature": (
        record(use_temperature=True, temperature=500.0, temperature_color=(3.0, 0.5, 0.1)),
        "500 K, as at 800 K, where colours end",
        "1 times the lm and 1.2 times the W",
    ),
    "spread": (record('AREA', spread=1.0), "57.3° spread gathers", "11.8 times as bright"),
    "beam": (record('AREA', spread=0.0), "parallel beam", "no intensity"),
    "scaled area": (record('AREA', scale=(2, 1, 1)), "object's scale", "1 × 0.5 m"),
    "no shadow": (record(use_shadow=False), "casts no shadow", "behind walls"),
    "strength zero": (record(energy=0.0), "emits nothing", "strength is 0"),
    "hidden": (record(shown=False), "emits nothing", "hidden in renders"),
    "portal": (record('AREA', **{"cycles.is_portal": True}), "emits nothing", "portal"),
    "flat": (record('AREA', scale=(1, 0, 1)), "emits nothing", "scale is 0"),
    "unknown": (record(unknown="Light Falloff"), "not known", "Light Falloff"),
}


@pytest.mark.parametrize("case", NOTES)
def test_a_note_says_what_the_number_hides(case):
    entry, *fragments = NOTES[case]
    row, _ = inspect(entry)
    assert any(all(f in note for f in fragments) for note in row["notes"]), row["notes"]
    plain, _ = inspect(record(entry.bl_type, spot_size=2.0))
    assert not {note for note in row["notes"] if fragments[1] in note} & set(plain["notes"])
    dark = "emits nothing" in fragments
    assert (row["radiant_flux_W"] == 0.0) == dark
    assert (row["radiant_flux_W"] is None) == (case == "unknown" or entry.bl_type == 'SUN')


def test_findings_by_object_or_data_are_notes_and_linking_is_named():
    blocked = Finding("blocked-driver", "warning", "Lamp data", "the driver of energy cannot run")
    elsewhere = Finding("motion-blur", "info", "", "motion blur is on")
    linking = {"Lamp": Linking(np.ones(1, bool), np.zeros(1, bool))}
    row, _ = inspect(record(), findings=(blocked, elsewhere), linking=linking)
    assert row["notes"][0] == blocked.message and "chosen objects" in row["notes"][1]
    assert len(row["notes"]) == 2 and row["radiant_flux_W"] == STRENGTH


@pytest.mark.parametrize("model", ["cycles", "physical"])
def test_unit_scale_gives_both_figures(model):
    scaled = record('AREA', unit_scale_m=0.1)
    row, findings = inspect(scaled, unit_scale_m=0.1, model=model)
    cycles, physical = 0.01 * STRENGTH, STRENGTH
    expected = (cycles, physical) if model == "cycles" else (physical, cycles)
    assert (row["radiant_flux_W"], row["other_model_radiant_flux_W"]) == pytest.approx(expected)
    assert row["blender_energy"] == STRENGTH
    (finding,) = findings
    assert finding.code == "unit-scale" and "its 10 W" in finding.message
    assert "as 0.1 W would" in finding.message and finding.effect_percent == pytest.approx(-99.0)
    assert finding.message in row["notes"]
    assert not inspect(record('SUN', unit_scale_m=0.1), unit_scale_m=0.1, model=model)[1]


def test_instances_are_one_row_with_the_mean_flux_of_a_piece():
    small, large = record('AREA', normalize=False), record('AREA', normalize=False, scale=(2, 1, 1))
    row, _ = inspect(small, large)
    assert row["count"] == 2 and row["radiant_flux_W"] == pytest.approx(STRENGTH * 0.25 * 1.5)
    assert row["peak_radiant_intensity_W_sr"] == pytest.approx(STRENGTH * 0.5 / np.pi)
    assert any("2 instances differ, 2.5 to 5 W" in note for note in row["notes"])


def test_a_glowing_ball_and_nothing_at_all():
    glow = Material("glow", emission=(2.0, 2.0, 2.0))
    placed = [Instance("Globe", 0, moved(x=x), (0,)) for x in (0.0, 5.0, 9.0)]
    rows, _ = inspect_lights(scene([ball()], placed, [], materials=[glow]), efficacy=K_M)
    (row,) = rows
    assert (row["type"], row["count"], row["blender_energy"]) == ('MESH', 3, None)
    assert row["radiant_flux_W"] == pytest.approx(2.0 * np.pi * 4.0 * np.pi, rel=3e-3)
    assert row["luminance_cd_m2"] == pytest.approx(2.0 * K_M)
    assert row["notes"][0].startswith("closed or hollow: 50 %")
    rows, findings = inspect_lights(scene([], [], []), efficacy=1.0)
    assert rows == [] and [f.code for f in findings] == ['nothing-emits']


def test_colour_temperature_and_the_spectrum_to_choose():
    white, _ = inspect(record(energy=100.0), efficacy=K_M)
    assert white["luminous_flux_lm"] == pytest.approx(68_300.2)
    assert white["correlated_colour_temperature_K"] == pytest.approx(6504.0, abs=2.0)
    assert PHOTOPIC in white["notes"] and any("like LED-B5" in note for note in white["notes"])
    sun, _ = inspect(record('SUN'), efficacy=K_M)
    assert any("like D65" in note for note in sun["notes"])
    blue, _ = inspect(record(color=(0.0, 0.0, 1.0)), efficacy=K_M)
    assert blue["correlated_colour_temperature_K"] is None
    assert blue["nominal"] and blue["radiant_flux_W"] == pytest.approx(STRENGTH / 3.0)
    assert blue["luminous_flux_lm"] == pytest.approx(K_M * STRENGTH * 0.0721923, rel=1e-6)
    assert PHOTOPIC not in inspect(record(), efficacy=179.0)[0]["notes"]


def test_a_sky_and_its_sun_are_one_row():
    """E of both on a surface that looks up, and the radiance of the sun."""
    dim = np.full((16, 32, 3), 0.5, dtype=np.float32)
    spot = np.pad(np.full((14, 14, 3), 900.0, dtype=np.float32), ((1, 1), (1, 1), (0, 0)))
    up = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    maps = SkyMap(dim, np.eye(3)), SkyMap(spot, up, (0.02, 0.02))
    row = inspect_lights(scene([square()], [], [], world=World(maps=maps)), 1.0)[0][0]
    assert row["count"] == 1
    assert row["radiance_W_m2_sr"] == pytest.approx(900.0)
    expected = 0.5 * np.pi + 900.0 * (0.04 * 14 / 16) ** 2
    assert row["irradiance_W_m2"] == pytest.approx(expected, rel=5e-3)
    assert any("by direction" in note for note in row["notes"])
