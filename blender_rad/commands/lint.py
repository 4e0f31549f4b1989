# SPDX-License-Identifier: GPL-3.0-or-later
"""``lint``: which settings and set-ups bias the light of a render, and by how much."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import Finding
from ._base import Outcome, aligned
from ._scene import EngineCommand


@dataclass(frozen=True, kw_only=True)
class LintOptions(EngineCommand, verb="lint"):
    """Name settings and set-ups that bias a photometric render, each with its effect."""

    def run(self) -> Outcome:
        from ..bpy_io.settings import render_settings
        from ..linting import lint

        bl_scene, scene = self.read(self.frame)
        findings = lint(scene, render_settings(bl_scene), self.threads)
        document = {"findings": findings, "efficacy_lm_W": self.efficacy, "model": self.model}
        code = int(any(finding.severity == "error" for finding in findings))
        return Outcome(document, _text(findings), code)


def _text(findings: list[Finding]) -> str:
    rows = [["severity", "what", "where", "effect", "why"]]
    for f in findings:
        effect = "" if f.effect_percent is None else f"{f.effect_percent:+.3g} %"
        rows.append([f.severity, f.code, f.object, effect, f.message])
    return "\n".join(aligned(rows, left=5))
