# SPDX-License-Identifier: GPL-3.0-or-later
"""``lights``: what each light of a scene truly emits."""

from dataclasses import dataclass
from typing import Any

from ._base import Outcome, aligned
from ._scene import ModelCommand

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
        return Outcome(document, _text(document))


def _text(document: dict[str, Any]) -> str:
    """Return a table for people, its notes, and the findings that are not among these."""
    from ..inspection import figure

    rows, model, efficacy = (document[key] for key in ("lights", "model", "efficacy_lm_W"))
    other = "physical" if model == "cycles" else "cycles"
    table = [["light", "type", "n", *COLUMNS, f"lm {other}"]]
    for row in rows:
        count = str(row["count"]) if row["count"] > 1 else ""
        twin = row["other_model_luminous_flux_lm"]
        unlike = figure(twin) if twin != row["luminous_flux_lm"] else ""
        cells = [figure(row[key]) for key in COLUMNS.values()]
        table.append([row["name"], row["type"], count, *cells, unlike])
    filled = [column for column in zip(*table, strict=True) if any(column[1:])]
    lines = aligned(zip(*filled, strict=True), left=2)
    flux = sum(row["count"] * (row["luminous_flux_lm"] or 0.0) for row in rows)
    total = f"in all {figure(flux)} lm; " if len(rows) > 1 and flux else ""
    lines.append(f"{total}{efficacy:g} lm/W, model {model}; W are the mean of R, G and B")
    notes: dict[str, list[str]] = {}
    for row in rows:
        for note in row["notes"]:
            notes.setdefault(note, []).append(row["name"])
    lines += [f"- {_listed(names, len(rows))}: {note}" for note, names in notes.items()]
    others = [finding for finding in document["findings"] if finding.message not in notes]
    return "\n".join([*lines, *map(str, others)])


def _listed(names: list[str], count: int) -> str:
    if len(names) == count > 1:
        return "all"
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
