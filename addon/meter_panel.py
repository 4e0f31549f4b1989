# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does with meters: add them, give them targets, have the lights meet these."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty

from ..blender_rad.errors import RadError
from .metering import ERROR, MET, STATE, illuminance, marks, meters, reread, scene_now, show, start
from .shared import Action, at_cursor, say

KINDS: Any = (
    ('LUX', "Lux Meter", "Illuminance on a surface that faces along its Z", 'LIGHT_SUN'),
    ('NIT', "Luminance Meter", "How bright what it sees along its Z looks", 'HIDE_OFF'),
    ('GRID', "Meter Grid", "Illuminance over its rectangle: average and uniformity", 'MESH_GRID'),
)
STANDARDS = {  # EN 12464-1:2011: maintained illuminance [lx] and its uniformity, at the task
    "Corridor, stairs": (100, 0.4),
    "Storage": (100, 0.4),
    "Canteen, rest room": (200, 0.4),
    "Archive": (200, 0.4),
    "Classroom": (300, 0.6),
    "Reception": (300, 0.6),
    "Lecture hall": (500, 0.6),
    "Office: writing, reading, screens": (500, 0.6),
    "Conference room": (500, 0.6),
    "Technical drawing": (750, 0.7),
}
ICONS: dict[bool | None, Any] = {None: 'BLANK1', True: 'CHECKMARK', False: 'ERROR'}


def _judged(meter: Any, context: bpy.types.Context) -> None:
    show()


class RADIOMETRIC_PG_meter(bpy.types.PropertyGroup):
    kind: EnumProperty(name="Kind", items=(('NONE', "None", "No meter"), *(k[:3] for k in KINDS)))
    target: FloatProperty(
        name="Target",
        description="Lux that it shall read, on average; 0 wants none",
        min=0.0,
        update=_judged,
    )
    uniformity: FloatProperty(
        name="Uniformity U0",
        description="Least over average illuminance that a grid shall have",
        min=0.0,
        max=1.0,
        update=_judged,
    )
    spacing: FloatProperty(
        name="Spacing",
        description="Between the cells of a grid, in metres",
        default=0.5,
        min=0.01,
        update=reread,
    )


class RADIOMETRIC_OT_add_meter(Action, bpy.types.Operator):
    """Add a meter at the 3D cursor, looking up; turn it to where it shall look."""

    bl_idname = "radiometric.add_meter"
    bl_label = "Add Meter"
    bl_options = {'REGISTER', 'UNDO'}

    kind: EnumProperty(name="Kind", items=[kind[:3] for kind in KINDS])

    def work(self, context: bpy.types.Context) -> None:
        metre = context.scene.unit_settings.scale_length or 1.0
        if self.kind == 'GRID':
            half = 2.0 / metre
            mesh = bpy.data.meshes.new("Meter Grid")
            corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
            mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
            made = bpy.data.objects.new(mesh.name, mesh)
            made.display_type, made.hide_render = 'WIRE', True
            for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
                setattr(made, f"visible_{ray}", False)
        else:
            made = bpy.data.objects.new("Meter" if self.kind == 'LUX' else "Luminance Meter", None)
            made.empty_display_type = 'SINGLE_ARROW'
            made.empty_display_size = 0.3 / metre
            if self.kind == 'LUX':
                made["meter"] = "lux"  # what `measure` reads on a command line
        made.radiometric_meter.kind = self.kind
        at_cursor(context, made)


class RADIOMETRIC_OT_read_meters(bpy.types.Operator):
    """Read all meters of the scene, beside your work: the direct light, as the viewport has it."""

    bl_idname = "radiometric.read_meters"
    bl_label = "Read Meters"

    def execute(self, context: bpy.types.Context) -> set[str]:
        start(context)
        if STATE.error:
            self.report({'ERROR'}, STATE.error)
            return {'CANCELLED'}
        return {'FINISHED'}


