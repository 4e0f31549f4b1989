# SPDX-License-Identifier: GPL-3.0-or-later
"""Photometric files: real ones, hand-made ones whose light is known, and hostile ones."""

import csv
import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blender_rad import cli
from blender_rad.errors import RadError
from blender_rad.lights import LightRecord, light_from_record
from blender_rad.photometry import Distribution, as_ies, parse_photometry, read_photometry

DATA = Path(__file__).parents[3] / "shared" / "data"
FILES = sorted([*DATA.glob("ies/*.[iI][eE][sS]"), *DATA.glob("ldt/*")])
needs_files = pytest.mark.skipif(not FILES, reason="needs the real files, which are not ours")
# The one file that is not valid: it lacks the record of ballast factor and watts.
REFUSED = "luxera__tilt_file_variant.ies"

GRID = {
    "C": (np.linspace(0, 180, 37), np.linspace(0, 360, 25)),
    "B": (np.linspace(-180, 180, 73), np.linspace(-90, 90, 73)),
    "A": (np.linspace(-90, 90, 73), np.linspace(-180, 180, 73)),
}
PEAK = 1000.0
# What of x, y, z a light may depend on, by EULUMDAT's indicators: in 2, C0–C180 is the mirror.
SYMMETRIES = {
    "none": (1, 1, 1),
    "axial": (0, 0, 1),
    "C0-C180": (1, 0, 1),
    "C90-C270": (0, 1, 1),
    "C0-C180 and C90-C270": (0, 0, 1),
}
COARSE = 8e-3  # steps of 15°: h²/8 of the part that turns, over the least intensity


def towards(kind: str, vertical: np.ndarray, horizontal: np.ndarray) -> np.ndarray:
    """Return unit vectors (n_horizontal, n_vertical, 3): x is C0 or up, −y is right, −z is aim."""
    h, v = np.radians(np.meshgrid(horizontal, vertical, indexing="ij"))
    if kind == "C":
        parts = np.sin(v) * np.cos(h), np.sin(v) * np.sin(h), -np.cos(v)
    elif kind == "B":
        parts = np.cos(h) * np.sin(v), -np.sin(h), -np.cos(h) * np.cos(v)
    else:
        parts = np.sin(v), -np.cos(v) * np.sin(h), -np.cos(v) * np.cos(h)
    return np.stack(parts, axis=-1)


def smooth(d: np.ndarray) -> np.ndarray:
    """Return an intensity without any symmetry; its flux is 4π · PEAK."""
    return PEAK * (1 + 0.3 * d[..., 0] + 0.2 * d[..., 1] - 0.4 * d[..., 2])


def lambertian(d: np.ndarray) -> np.ndarray:
    return PEAK * np.maximum(-d[..., 2], 0.0)


def ies(
    intensity: Any = smooth, kind: str = "C", grid: Any = None, *, first: str = "IESNA:LM-63-2002",
    lamps: str = "1 -1 1", factors: str = "1 1 50", size: str = "0.1 0.2 0",
    tilt: str = "TILT=NONE",
) -> str:  # fmt: skip
    vertical, horizontal = GRID[kind] if grid is None else map(np.asarray, grid)
    table = intensity(towards(kind, vertical, horizontal))
    counts = f"{len(vertical)} {len(horizontal)} {'CBA'.index(kind) + 1} 2"
    rows = [first, "[LUMINAIRE] hand-made", tilt, f"{lamps} {counts} {size}", factors]
    rows += [" ".join(map(str, row)) for row in (vertical, horizontal, *table)]
    return "\n".join(rows) + "\n"


def ldt(symmetry: int = 0, planes: Any = None, **changes: str) -> str:
    """Return a file of 1000 lm with what `symmetry` leaves of `smooth`; changes by line."""
    planes = np.arange(0, 360, 15) if planes is None else planes
    gamma = np.linspace(0, 180, 37)
    first, last = {0: (0, 359), 1: (0, 0), 2: (0, 180), 3: (-90, 90), 4: (0, 90)}[symmetry]
    turned = np.sort(np.where(planes > last, planes - 360, planes))
    kept = turned[(turned >= first) & (turned <= last)] if symmetry else planes
    table = smooth(towards("C", gamma, kept) * [*SYMMETRIES.values()][symmetry])
    header = ["maker", "1", symmetry, len(planes), 15, 37, 5, "report", "lamp", "1", "f", "day"]
    header += [300, 0, 50, 100, 50, 0, 0, 0, 0, 50, 100, 1, 0, 1, 1, "LED", 1000, "", "", 20]
    lines = [str(value) for value in [*header, *[0] * 10, *planes, *gamma, *table.ravel()]]
    for line, text in changes.items():
        lines[int(line[1:]) - 1] = text
    return "\n".join(lines)


