# SPDX-License-Identifier: GPL-3.0-or-later
"""``materials``: whether each material keeps the three laws, and what no real surface has."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from . import _values as values
from ._base import Outcome, aligned, option
from ._scene import SceneCommand

if TYPE_CHECKING:
    from ..laws import Judged


SIDE = 160  # pixels of the longer side of the view in which Blender is asked what it computes


@dataclass(frozen=True, kw_only=True)
class MaterialsOptions(SceneCommand, verb="materials"):
    """Put materials to the three laws: positivity, reciprocity, conservation of energy."""

    plot: Path | None = option(
        values.output_file(".png"),
        "draw their albedos by incidence, and their look in white surroundings",
        metavar="OUT.png",
    )

    def run(self) -> Outcome:
        from ..bpy_io.read import frame_size, read_scene
        from ..laws import judge

        bl_scene = self.open(self.file, self.frame, need_camera=False)
        size = frame_size(bl_scene.render)
        width, height = (max(1, side * min(SIDE, max(size)) // max(size)) for side in size)
        scene = read_scene(bl_scene, ask=True, resolution=(width, height))
        judged = judge(scene)
        if self.plot:
            from ..report.furnace import write_furnaces

            write_furnaces(judged, self.plot)
        document = {"materials": judged, "findings": scene.findings, "plot": self.plot}
        wrong = any(f.severity == "error" for each in judged for f in each.findings)
        return Outcome(document, _text(judged), int(wrong))


def _text(judged: list[Judged]) -> str:
    rows = [["material", "f ≥ 0", "f(i,r) = f(r,i)", "∫ f cosθ dω ≤ 1", "greatest albedo", "at"]]
    for each in judged:
        laws = (each.positive, each.reciprocal, each.energy_conserving)
        kept = ["–" if law is None else "yes" if law else "NO" for law in laws]
        most = "–" if each.max_albedo is None else f"{each.max_albedo:.4g}"
        angle = f"{each.max_albedo_angle_deg:g}°" if each.supported else "–"
        rows.append([each.name, *kept, most, angle])
    return "\n".join([*aligned(rows), *(str(f) for each in judged for f in each.findings)])