class RADIOMETRIC_OT_standard(Action, bpy.types.Operator):
    """Take the target of a standard for the active meter."""

    bl_idname = "radiometric.standard"
    bl_label = "EN 12464-1"
    bl_options = {'REGISTER', 'UNDO'}

    task: EnumProperty(
        name="Task",
        items=[
            (name, name, f"{lux} lx, U0 {even:g} (EN 12464-1:2011)")
            for name, (lux, even) in STANDARDS.items()
        ],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.radiometric_meter.kind != 'NONE'

    def work(self, context: bpy.types.Context) -> None:
        own = context.object.radiometric_meter
        own.target, own.uniformity = STANDARDS[self.task]


class RADIOMETRIC_OT_solve(Action, bpy.types.Operator):
    """Set the power of the lights so that the meters read their targets, as near as may be."""

    bl_idname = "radiometric.solve"
    bl_label = "Solve Lights for Targets"
    bl_options = {'REGISTER', 'UNDO'}

    selected: BoolProperty(name="Selected Lights Only", description="Leave the others as they are")

    def work(self, context: bpy.types.Context) -> None:
        import numpy as np

        from ..blender_rad.bpy_io.powers import scale_power
        from ..blender_rad.meters import LuxMeter
        from ..blender_rad.solving import factors

        scene, places = scene_now(context)
        targets = {m.name: m.radiometric_meter.target for m in meters(context.scene)}
        chosen = [p for p in places if p.kind != 'NIT' and targets[p.name]]
        if not chosen:
            raise RadError("nothing to solve for", "meters", "expected one with a target in lux")
        meter = LuxMeter(scene, efficacy=context.scene.radiometric.efficacy, error=ERROR)
        shares = np.array([cells.mean(axis=0) for cells in illuminance(meter, chosen)[0]])
        picked = {o.name for o in context.selected_objects}
        free = np.array([not self.selected or name in picked for name in meter.names], bool)
        wanted = np.array([targets[p.name] for p in chosen]) - shares[:, ~free].sum(axis=1)
        found = factors(shares[:, free], wanted)
        for name, factor in zip(np.array(meter.names)[free], found, strict=True):
            scale_power(context.scene, str(name), float(factor))
        context.view_layer.update()
        start(context)
        off = zip(chosen, np.abs(shares[:, free] @ found - wanted), strict=True)
        if missed := [place.name for place, by in off if by > MET * targets[place.name]]:
            self.report({'WARNING'}, f"Out of reach: {', '.join(missed)}")


class RADIOMETRIC_PT_meters(bpy.types.Panel):
    bl_label = "Light Meters"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "Radiometry"

    def draw(self, context: bpy.types.Context) -> None:
        layout, found = self.layout, marks(context.scene)
        row = layout.row(align=True)
        for (kind, _, _, icon), text in zip(KINDS, ("Lux", "cd/m²", "Grid"), strict=True):
            row.operator("radiometric.add_meter", text=text, icon=icon).kind = kind
        if not found:
            layout.label(text="No meters yet: add one above", icon='INFO')
            return
        column = layout.box().column(align=True)
        column.active = not STATE.stale
        for mark in found:
            row = column.split(factor=0.4)
            left, name, icon = row.row(), mark.name, ICONS[mark.met]
            left.alignment = 'LEFT'
            left.operator("radiometric.select", text=name, icon=icon, emboss=False).name = name
            row.label(text=mark.text or "…")
        if context.object and context.object.radiometric_meter.kind in {'LUX', 'GRID'}:
            self._draw_active(context)
        row = layout.row(align=True)
        row.operator("radiometric.read_meters", icon='FILE_REFRESH')
        row.prop(context.scene, "radiometric_live", toggle=True)
        layout.operator("radiometric.solve", icon='LIGHT')
        if STATE.error:
            say(layout, context, STATE.error, 'ERROR')

    def _draw_active(self, context: bpy.types.Context) -> None:
        own = context.object.radiometric_meter
        column = self.layout.column(align=True)
        column.use_property_split = True
        column.prop(own, "target", text="Target lx")
        if own.kind == 'GRID':
            column.prop(own, "uniformity")
            column.prop(own, "spacing")
        column.operator_menu_enum("radiometric.standard", "task", text="Target of a Standard")


class RADIOMETRIC_MT_meters(bpy.types.Menu):
    bl_label = "Light Meter"

    def draw(self, context: bpy.types.Context) -> None:
        for kind, name, _, icon in KINDS:
            self.layout.operator("radiometric.add_meter", text=name, icon=icon).kind = kind


def _add_menu(self: Any, _: bpy.types.Context) -> None:
    self.layout.menu(RADIOMETRIC_MT_meters.__name__, icon='LIGHT_SUN')


_LIVE = BoolProperty(
    name="Live",
    description="Read again, beside your work, whenever the scene changes",
    default=True,
    update=reread,
)
PROPERTIES = (
    (bpy.types.Object, "radiometric_meter", PointerProperty(type=RADIOMETRIC_PG_meter)),
    (bpy.types.Scene, "radiometric_live", _LIVE),
)
MENUS = ((bpy.types.VIEW3D_MT_add, _add_menu),)