def parse(text: str | bytes, name: str = "a.ies", **options: Any) -> Distribution:
    return parse_photometry(text.encode() if isinstance(text, str) else text, name, **options)


def codes(light: Distribution, *severities: str) -> set[str]:
    return {f.code for f in light.findings if not severities or f.severity in severities}


@pytest.fixture
def directions(rng: np.random.Generator) -> np.ndarray:
    vectors = rng.normal(size=(500, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


# Real files


@needs_files
def test_real_files_are_read_or_refused_with_line_and_reason():
    for path in FILES:
        if path.name == REFUSED:
            with pytest.raises(RadError, match="line 9, expected"):
                read_photometry(path)
            continue
        light = read_photometry(path)
        assert 0 < light.luminous_flux() < 1e5
        assert light.interpolated_flux() == pytest.approx(light.luminous_flux(), rel=0.06)
        beam, field = light.beam_angle_deg(0), light.beam_angle_deg(0, 0.1)
        assert 5 < (beam or 0) <= (field or 0) <= 360, path


@needs_files
def test_fluxes_are_those_of_independent_sums_and_of_photometric_toolbox():
    rows = re.findall(r"^\| (\S+\.(?:ies|IES)) \|(.*)", (DATA / "README.md").read_text(), re.M)
    stated = {name: cells.split("|")[7].strip() for name, cells in rows}
    stated = {name: (float(flux), 1e-5) for name, flux in stated.items() if flux != "-"}
    assert len(stated) > 25
    lines = (DATA / "reference" / "photometric_toolbox_lumens.csv").read_text().splitlines()
    toolbox = {row["file"]: row["photometric_toolbox_lm"] for row in csv.DictReader(lines)}
    printed = {name: (float(flux), 0.01 / float(flux)) for name, flux in toolbox.items()}
    flood = {"CU__flood_2.1.IES": (10680.0, 1e-4)}  # of type B
    for name, (flux, rel) in [*stated.items(), *printed.items(), *flood.items()]:
        light = read_photometry(DATA / "ies" / name)
        unit = 1e3 if light.radiometric else 1.0
        assert light.luminous_flux() * unit == pytest.approx(flux, rel=rel), name


@needs_files
def test_ies_and_ldt_of_one_luminaire_agree(directions):
    one = read_photometry(DATA / "ies" / "luxpy__luxpy_test_lid_file.ies")
    other = read_photometry(DATA / "ldt" / "luxpy__luxpy_test_lid_file.ldt")
    a, b = one.luminous_intensity(directions), other.luminous_intensity(directions)
    np.testing.assert_allclose(a, b, atol=0.04)  # two decimals of cd/klm, 6 klm
    assert one.opening == other.opening


LIARS = {
    "ies/guv-calcs__B1_module.ies": {"flux-mismatch"},
    "ies/luxpy__luxpy_test_lid_file2t.ies": {"more-than-lamps"},
    "ies/photompy__type_a_symmetric.ies": {"efficacy"},
    "ldt/photometric-viewer__symmetry_to_c0c180.ldt": {"flux-mismatch"},
    "ies/CU__flood_2.1.IES": set(),
}


@needs_files
def test_real_files_that_lie_are_found_out():
    assert {name: codes(read_photometry(DATA / name), "error") for name in LIARS} == LIARS


# Light that is known


@pytest.mark.parametrize("kind", "ABC")
def test_every_type_gives_the_light_it_was_made_from(kind, directions):
    light = parse(ies(smooth, kind))
    expected = smooth(directions)
    np.testing.assert_allclose(light.luminous_intensity(3 * directions), expected, rtol=COARSE)
    assert light.luminous_flux() == pytest.approx(4 * np.pi * PEAK, rel=1e-3)
    light = parse(ies(lambda d: PEAK * np.maximum(-d[..., 2], 0) ** 20, kind))
    gamma = np.degrees(np.arccos((np.arange(400) + 0.5) / 200 - 1))  # of equal solid angles
    sphere = towards("C", gamma, np.arange(0, 360, 1.0) + 0.5).reshape(-1, 3)
    quadrature = 4 * np.pi * light.luminous_intensity(sphere).mean()
    assert light.interpolated_flux() == pytest.approx(quadrature, rel=1e-3)
    up = parse(ies(lambda d: PEAK * np.maximum(d[..., 2], 0), kind))
    assert up.beam_angle_deg(0) == pytest.approx(120, abs=0.5)
    light = parse(ies(lambertian, kind))
    assert light.luminous_flux() == pytest.approx(np.pi * PEAK, rel=4e-3)
    for c in (0, 90, 30):
        assert light.beam_angle_deg(c) == pytest.approx(120, abs=0.2)
        assert light.beam_angle_deg(c, 0.1) == pytest.approx(168.52, abs=0.2)


@pytest.mark.parametrize(
    ("first", "last", "symmetry"),
    [
        (0, 0, "axial"),
        (0, 90, "C0-C180 and C90-C270"),
        (0, 180, "C0-C180"),
        (90, 270, "C90-C270"),
        (-90, 90, "C90-C270"),
        (-180, 180, "none"),
        (0, 345, "none"),
    ],
)
def test_planes_are_unfolded(first, last, symmetry, directions):
    keep, planes = SYMMETRIES[symmetry], np.arange(first, last + 1, 15)
    light = parse(ies(lambda d: smooth(d * keep), "C", (GRID["C"][0], planes)))
    assert light.symmetry == symmetry
    expected = smooth(directions * keep)
    np.testing.assert_allclose(light.luminous_intensity(directions), expected, rtol=COARSE)
    assert codes(light) == ({"planes-not-closed"} if last == 345 else set())


@pytest.mark.parametrize("kind", "AB")
def test_half_tables_hold_for_both_sides(kind, directions):
    half = np.linspace(0, 90, 37)
    light = parse(ies(lambertian, kind, (half, half)))
    assert light.symmetry == "left-right and up-down"
    found = light.luminous_intensity(directions)
    np.testing.assert_allclose(found, lambertian(directions), atol=3e-3 * PEAK)


OLD = ["A report of 1986", "IESNA91", "IESNA:LM-63-1991", " IESNA:LM-63-1995"]


@pytest.mark.parametrize("first", [*OLD, "IESNA:LM-63-2002", "IES:LM-63-2019"])
def test_editions_and_what_their_field_12_multiplies(first):
    light = parse(ies(first=first, factors="0.9 0.9 50"))
    factor = 0.81 if first in OLD else 0.9
    assert light.format[-2:] in first
    assert light.luminous_flux() == pytest.approx(factor * 4 * np.pi * PEAK, rel=1e-3)
    assert ("future-use" in codes(light)) == first.endswith("2002")


def test_feet_are_metres_and_signs_are_shapes():
    feet = ies(size="-1 -1 0").replace(" 1 2 -1 -1 0", " 1 1 -1 -1 0")
    opening = parse(feet).opening
    assert (opening.shape, opening.along_c0, opening.along_c90) == ("circular", 0.3048, 0.3048)
    old = parse(ies(first="IESNA:LM-63-1995", size="0.1 -0.2 -0.3")).opening
    assert (old.shape, old.along_c0, old.along_c90, old.height) == ("ellipsoid", 0.2, 0.1, 0.3)
    assert parse(ies(size="0.1 -0.2 -0.3")).opening.shape == "horizontal cylinder along C90"
    assert "opening-shape" in codes(parse(ies(size="-0.1 0 0.4")))


def test_tilt_here_and_beside_the_file(tmp_path):
    expected = ((0.0, 1.0), (15.0, 0.9))
    assert parse(ies(tilt="TILT=INCLUDE\n1\n2\n0 15\n1 0.9")).tilt == expected
    (tmp_path / "lamp.tlt").write_text("1 2\n0 15 1 0.9")
    (tmp_path / "a.ies").write_text(ies(tilt=r"TILT=..\lamp.tlt"))
    light = read_photometry(tmp_path / "a.ies")
    assert light.tilt == expected
    assert light.luminous_flux() == pytest.approx(4 * np.pi * PEAK, rel=1e-3)
    missing = parse(ies(tilt="TILT=other.tlt"), folder=tmp_path)
    assert (missing.tilt, codes(missing)) == ((), {"tilt-file-missing"})


@pytest.mark.parametrize("symmetry", range(5))
def test_ldt_symmetries(symmetry, directions):
    uneven = np.array([0, 20, 45, 90, 100, 170, 180, 200, 270, 300, 340])
    name, keep = [*SYMMETRIES.items()][symmetry]
    for planes, rtol in ((None, COARSE), (uneven, 0.2)):
        light = parse(ldt(symmetry, planes), "a.ldt")
        assert light.symmetry == name
        expected = smooth(directions * keep)
        np.testing.assert_allclose(light.luminous_intensity(directions), expected, rtol=rtol)


def test_ldt_units_and_lamps():
    light = parse(ldt(l24="1,5", l16="600 mm", l23="0", l22=""), "a.ldt")
    assert light.luminous_flux() == pytest.approx(1.5 * 4 * np.pi * PEAK, rel=1e-3)
    assert (light.opening.along_c0, light.opening.along_c90) == (0.05, 0.6)
    assert (light.lamp_flux, light.input_power) == (1000, 20)
    absolute = parse(ldt(l27="-1", l24=""), "a.ldt")
    assert (absolute.lamp_flux, absolute.declared_flux) == (None, 1000)
    lines = ldt(l26="2").split("\n")
    two = "\n".join([*lines[:32], "-2", "other", "500", "", "", "9", *lines[32:]])
    other = parse("\r\r\n".join(two.split("\n")) + "\r\r\n\r\r\n\x1a", "a.ldt", lamp_set=2)
    assert other.luminous_flux() == pytest.approx(0.5 * 4 * np.pi * PEAK, rel=1e-3)
    assert other.input_power == 9
    with pytest.raises(RadError, match=r"no lamp set 3, a\.ldt, line 26"):
        parse(two, "a.ldt", lamp_set=3)


# What makers write


@pytest.mark.parametrize(
    "change",
    [
        lambda text: ("\ufeff" + text.replace("\n", "\r\n")).encode(),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("hand-made", "30°\x85").encode("latin-1"),
        lambda text: re.sub(r"(?<=\d) (?=\d)", "\n", text).encode(),
        lambda text: text.replace(" ", ", ").replace("[LUMINAIRE],", "[LUMINAIRE]").encode(),
        lambda text: f"\n{text}\n\nEND\n\x1a".replace("TILT=NONE", "  tilt = none ").encode(),
    ],
)
def test_spellings_do_not_change_the_light(change):
    light = parse(change(ies()))
    assert light.format == "LM-63-2002"
    np.testing.assert_array_equal(light.intensity, parse(ies()).intensity)
    assert not codes(light, "error", "warning")


@pytest.mark.parametrize(
    ("text", "severity", "code"),
    [
        (ies(lambda d: PEAK * d[..., 0]), "error", "negative-intensity"),
        (ies(lamps="1 5000 1"), "error", "more-than-lamps"),
        (ies(lamps="0 13000 1"), "warning", "no-lamps"),
        (ies(factors="1 1 0"), "warning", "no-power"),
        (ies(factors="1 1 1"), "error", "efficacy"),
        (ies(size="30 1 0"), "warning", "opening-size"),
        (ies(grid=(np.arange(0, 171, 10), [0])), "warning", "table-cut"),
        (ies(grid=([0, 90, 60, 30, 180], [0])), "error", "angles-not-rising"),
        (ies(lambda d: smooth(d[..., [2, 0, 1]]), "B", [[-90, -1, 90]] * 2), None, None),
        (ies(lambda d: PEAK * np.maximum(d[..., 0], 0) ** 9, "A"), "warning", "peak-off-axis"),
        (re.sub(r"\n\S+(?=[^\n]*\n$)", "\n0", ies()), "warning", "pole-differs"),
        (ies(lambda d: (-d[..., 2]).clip(0) ** 200, grid=GRID["C"]), "warning", "coarse-angles"),
        (ies() + "5 6 7\n", "warning", "trailing-values"),
        (ies().replace("[LUM", "[_ABSOLUTELUMENS] 6000\n[LUM"), "error", "flux-mismatch"),
        (ies().replace("hand-made", "Candela-> mW/sr"), "warning", "radiometric"),
        (ldt(l22="80"), "warning", "downward-fraction"),
        (ldt(l24="0"), "warning", "conversion-factor"),
        (ldt(l23="50"), "error", "flux-mismatch"),
        ("\n\n" + ldt(), "info", "blank-lines"),
    ],
)  # fmt: skip
def test_files_that_lie_are_findings(text, severity, code):
    found = {(f.severity, f.code) for f in parse(text, "a").findings}
    assert (severity, code) in found if code else not {s for s, _ in found} & {"error"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"\x89PNG\r\n\x1a\n\0\0\0", "not a text file, a, line 3, expected an IES or LDT file"),
        (b"", "the file ends, a, line 1, expected at least the 32 lines"),
        (ies().replace("37 25", "37.5 25"), "37.5 is not allowed, a, line 4, expected the number"),
        (ies().replace("37 25", "999999999999 999"), "1000000000000 of|of 999999999999 numbers"),
        (ies().replace("37 25", "37 26"), "the data ends after .* of .* numbers, a, line 32"),
        (ies().replace("1 1 50", "nan 1 50"), "'nan' is not a usable number, a, line 5"),
        (ies().replace("1 1 50", "1e19 1 50"), r"an intensity of .* expected less than 1e\+12 cd"),
        (ies(grid=([0, 90, 190], [0])), "an angle of 190°, a, line 6, expected 0° to 180°"),
        (ies(grid=([0, 90], [0, 30, 60])), "C planes from 0° to 60°, a, line 6"),
        (ies(kind="B", grid=([0, 90], [0])), "one horizontal angle, a, line 6"),
        (ldt(l3="7"), "7 is not allowed, a, line 3, expected the symmetry indicator 0 to 4"),
        (ldt(l29="0"), "a lamp flux of 0, a, line 29"),
        (ldt(l46="x"), "'x' is not a usable number, a, line 46, expected 24 C planes"),
        (ldt(2).replace("\n180\n", "\n181\n"), "planes are missing"),
        (ldt().rpartition("\n")[0], "the data ends after 887 of 888 numbers"),
    ],
)  # fmt: skip
def test_refusals_name_line_and_reason(text, message):
    with pytest.raises(RadError, match=message):
        parse(text, "a")


