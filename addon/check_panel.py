# SPDX-License-Identifier: GPL-3.0-or-later
"""One button: does Cycles agree? With its progress, its answer, and what to do about it."""

from typing import Any

import bpy
from bpy.props import StringProperty

from . import beside
from .checking import POLL_S, Check
from .images import show_difference
from .shared import Action, InProperties, say, select_alone

ICONS = {'agree': 'CHECKMARK', 'differ': 'CANCEL', 'undecided': 'QUESTION'}
_checks: list[Check] = []  # the last one


def _last() -> Check | None:
    return _checks[-1] if _checks else None


def _poll() -> float | None:
    """Follow the check that runs; as a timer, until it has ended."""
    check = _last()
    if check is None or not check.running:
        return None
    check.poll()
    beside.redraw('PROPERTIES')
    return POLL_S if check.running else None


class RADIOMETRIC_OT_check(bpy.types.Operator):
    """Ask Cycles for the direct light of the scene, and compare it with what the numbers say."""

    bl_idname = "radiometric.check"
    bl_label = "Check Against Cycles"

    @classmethod
    def poll(cls, context: Any) -> bool:
        check = _last()
        return context.scene.camera is not None and not (check and check.running)

    def execute(self, context: Any) -> Any:
        _checks[:] = [check := Check(context.scene)]
        if not bpy.app.background:
            bpy.app.timers.register(_poll, first_interval=POLL_S, persistent=True)
            return {'FINISHED'}
        check.wait()
        if check.document is None:
            self.report({'ERROR'}, check.error)
            return {'CANCELLED'}
        self.report({'INFO'}, check.document["verdict"])
        return {'FINISHED'}


class RADIOMETRIC_OT_check_cancel(Action, bpy.types.Operator):
    """Stop the check."""

    bl_idname = "radiometric.check_cancel"
    bl_label = "Cancel"
    bl_options = {'INTERNAL'}

    def work(self, context: Any) -> None:
        if check := _last():
            check.cancel()


class RADIOMETRIC_OT_select(bpy.types.Operator):
    """Select this object."""

    bl_idname = "radiometric.select"
    bl_label = "Select"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    name: StringProperty(options={'SKIP_SAVE'})

    def execute(self, context: Any) -> Any:
        found = context.view_layer.objects.get(self.name)
        if found is None:
            self.report({'WARNING'}, f"{self.name} is no object of this view layer")
            return {'CANCELLED'}
        select_alone(context, found)
        return {'FINISHED'}


class RADIOMETRIC_OT_report(Action, bpy.types.Operator):
    """Open the report of the last check in the browser."""

    bl_idname = "radiometric.report"
    bl_label = "Report"
    bl_options = {'INTERNAL'}

    def work(self, context: Any) -> None:
        if check := _last():
            bpy.ops.wm.url_open(url=(check.folder / "report.html").as_uri())


class RADIOMETRIC_OT_difference(Action, bpy.types.Operator):
    """Show where Cycles differs: red is brighter than it should be, blue darker."""

    bl_idname = "radiometric.difference"
    bl_label = "Difference"
    bl_options = {'INTERNAL'}

    def work(self, context: Any) -> None:
        if check := _last():
            show_difference(check.folder / "difference.exr", context.scene.radiometric.tolerance)


class RADIOMETRIC_RENDER_PT_check(InProperties, bpy.types.Panel):
    bl_label = "Radiometric Check"
    bl_context = 'render'

    def draw(self, context: Any) -> None:
        layout: Any = self.layout
        check = _last()
        layout.use_property_split = True
        own = context.scene.radiometric
        for name in ("tolerance", "model", "shading", "efficacy"):
            layout.prop(own, name)
        if check and check.running:
            row = layout.row(align=True)
            row.progress(factor=check.share, text=f"{check.step} {100 * check.share:.0f} %")
            row.operator("radiometric.check_cancel", text="", icon='CANCEL')
            return
        layout.operator("radiometric.check", icon='VIEWZOOM')
        if check and check.document:
            _draw_answer(layout.box(), context, check.document)
            row = layout.row(align=True)
            row.operator("radiometric.report", icon='URL')
            row.operator("radiometric.difference", icon='IMAGE_DATA')
        elif check:
            say(layout, context, check.error, 'ERROR')


def _draw_answer(box: Any, context: Any, document: dict[str, Any]) -> None:
    verdict, settings = document["verdict"], document["settings"]
    terms = f"within {100 * settings['tolerance']:g} %, {100 * settings['confidence']:g} % sure"
    say(box, context, f"{verdict.capitalize()} ({terms})", ICONS[verdict])
    ratio = document["metrics"]["energy_ratio"]
    given = "" if ratio is None else f"Cycles gives {ratio:.4f} times the light. "
    share = document["coverage"]["supported_pixel_fraction"]
    say(box, context, f"{given}{100 * share:.0f} % of the picture compared", 'BLANK1')
    for light in document["lights"]:
        if light["verdict"] == "differ":
            name, scale = light["name"], light["scale_in_witness"]
            box.operator("radiometric.select", text=name, icon=ICONS['differ']).name = name
            said = "" if scale is None else f"x {scale:.3f} "
            say(box, context, said + (light["diagnosis"] or ""), 'BLANK1')
    for finding in document["findings"]:
        if finding["severity"] != "info":
            said = f"{finding['object']} {finding['message']}".strip()
            say(box, context, said, 'INFO')


def disabled() -> None:
    if check := _last():
        check.cancel()
    _checks.clear()


TIMERS = (_poll,)
