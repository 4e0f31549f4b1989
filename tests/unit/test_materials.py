# SPDX-License-Identifier: GPL-3.0-or-later
"""The three laws put to scenes built by hand, with what is known of them on paper."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blender_rad.laws import ANGLES_DEG, Judged, judge
from blender_rad.plausible import CHECKER, MEASURED, RANGES
from blender_rad.scene import Closure, Instance, Material, Unsupported
from blender_rad.textures import Expression, constant
from tests import handmade

WHITE = (1.0, 1.0, 1.0)


def closure(kind: str, settings: dict[str, Any] | None = None, **inputs: Any) -> Closure:
    known = {name.replace("_", " "): constant(value) for name, value in inputs.items()}
    return Closure(kind, constant(1.0), known, settings or {})


def judged(*materials: Material, **others: Any) -> list[Judged]:
    floor = others.pop("mesh", handmade.square())
    placed = [Instance(m.name, 0, handmade.moved(k), (k,)) for k, m in enumerate(materials)]
    return judge(handmade.scene([floor], placed, [], materials=list(materials), **others))


def codes(found: Judged) -> dict[str, str]:
    return {finding.code: finding.severity for finding in found.findings}


def phong_albedo(exponent: float, angle_deg: float) -> float:
    """1/cosθ_i ∫ (R·V)ⁿ cosθ_r dω_r over the hemisphere, by Gauss in cosθ_r and the mean over φ."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    up, turn = 0.5 + 0.5 * nodes[:, None], np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    theta = np.radians(angle_deg)
    along = np.sqrt(1.0 - up**2) * np.cos(turn) * np.sin(theta) + up * np.cos(theta)
    inner = (np.maximum(along, 0.0) ** exponent).mean(axis=1) * up[:, 0]
    return float(0.5 * weights @ inner * 2.0 * np.pi / np.cos(theta))


@pytest.mark.parametrize("exponent", [3.0, 40.0])
def test_phong_as_printed_breaks_two_laws_by_what_quadrature_says(exponent):
    phong = closure("PHONG", Color=(0.9, 0.5, 0.1), Exponent=exponent)
    (found,) = judged(Material("shiny", closures=(phong,)))
    exact = np.array([phong_albedo(exponent, angle) for angle in ANGLES_DEG])
    assert np.isclose(exact[0], 2.0 * np.pi / (exponent + 2.0), rtol=1e-6)
    assert found.albedo is not None
    assert np.allclose(found.albedo, exact[:, None] * [0.9, 0.5, 0.1], rtol=0.01)
    assert np.isclose(found.max_albedo, 0.9 * exact[-1], rtol=0.003)
    assert found.max_albedo_angle_deg == ANGLES_DEG[-1]
    assert (found.positive, found.reciprocal, found.energy_conserving) == (True, False, False)
    assert codes(found) == {"gains-energy": "error", "not-reciprocal": "error"}
    assert all("divides by the light's cosine" in finding.message for finding in found.findings)
    (gain,) = (f.effect_percent for f in found.findings if f.code == "gains-energy")
    assert gain == pytest.approx(100.0 * (found.max_albedo - 1.0))


def test_phongs_that_are_brdfs_keep_the_laws_and_reach_one():
    kinds = ("PHONG_MODIFIED", "BLINN")
    white = [closure(kind, Color=WHITE, Exponent=n) for kind in kinds for n in (0.0, 300.0)]
    materials = [Material(f"{k}", closures=(each,)) for k, each in enumerate(white)]
    for found in judged(*materials):
        assert (found.positive, found.reciprocal, found.energy_conserving) == (True, True, True)
        assert found.max_albedo == pytest.approx(1.0, abs=2e-3)
        assert not found.findings