IES_TEXT = ies(grid=([0, 45, 90, 180], [0, 90]), tilt="TILT=INCLUDE\n1 2 0 15 1 .9").encode()
LDT_TEXT = ldt(4, np.array([0, 90, 180, 270])).encode()
PIECES = [*b"|-1|0|1e308|nan|1e-320|\n| |\xff|,|TILT=".split(b"|"), b"9" * 400]
PIECE = st.sampled_from(PIECES) | st.binary(max_size=4)
CUT = st.tuples(st.integers(0, 10**4), st.integers(0, 30), PIECE)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([IES_TEXT, LDT_TEXT]), st.lists(CUT, max_size=4))
def test_broken_files_raise_nothing_but_our_error(text, cuts):
    for place, length, piece in cuts:
        at = place % (len(text) + 1)
        text = text[:at] + piece + text[at + length :]
    try:
        light = parse(text)
    except RadError as error:
        assert "line" in error.where
        return
    assert np.isfinite(light.luminous_intensity(np.eye(3))).all()
    assert np.isfinite([light.luminous_flux(), light.interpolated_flux()]).all()


# The verb


def run(capsys, *argv):
    code = cli.run(["photometry", *map(str, argv), "--json"])
    out = capsys.readouterr().out
    return code, json.loads(out) if out else None


