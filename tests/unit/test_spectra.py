# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra and working spaces against published numbers, and files that are none."""

import numpy as np
import pytest

from blender_rad.errors import RadError
from blender_rad.lights._emission import blackbody_rgb
from blender_rad.spectra import colour_temperature, spectrum
from blender_rad.working_space import (
    ACESCG,
    REC709,
    WORKING_SPACES,
    luminance_weights,
    rec709_from_working,
)

BOLTZMANN = 1.380649e-23  # J/K
AVOGADRO = 6.02214076e23


@pytest.mark.parametrize(
    ("name", "limits", "lm_W", "rel"),
    [
        # K_m ∫SV/∫S over CIE's own 1 nm tables: CIE 018:2019 for V and
        # doi:10.25039/CIE.DS.8jsxjrsn (A), .hjfjmt59 (D65), .dhcw57sd (LED), 380–780 nm.
        ("A", None, 156.196, 2e-5),
        ("D65", None, 205.153, 1e-5),
        ("LED-B3", None, 316.951, 3e-4),  # ours is a 5 nm table
        # Murphy 2012, doi:10.1063/1.4721897: a blackbody of 5800 K cut to 400–700 nm
        ("blackbody:5800", (400.0, 700.0), 251.0, 2e-3),
        ("laser:555", None, 683.002, 1e-12),  # V = 1
        ("laser:555.016", None, 683.0, 3e-6),  # the candela's 540 THz in air
        ("laser:632.8", None, 162.0, 0.01),  # He-Ne, V = 0.237
        ("laser:1064", None, 0.0, 0.0),
        ("rgb:1,1,1", None, 205.153, 1e-5),  # Blender's white is D65
    ],
)
def test_luminous_efficacy(name, limits, lm_W, rel):
    assert spectrum(name, limits).efficacy_lm_W == pytest.approx(lm_W, rel=rel)


@pytest.mark.parametrize(
    ("name", "temperature", "rendering"),
    [  # CIE 15:2018, tables of illuminants; R_a as CIE prints it
        ("A", 2856, 100),
        ("D65", 6504, 100),
        ("FL2", 4230, 64),
        ("FL11", 4000, 83),
        ("LED-B3", 4103, 85),
    ],
)
def test_colour(name, temperature, rendering):
    light = spectrum(name).described()
    assert light["correlated_colour_temperature_K"] == pytest.approx(temperature, rel=1.5e-3)
    assert light["colour_rendering_index"] == pytest.approx(rendering, abs=0.5)


def test_temperature_and_colour_are_blenders_and_some_have_none():
    r, g, b = blackbody_rgb(4000.0) / 10.0
    painted = spectrum(f"rgb:{r},{g},{b}").described()
    assert painted["correlated_colour_temperature_K"] == pytest.approx(4000.0, rel=1e-3)
    assert painted["duv"] == pytest.approx(0.0, abs=1e-4)
    clipped, coldest = spectrum("temperature:99"), spectrum("blackbody:800")
    assert clipped.efficacy_lm_W == coldest.efficacy_lm_W
    for name in ("laser:550", "rgb:1,0,0", "blackbody:700"):
        assert spectrum(name).described()["correlated_colour_temperature_K"] is None
    assert colour_temperature([0.0, 0.0, 0.0]) == (None, None)


def test_blackbodies():
    """The mean energy of its photons is π⁴/(30 ζ(3)) kT; 27.323 % are below λT = 3 mm K."""
    whole = spectrum("blackbody:5772", (100.0, 1e5))
    mean = 2.701178 * BOLTZMANN * 5772.0
    assert whole.photons_per_J() == pytest.approx(1.0 / mean, rel=2e-4)
    whole, part = (spectrum("blackbody:3000", (100, end)).efficacy_lm_W for end in (1e5, 1e3))
    assert whole / part == pytest.approx(0.27323, rel=3e-5)


