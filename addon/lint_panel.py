# SPDX-License-Identifier: GPL-3.0-or-later
"""The linter: what biases the light of the scene, by how much, and a button that ends it."""

from concurrent.futures import Future
from typing import Any

import bpy
from bpy.props import CollectionProperty, IntProperty, PointerProperty, StringProperty

from ..blender_rad.errors import Finding
from . import beside
from .engine import ENGINE
from .shared import Action, InProperties, say

ICONS = {'error': 'CANCEL', 'warning': 'ERROR', 'info': 'INFO'}


def settings_of(context: Any, code: str, about: str) -> list[tuple[Any, str, Any]]:
    """Return what fixes a finding: owners, their properties and the values that these shall have.

    Empty where nothing does, or where the file that is open does not hold the owner.
    """
    from ..blender_rad.linting import FIXES

    found: list[tuple[Any, str, Any]] = []
    for path, value in FIXES.get(code, {}).items():
        of_scene = not path.startswith("data.")
        block = context.scene if of_scene else context.scene.objects.get(about)
        parent, _, name = path.rpartition(".")
        owner = block and block.path_resolve(parent)
        if owner and hasattr(owner, name) and owner.id_data.is_editable:
            found.append((owner, name, value))
    return found


def begin(context: Any) -> None:
    """Have the scene judged on a thread; its arrays and settings are taken here and now."""
    from ..blender_rad.bpy_io.read import read_depsgraph
    from ..blender_rad.bpy_io.settings import render_settings
    from ..blender_rad.linting import lint

    own = context.scene.radiometric
    scene = read_depsgraph(context.evaluated_depsgraph_get(), shading=own.shading, model=own.model)
    settings = render_settings(context.scene)
    if settings["render.engine"] == ENGINE:
        settings["render.engine"] = 'CYCLES'  # ours counts in units of light as well
    group = context.window_manager.radiometric_lint
    group.busy = True
    beside.begin(_taken, lint, scene, settings, 1)


def _taken(found: Future[list[Finding]]) -> None:
    context: Any = bpy.context
    group = context.window_manager.radiometric_lint
    group.busy = False
    group.findings.clear()
    for finding in found.result():
        entry = group.findings.add()
        entry.name = f"{finding.object}: {finding.message}" if finding.object else finding.message
        entry.code, entry.severity, entry.about = finding.code, finding.severity, finding.object
        effect = finding.effect_percent
        entry.effect = "" if effect is None else f"{effect:+.3g} %"
    group.active = 0
    beside.redraw('PROPERTIES')


class RADIOMETRIC_PG_finding(bpy.types.PropertyGroup):
    """A finding; its name is what it says."""

    code: StringProperty()
    severity: StringProperty()
    about: StringProperty()
    effect: StringProperty()


class RADIOMETRIC_PG_lint(bpy.types.PropertyGroup):
    """The findings about the open scene; they are not saved."""

    findings: CollectionProperty(type=RADIOMETRIC_PG_finding)
    active: IntProperty()
    busy: bpy.props.BoolProperty()


class RADIOMETRIC_OT_lint(Action, bpy.types.Operator):
    """List the settings that bias the light of a render, each with its effect, beside your work."""

    bl_idname = "radiometric.lint"
    bl_label = "Find What Biases the Light"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not context.window_manager.radiometric_lint.busy

    def work(self, context: Any) -> None:
        begin(context)


class RADIOMETRIC_OT_fix(bpy.types.Operator):
    """Set this to what leaves the light alone."""

    bl_idname = "radiometric.fix"
    bl_label = "Fix"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    code: StringProperty(options={'SKIP_SAVE'})
    about: StringProperty(options={'SKIP_SAVE'})

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        wanted = settings_of(context, properties.code, properties.about)
        return "\n".join(
            f"{owner.bl_rna.properties[name].name}: {value}" for owner, name, value in wanted
        )

    def execute(self, context: Any) -> Any:
        wanted = settings_of(context, self.code, self.about)
        for owner, name, value in wanted:
            setattr(owner, name, value)
        return {'FINISHED'} if wanted else {'CANCELLED'}


class RADIOMETRIC_UL_findings(bpy.types.UIList):
    """A row a finding: how grave, how much, what, and the button."""

    def draw_item(  # noqa: PLR0917 - Blender's
        self,
        context: Any,
        layout: Any,
        data: Any,
        item: Any,
        icon: int | None,
        active_data: Any,
        active_property: str | None,
        index: int | None = 0,
        flt_flag: int | None = 0,
    ) -> None:
        wanted = settings_of(context, item.code, item.about)
        done = bool(wanted) and all(getattr(o, name) == value for o, name, value in wanted)
        row = layout.row(align=True)
        effect = row.row()
        effect.ui_units_x = 3.5
        effect.label(text=item.effect, icon='CHECKMARK' if done else ICONS[item.severity])
        row.label(text=item.name)
        if wanted and not done:
            button = row.row()
            button.ui_units_x = 2.0
            properties = button.operator("radiometric.fix")
            properties.code, properties.about = item.code, item.about


class RADIOMETRIC_RENDER_PT_lint(InProperties, bpy.types.Panel):
    bl_label = "Radiometric Linter"
    bl_context = 'render'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: Any) -> None:
        layout: Any = self.layout
        group = context.window_manager.radiometric_lint
        text = "Reading …" if group.busy else RADIOMETRIC_OT_lint.bl_label
        layout.operator("radiometric.lint", icon='VIEWZOOM', text=text)
        if not group.findings:
            return
        name = RADIOMETRIC_UL_findings.__name__
        layout.template_list(name, "", group, "findings", group, "active", rows=4)
        shown = group.findings[min(group.active, len(group.findings) - 1)]
        said = f"{shown.effect}, {shown.name}" if shown.effect else shown.name
        say(layout, context, said, ICONS[shown.severity])
        if shown.about in context.view_layer.objects:
            layout.operator("radiometric.select", text=shown.about).name = shown.about


PROPERTIES = (
    (bpy.types.WindowManager, "radiometric_lint", PointerProperty(type=RADIOMETRIC_PG_lint)),
)
