# SPDX-License-Identifier: GPL-3.0-or-later
"""``photometry``: what the light of an IES or LDT file is, and whether the file can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..atomic import write_text
from . import _values as values
from ._base import Command, Outcome, option

if TYPE_CHECKING:
    from ..photometry import Distribution


@dataclass(frozen=True, kw_only=True)
class PhotometryOptions(Command, verb="photometry"):
    """Read an IES or LDT file: flux, intensities, angles, opening, and what is wrong with it."""

    file: Path = option(
        values.input_file("an IES or LDT file"), "what is read", metavar="FILE", positional=True
    )
    plot: Path | None = option(
        values.output_file(".png", ".svg"), "write the polar diagram", metavar="OUT.png|OUT.svg"
    )
    unit: str = option(values.choice("cd", "cd/klm"), "of the diagram", default="cd")
    lamp_set: int = option(values.integer(1), "which of an LDT file's lamp sets", default=1)
    to_ies: Path | None = option(
        values.output_file(".ies"), "write the same light as LM-63-2002", metavar="OUT.ies"
    )
    orientation: str = option(
        values.choice("lm-63", "blender"),
        "of that file: lm-63, or blender as its IES Texture node turns it",
        default="lm-63",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require("unit", "plot")
        self.require("orientation", "to_ies")

    def run(self) -> Outcome:
        from ..photometry import as_ies, read_photometry

        light = read_photometry(self.file, self.lamp_set)
        if self.plot:
            from ..photometry.polar import write_polar

            write_polar(light, self.plot, per_klm=self.unit == "cd/klm")
        if self.to_ies:
            text = as_ies(light, blender=self.orientation == "blender")
            write_text(self.to_ies, text, newline="\r\n")
        document = _document(light) | {"plot": self.plot, "ies": self.to_ies}
        wrong = any(finding.severity == "error" for finding in light.findings)
        return Outcome(document, _text(document, self.file), 1 if wrong else 0)


def _document(light: Distribution) -> dict[str, Any]:
    """Return the promised keys; lumens and candelas are null where the table holds W/sr."""
    flux, power, visible = light.luminous_flux(), light.input_power, not light.radiometric
    declared = light.declared_flux or light.lamp_flux
    basis = "luminaire" if light.declared_flux else "lamps" if declared else None
    return {
        "format": light.format,
        "name": light.name,
        "photometric_type": light.kind,
        "luminous_flux_declared_lm": declared if visible else None,
        "luminous_flux_declared_of": basis,
        "luminous_flux_lamps_lm": light.lamp_flux,
        "luminous_flux_integrated_lm": flux if visible else None,
        "luminous_flux_interpolated_lm": light.interpolated_flux() if visible else None,
        "peak_luminous_intensity_cd": light.peak if visible else None,
        "radiant_flux_declared_W": None if visible else light.declared_flux,
        "radiant_flux_integrated_W": None if visible else flux,
        "peak_radiant_intensity_W_sr": None if visible else light.peak,
        "beam_angle_deg": light.beam_angle_deg(0),
        "beam_angle_c90_c270_deg": light.beam_angle_deg(90),
        "field_angle_deg": light.beam_angle_deg(0, 0.1),
        "field_angle_c90_c270_deg": light.beam_angle_deg(90, 0.1),
        "symmetry": light.symmetry,
        "input_power_W": power,
        "efficacy_lm_W": flux / power if power and visible else None,
        "luminous_opening_m": light.opening,
        "lamp_tilt": [{"angle_deg": angle, "factor": factor} for angle, factor in light.tilt],
        "findings": light.findings,
    }


def _text(document: dict[str, Any], file: Path) -> str:
    """Return a table for people, of what the file tells."""
    lines = [f"{file}: {document['name']}"]
    for key, value in document.items():
        if isinstance(value, (str, float)):
            lines.append(f"  {key:29} {f'{value:.5g}' if isinstance(value, float) else value}")
    opening = document["luminous_opening_m"]
    size = f"{opening.along_c0:.4g} × {opening.along_c90:.4g} × {opening.height:.4g}"
    lines.append(f"  {'luminous_opening_m':29} {opening.shape}, {size}")
    return "\n".join([*lines, *map(str, document["findings"])])
