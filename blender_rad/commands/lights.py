# SPDX-License-Identifier: GPL-3.0-or-later
"""``lights``: what each light of a scene truly emits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ._base import Outcome
from ._scene import ModelCommand

if TYPE_CHECKING:
    from ..errors import Finding

COLUMNS = {
    "W": "radiant_flux_W",
    "lm": "luminous_flux_lm",
    "cd": "peak_luminous_intensity_cd",
    "cd/m²": "luminance_cd_m2",
    "lx": "illuminance_lx",
    "K": "correlated_colour_temperature_K",
}
NAMED = 3  # lights that share a note, before the rest are counted


@dataclass(frozen=True, kw_only=True)
class LightsOptions(ModelCommand, verb="lights"):
    """List what each light, mesh emitter and world truly emits, in W, lm, cd, cd/m² and lx."""

    def run(self) -> Outcome:
        from ..inspection import inspect_lights

        _, scene = self.read(self.frame)
        rows, findings = inspect_lights(scene, self.efficacy)
        document = {
            "lights": rows,
            "efficacy_lm_W": self.efficacy,
            "model": self.model,
            "findings": findings,
        }
        return Outcome(document, _text(rows, document, findings))


def _text(rows: list[dict[str, Any]], document: dict[str, Any], findings: list[Finding]) -> str:
    """Return a table for people, its notes, and the findings that are not among these."""
    from ..inspection import figure

    model, efficacy = document["model"], document["efficacy_lm_W"]
    other = "physical" if model == "cycles" else "cycles"
    table = [["light", "type", "n", *COLUMNS, f"lm {other}"]]
    for row in rows:
        flux, twin, n = (
            row[k] for k in ("luminous_flux_lm", "other_model_luminous_flux_lm", "count")
        )
        cells = [figure(row[key]) for key in COLUMNS.values()]
        unlike = figure(twin) if flux != twin else ""
        table.append([row["name"], row["type"], str(n) if n > 1 else "", *cells, unlike])
    columns = [column for column in zip(*table, strict=True) if any(column[1:])]
    padded = [_padded(column, left=i < 2) for i, column in enumerate(columns)]
    lines = ["  ".join(line).rstrip() for line in zip(*padded, strict=True)]
    flux = sum(row["count"] * (row["luminous_flux_lm"] or 0.0) for row in rows)
    total = f"in all {figure(flux)} lm; " if len(rows) > 1 and flux else ""
    lines.append(f"{total}{efficacy:g} lm/W, model {model}; W are the mean of R, G and B")
    notes: dict[str, list[str]] = {}
    for row in rows:
        for note in row["notes"]:
            notes.setdefault(note, []).append(row["name"])
    lines += [f"- {_listed(names, len(rows))}: {note}" for note, names in notes.items()]
    others = [finding for finding in findings if finding.message not in notes]
    return "\n".join([*lines, *map(str, others)])


def _padded(column: tuple[str, ...], *, left: bool) -> list[str]:
    width = max(map(len, column))
    return [cell.ljust(width) if left else cell.rjust(width) for cell in column]


def _listed(names: list[str], count: int) -> str:
    if len(names) == count > 1:
        return "all"
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
