# SPDX-License-Identifier: GPL-3.0-or-later
"""``lint``: which settings and set-ups bias the light of a render, and by how much."""

from dataclasses import dataclass
from typing import Any

from ..errors import Finding
from . import _values as values
from ._base import Outcome, aligned, option
from ._scene import EngineCommand

SIDE = 96  # pixels of the longer side of Cycles' pictures
SEEDS = 3


@dataclass(frozen=True, kw_only=True)
class LintOptions(EngineCommand, verb="lint"):
    """Name settings and set-ups that bias a photometric render, each with its effect."""

    measure: int | None = option(
        values.integer(1), "measure settings by small Cycles pictures of N samples a pixel"
    )

    def run(self) -> Outcome:
        from ..bpy_io.settings import render_settings
        from ..linting import FIXES, lint
        from ..strict_json import plain

        bl_scene, scene = self.read(self.frame)
        settings = render_settings(bl_scene)
        measured = self._measured(bl_scene, scene.resolution) if self.measure else {}
        findings = lint(scene, settings, self.threads, measured)
        fixed = [{**plain(f), "fix": FIXES.get(f.code, {})} for f in findings]
        document = {"findings": fixed, "efficacy_lm_W": self.efficacy, "model": self.model}
        code = int(any(finding.severity == "error" for finding in findings))
        return Outcome(document, _text(findings), code)

    def _measured(self, bl_scene: Any, size: tuple[int, int]) -> dict[str, float]:
        """Return the effects [%] of settings by code; the open scene is changed."""
        from ..bpy_io.witness import CyclesWitness
        from ..compare.effects import effect_of

        width, height = (max(1, side * SIDE // max(size)) for side in size)
        witness = CyclesWitness(
            bl_scene, resolution=(width, height), settings="file", threads=self.threads
        )
        witness.prepare()
        samples = self.measure or 1
        pictures = witness.pictures(SEEDS, samples)
        taken = witness.taken_back(pictures, samples, kept=("bounces",))
        return {code: effect_of(*both).whole for code, _, *both in taken}


def _text(findings: list[Finding]) -> str:
    rows = [["severity", "what", "where", "effect", "why"]]
    for f in findings:
        effect = "" if f.effect_percent is None else f"{f.effect_percent:+.3g} %"
        rows.append([f.severity, f.code, f.object, effect, f.message])
    return "\n".join(aligned(rows, left=5))
