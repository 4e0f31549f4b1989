# SPDX-License-Identifier: GPL-3.0-or-later
"""One table of quantities, and the numbers that everything else is built on."""

from __future__ import annotations

from pathlib import Path

import pytest

from blender_rad.quantities import QUANTITIES, quantity


def test_every_form_has_every_kind_and_twins_are_mutual() -> None:
    assert len(QUANTITIES) == len({(q.form, q.kind) for q in QUANTITIES.values()}) == 6 * 4
    for entry in QUANTITIES.values():
        assert entry is quantity(entry.form, entry.kind) is QUANTITIES[entry.name]
        assert bool(entry.twin) == (entry.kind in ("radiant", "luminous"))
        if entry.twin:
            twin = QUANTITIES[entry.twin]
            assert (twin.twin, twin.form) == (entry.name, entry.form)
            assert twin.definition == entry.definition


@pytest.mark.parametrize(
    ("name", "symbol", "unit", "key"),
    [
        ("luminous_intensity", "I_v", "cd", "luminous_intensity_cd"),
        ("radiance", "L_e", "W/(m² sr)", "radiance_W_m2_sr"),
        ("luminous_energy", "Q_v", "lm·s", "luminous_energy_lm_s"),
        ("spectral_radiance", "L_λ", "W/(m² sr nm)", "spectral_radiance_W_m2_sr_nm"),
        ("spectral_radiant_flux", "Φ_λ", "W/nm", "spectral_radiant_flux_W_nm"),
        ("photon_irradiance", "E_p", "1/(m² s)", "photon_irradiance_1_m2_s"),
    ],
)
def test_names_symbols_and_keys(name: str, symbol: str, unit: str, key: str) -> None:
    entry = QUANTITIES[name]
    assert (entry.symbol, entry.unit, entry.key) == (symbol, unit, key)


def test_the_readme_uses_these_words_and_units() -> None:
    readme = Path(__file__).parents[2] / "README.md"
    text = " ".join(readme.read_text(encoding="utf-8").split())
    for form in ("flux", "intensity", "irradiance", "radiance"):
        for kind in ("radiant", "luminous"):
            entry = quantity(form, kind)
            assert f"{entry.words} {entry.unit}" in text