def test_the_verb(tmp_path, capsys):
    path, plot, out = tmp_path / "a.ies", tmp_path / "a.png", tmp_path / "b.ies"
    path.write_text(ies(lambertian, lamps="2 1600 1"))
    code, document = run(capsys, path, "--plot", plot, "--unit", "cd/klm")
    assert (code, document["plot"]) == (0, str(plot))
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert document["luminous_flux_declared_lm"] == 3200
    assert document["luminous_flux_integrated_lm"] == pytest.approx(np.pi * PEAK, rel=4e-3)
    assert document["peak_luminous_intensity_cd"] == PEAK
    assert document["efficacy_lm_W"] == pytest.approx(np.pi * PEAK / 50, rel=4e-3)
    assert document["luminous_opening_m"]["along_c0"] == 0.2
    for orientation, blender in (("lm-63", False), ("blender", True)):
        _, document = run(capsys, path, "--to-ies", out, "--orientation", orientation)
        assert document["ies"] == str(out)
        written = out.read_bytes().decode().replace("\r\n", "\n")
        assert written == as_ies(read_photometry(path), blender=blender)
    assert run(capsys, path, "--plot", tmp_path / "a.gif") == (2, None)
    assert run(capsys, tmp_path) == (2, None)
    path.write_text(ies(factors="1 1 1"))
    code, document = run(capsys, path)
    assert (code, [f["code"] for f in document["findings"]]) == (1, ["efficacy"])
    path.write_text(ies().replace("hand-made", "Candela-> mW/sr"))
    code, document = run(capsys, path)
    assert (code, document["luminous_flux_integrated_lm"]) == (0, None)
    assert document["radiant_flux_integrated_W"] == pytest.approx(4 * np.pi, rel=1e-3)


