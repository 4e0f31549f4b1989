# SPDX-License-Identifier: GPL-3.0-or-later
"""One table of quantities, and the numbers that everything else is built on."""

from __future__ import annotations

from pathlib import Path

from blender_rad.quantities import QUANTITIES, quantity


def test_every_form_has_every_kind() -> None:
    assert len(QUANTITIES) == len({(q.form, q.kind) for q in QUANTITIES.values()}) == 5 * 3
    for entry in QUANTITIES.values():
        assert entry is quantity(entry.form, entry.kind) is QUANTITIES[entry.name]


def test_the_readme_uses_these_words_and_units() -> None:
    readme = Path(__file__).parents[2] / "README.md"
    text = " ".join(readme.read_text(encoding="utf-8").split())
    for form in ("flux", "intensity", "irradiance", "radiance"):
        for kind in ("radiant", "luminous"):
            entry = quantity(form, kind)
            assert f"{entry.words} {entry.unit}" in text