def test_lambert_as_printed_lacks_a_pi_and_what_is_not_known_is_not_judged():
    negative = closure("PHONG_MODIFIED", Color=(0.5, -0.1, 0.5), Exponent=2.0)
    printed, dark, *others = judged(
        Material("printed", albedo=(np.pi * 0.5, 0.1, 0.1)),
        Material("negative", closures=(negative,)),
        Material("fog", unsupported=(Unsupported("material", "fog", "Volume"),)),
        Material("toon", closures=(closure("ShaderNodeBsdfToon"),)),
        Material("seen", measured=True),
    )
    assert printed.max_albedo == pytest.approx(np.pi * 0.5, rel=1e-6)
    assert codes(printed)["gains-energy"] == "error" and printed.reciprocal
    assert dark.positive is False and codes(dark)["not-positive"] == "error"
    for each in others:
        assert not each.supported and codes(each) == {"unsupported": "info"}
        assert each.positive is each.max_albedo is each.albedo is None


def test_where_a_texture_breaks_the_law_is_told():
    mesh = handmade.square(2.0)
    colours = np.array([[[1.3, 0.2, 0.2, 1]], [[0.1, 0.1, 0.1, 1]]], np.float32)
    mesh.attributes["Paint"] = colours.repeat(3, axis=1)
    coloured = closure("ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}, Roughness=0.0)
    paint = Expression("ShaderNodeVertexColor", "Color", {"layer_name": "Paint"})
    coloured.inputs["Color"] = paint
    (found,) = judged(Material("paint", closures=(coloured,)), mesh=mesh)
    assert found.max_albedo == pytest.approx(1.3, rel=1e-6), "float32"
    (finding,) = found.findings
    assert finding.code == "gains-energy" and "Color is 1.3" in finding.message
    x, y = (float(each.strip(" ()")) for each in finding.message.split("(")[1].split(",")[:2])
    assert y <= x, "the first triangle is below the diagonal"


def test_what_blender_breaks_by_construction_is_no_error():
    inputs = {"Base_Color": WHITE, "Metallic": 1.0, "Roughness": 1.0, "IOR": 1.5, "Alpha": 1.0}
    inputs["Specular_Tint"] = 1.0
    white = closure("ShaderNodeBsdfPrincipled", {"distribution": "MULTI_GGX"}, **inputs)
    white.inputs["Coat Normal"] = Expression("ShaderNodeNewGeometry", "Normal")
    brighter = replace(white, weight=constant(1.1))
    one, more = judged(Material("one", closures=(white,)), Material("more", closures=(brighter,)))
    assert codes(one) == {"gains-energy": "info", "not-reciprocal": "info"}
    assert one.furnace is not None and np.allclose(one.furnace, 1.0, atol=0.015)
    assert codes(more)["gains-energy"] == "error", "even where it is seen"


@pytest.mark.parametrize(
    ("kind", "inputs", "code"),
    [
        ("ShaderNodeBsdfTranslucent", {"Color": (0.98,) * 3}, "reflectance-high"),
        ("ShaderNodeBsdfTranslucent", {"Color": (0.001,) * 3}, "reflectance-low"),
        ("ShaderNodeBsdfTranslucent", {"Color": (0.5,) * 3}, None),
        ("ShaderNodeBsdfGlass", {"Color": WHITE, "Roughness": 0.0, "IOR": 3.4}, "ior-high"),
        ("ShaderNodeBsdfGlass", {"Color": WHITE, "Roughness": 0.0, "IOR": 0.7}, "ior-low"),
    ],
)
def test_numbers_that_no_surface_has(kind, inputs, code):
    entry = closure(kind, {"distribution": "GGX"}, **inputs)
    (found,) = judged(Material("odd", closures=(entry,)))
    assert {c for c in codes(found) if c.rpartition("-")[2] in {"low", "high"}} == {code} - {None}


def test_the_table_of_what_was_measured():
    colour = pytest.importorskip("colour")
    chart = colour.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"].data
    luminances = {name.split(" (")[0]: float(xyy[2]) for name, xyy in chart.items()}
    for rows in MEASURED.values():
        assert [row.value for row in rows] == sorted(row.value for row in rows)
        for row in rows:
            if row.source == CHECKER:
                name = row.name.removesuffix(" of the ColorChecker")
                assert row.value == pytest.approx(luminances[name], rel=5e-3)
    assert RANGES.keys() == MEASURED.keys()