# Written


def cycles_light(text: str, version: tuple[int, int, int], model: Any) -> Any:
    properties = {"ies_text": text.encode(), "ies_frame": np.eye(3), "energy": 1.0}
    return light_from_record(LightRecord("L", "POINT", properties, np.eye(4), 1.0, version), model)


@pytest.mark.parametrize("grid", [None, ([0, 45, 180], [0]), (GRID["C"][0], range(-90, 91, 30))])
@pytest.mark.parametrize("kind", "ABCL")
def test_written_light_is_the_same_light(kind, grid, directions):
    """As LM-63 to the last digit; for Blender in the physical model, and nearly so in Cycles."""
    light = parse(ldt(3), "a.ldt") if kind == "L" else parse(ies(smooth, kind, GRID[kind]))
    if kind == "C" and grid is not None:
        light = parse(ies(lambertian, kind, grid))
    again = parse(as_ies(light))
    candela = light.luminous_intensity(directions)
    np.testing.assert_allclose(again.luminous_intensity(directions), candela, rtol=1e-12)
    same = ("name", "lamp_flux", "input_power", "opening", "radiometric")
    assert all(getattr(again, key) == getattr(light, key) for key in same)
    text = as_ies(light, blender=True)
    exact = 1e-9 if kind in "CL" else COARSE
    for version in ((4, 5, 0), (5, 2, 0)):
        declared = cycles_light(text, version, "physical").distribution
        found = declared.factor(directions) * 683.002 / (4 * np.pi)
        np.testing.assert_allclose(found, candela, rtol=exact, atol=exact * light.peak)
        shown = cycles_light(text, version, "cycles")
        assert shown.notes == ()
        if kind != "C" or grid is None:  # else a cubic differs from lines that meet in corners
            found = shown.distribution.factor(directions) * 177.83 / (4 * np.pi)
            near = 3 * COARSE
            np.testing.assert_allclose(found, candela, rtol=near, atol=near * light.peak)