@pytest.mark.parametrize(("name", "lx"), [("D65", 54.0), ("FL2", 74.0), ("A", 50.0)])
def test_lux_per_ppfd(name, lx):
    """Thimijan and Heins 1983, HortScience 18: 818: sun and sky, cool white, incandescent."""
    light = spectrum(name)
    umol_per_J = light.photons_per_J((400.0, 700.0)) / AVOGADRO * 1e6
    assert light.efficacy_lm_W / umol_per_J == pytest.approx(lx, rel=0.04)


def test_only_photons_of_400_to_700_nm_are_photosynthetic():
    for name, limits in (("laser:701", None), ("laser:399", None), ("E", (700.0, 780.0))):
        assert spectrum(name, limits).photons_per_J((400.0, 700.0)) == 0.0
    inside = spectrum("E", (420.0, 690.0))
    assert inside.photons_per_J((400.0, 700.0)) == inside.photons_per_J()


def test_limits_are_stated_and_kept_and_a_files_own(tmp_path):
    assert spectrum("D65", (300.5, 700.25)).limits_nm == (300.5, 700.25)
    assert (spectrum("A").title, spectrum("laser:532").title) == ("A, 380–780 nm", "laser:532")
    path = tmp_path / "lamp.csv"
    path.write_text("wavelength (nm),W\n500,2\n520,2\n", encoding="utf-8-sig")
    light = spectrum(str(path))
    assert light.limits_nm == (500.0, 520.0)
    assert light.photons_per_J() == pytest.approx(510e-9 / 1.986445857e-25, rel=1e-9)


@pytest.mark.parametrize(
    "text",
    ["", "nm,W\n", "400,1\n", "400,1\n300,2\n", "400,1\n500,x\n", "400,1\n500,-1\n", "0.4,1\n0.7,1",
     "400,0\n500,0\n", "400\n500\n", "400,1,1\n500,1,1\n", "400,1\n500,1,1\n", "400,nan\n500,1\n"],
)  # fmt: skip
def test_a_file_that_is_no_spectrum_is_refused_by_name(text, tmp_path):
    path = tmp_path / "lamp.csv"
    path.write_text(text)
    with pytest.raises(RadError, match=r"lamp\.csv"):
        spectrum(str(path))


@pytest.mark.parametrize(
    ("name", "limits", "words"),
    [
        ("sun", None, "LED-B3.*blackbody:K"),
        ("lamp:3", None, "laser:NM"),
        ("blackbody:0", None, "numbers above 0"),
        ("laser:inf", None, "numbers above 0"),
        ("laser:5", None, "100 to 100000 nm"),
        ("laser:555", (600.0, 700.0), "600 to 700 nm"),
        ("rgb:1,1", None, "rgb:R,G,B"),
        ("rgb:1,-1,1", None, "numbers above 0"),
        ("D65", (380.0, 900.0), "within 300,780"),
        ("D65", (700.0, 400.0), "--limits"),
        ("A", (float("nan"), 400.0), "--limits"),
        ("missing.csv", None, "missing.csv"),
    ],
)
def test_what_is_no_spectrum_is_refused(name, limits, words):
    with pytest.raises(RadError, match=words):
        spectrum(name, limits)


@pytest.mark.filterwarnings("ignore:.*related API features are not available")
def test_working_spaces_are_those_that_are_published():
    import colour

    for name, space in WORKING_SPACES.items():
        known = colour.RGB_COLOURSPACES[name.replace("Linear Rec.", "ITU-R BT.")]
        np.testing.assert_allclose(space, [*known.primaries.flat, *known.whitepoint], atol=1e-5)
        xyz = colour.normalised_primary_matrix(known.primaries, known.whitepoint)
        np.testing.assert_allclose(luminance_weights(space), xyz[1], atol=2e-6)
    # The published matrix from ACEScg to linear sRGB (Bradford), to its printed digits.
    expected = [
        [1.70505, -0.62179, -0.08326],
        [-0.13026, 1.14080, -0.01055],
        [-0.02400, -0.12897, 1.15297],
    ]
    np.testing.assert_allclose(rec709_from_working(ACESCG), expected, atol=2e-5)
    np.testing.assert_allclose(rec709_from_working(REC709), np.eye(3), atol=1e-12)
