# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials put to the three laws of reflection, beside Blender."""

from __future__ import annotations

from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

import bpy

from . import beside, live
from .lint_panel import ICONS
from .shared import Action, InProperties, say

if TYPE_CHECKING:
    from ..blender_rad.laws import Judged

LAWS = (
    ("positive", "No negative light"),
    ("reciprocal", "The same from either end"),
    ("energy_conserving", "No more light than arrives"),
)
_MARKS: dict[bool | None, Any] = {None: 'QUESTION', True: 'CHECKMARK', False: 'CANCEL'}
_judged: dict[str, Judged] = {}  # by material


def _taken(found: Future[list[Judged]]) -> None:
    _judged.clear()
    _judged.update({each.name: each for each in found.result()})
    beside.redraw('PROPERTIES')


class RADIOMETRIC_OT_laws(Action, bpy.types.Operator):
    """Put the materials in view to positivity, reciprocity and conservation of energy."""

    bl_idname = "radiometric.laws"
    bl_label = "Check the Laws of Reflection"

    def work(self, context: Any) -> None:
        from ..blender_rad.laws import judge

        beside.begin(_taken, judge, live.scene_of(context.evaluated_depsgraph_get()))


class RADIOMETRIC_PT_laws(InProperties, bpy.types.Panel):
    bl_label = "Laws of Reflection"
    bl_parent_id = "RADIOMETRIC_PT_material"
    bl_context = "material"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: Any) -> None:
        layout: Any = self.layout
        layout.operator("radiometric.laws", icon='VIEWZOOM')
        found = _judged.get(context.material.name)
        if found is None:
            return
        column = layout.column(align=True)
        for name, words in LAWS:
            column.label(text=words, icon=_MARKS[getattr(found, name)])
        if found.max_albedo is not None:
            share, angle = 100 * found.max_albedo, found.max_albedo_angle_deg
            column.label(text=f"Reflects at most {share:.3g} %, at {angle:g}°", icon='BLANK1')
        for finding in found.findings:
            say(layout, context, finding.message, ICONS[finding.severity])


def disabled() -> None:
    _judged.clear()