# Radiance reads them too. Its types A and B are not LM-63's; a standing cylinder has no near field
# in it; and a file that is refused.
LEFT_OUT = {"CU__flood_2.1", "photompy__type_a_symmetric", "photompy__type_b_full"}
LEFT_OUT |= {"photompy__type_b_symmetric", "RenderPipeline__bollard", "luxera__tilt_file_variant"}
FAR = 1000.0  # [m]
EFFICACY, WEIGHTS = 179.0, (0.265, 0.670, 0.065)  # Radiance's own


@needs_files
@pytest.mark.slow
def test_intensities_are_those_of_radiance(tmp_path, directions):
    """By ies2rad, and rtrace far away; WHITE lamps lose nothing with age."""
    home = Path(pytest.importorskip("pyradiance", reason="needs the extra `witnesses`").__file__)
    settings = {**os.environ, "RAYPATH": f".:{home.parent / 'lib'}"}

    def radiance(program, *options, stdin=""):
        command = [str(home.parent / "bin" / program), *options]
        given = {"cwd": tmp_path, "env": settings, "input": stdin.encode()}
        return subprocess.run(command, **given, capture_output=True, check=True).stdout

    rays = "\n".join(" ".join(map(str, (*(FAR * d), *-d))) for d in directions)
    for path in (f for f in FILES if f.suffix.lower() == ".ies" and f.stem not in LEFT_OUT):
        light = read_photometry(path)
        radiance("ies2rad", "-dm", "-t", "WHITE", "-o", "lamp", str(path))
        (tmp_path / "lamp.oct").write_bytes(radiance("oconv", "lamp.rad"))
        exact = ("-h", "-I", "-ab", "0", "-dj", "0", "-ds", "0", "-dt", "0")
        text = radiance("rtrace", *exact, "lamp.oct", stdin=rays)
        irradiance = np.array(text.split(), dtype=float).reshape(-1, 3) @ WEIGHTS
        ours = light.luminous_intensity(directions) * (1e3 if light.radiometric else 1.0)  # mW/sr
        assert np.abs(EFFICACY * irradiance * FAR**2 - ours).mean() < 1e-3 * ours.mean(), path
