# SPDX-License-Identifier: GPL-3.0-or-later
"""The Radiometry panels of lights, materials and worlds, in every engine."""

import math
import pickle
from typing import Any

import bpy
from bpy.props import StringProperty

from ..blender_rad.errors import RadError
from ..blender_rad.quantities import unit_named
from . import readout, stating
from .shared import Action, InProperties, at_cursor, say

READ = (  # what, its key, and its unit
    ("Flux Φ", "luminous_flux_lm", "lm"),
    ("Φ", "radiant_flux_W", "W"),
    ("Intensity I", "peak_luminous_intensity_cd", "cd"),
    ("Luminance L", "luminance_cd_m2", "cd/m²"),
    ("", "facing_lx", "lx"),
    ("Colour", "correlated_colour_temperature_K", "K"),
)


def _block(context: bpy.types.Context) -> Any:
    """Return the light, material or world that the Properties editor shows."""
    return next(
        (b for name in ("light", "material", "world") if (b := getattr(context, name, None))), None
    )


class RADIOMETRIC_MT_unit(bpy.types.Menu):
    bl_label = "Unit"

    def draw(self, context: bpy.types.Context) -> None:
        from ..blender_rad.stated import FORMS

        block = _block(context)
        kind = block.type if isinstance(block, bpy.types.Light) else block.id_type
        for unit in FORMS[kind]:
            row = self.layout.row()
            light = isinstance(block, bpy.types.Light)
            row.enabled = not light or stating.drawn(stating.defined, block, unit)
            row.prop_enum(block.radiometry, "unit", unit)


def draw_value(layout: Any, block: Any) -> str:
    """Draw value and unit; return the unit."""
    unit = stating.unit_of(block)
    quantity = unit_named(unit).quantity.words.split()[-1].capitalize()
    row = layout.row(align=True)
    row.prop(block.radiometry, "value", text=quantity)
    menu = row.row(align=True)
    menu.ui_units_x = 3.0
    menu.menu(RADIOMETRIC_MT_unit.__name__, text=stating.LABELS[unit])
    return unit


class RADIOMETRIC_PT_light(InProperties, bpy.types.Panel):
    bl_label = "Radiometry"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.light is not None

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        self.layout.operator("radiometric.source", text="", icon='PRESET', emboss=False)

    def draw(self, context: bpy.types.Context) -> None:
        layout, light = self.layout, context.light
        group = light.radiometry
        layout.use_property_split = True
        layout.use_property_decorate = False
        unit = draw_value(layout, light)
        if unit in {'lx', 'W/m2'} and light.type != 'SUN':
            layout.prop(group, "distance")
        if not stating.drawn(stating.defined, light, unit):
            layout.label(text="This light has none: choose another unit", icon='INFO')
        layout.prop(group, "spectrum", icon='COLOR')
        if error := group.get("error"):
            say(layout, context, error, 'ERROR')
        layout.prop(group, "efficacy")
        column = layout.column(align=True)
        if light.type == 'SPOT':
            column.prop(group, "keep_flux")
        if stating.unit_scale() != 1.0:
            column.prop(group, "compensate")
        if stating.value_curves(light):
            column = layout.column()
            say(column, context, "Keys on the value need this add-on where it renders", 'INFO')
            column.operator("radiometric.keys_to_power")


def _asked(light: Any, name: str | None, point: Any) -> bytes:
    """Return the arguments of `readout.row`, at a point seen by the object of that name."""
    matrix = bpy.data.objects[name].matrix_world if name else None
    group = light.radiometry
    model = 'cycles' if group.compensate else 'physical'
    return pickle.dumps((stating.record_of(light, matrix), stating.convention(group), model, point))


class RADIOMETRIC_PT_emits(InProperties, bpy.types.Panel):
    bl_label = "What It Emits"
    bl_parent_id = "RADIOMETRIC_PT_light"
    bl_context = "data"

    def draw(self, context: bpy.types.Context) -> None:
        layout, light, scene = self.layout, context.light, context.scene
        group, placed = light.radiometry, context.object
        at_cursor = scene.radiometric_at_cursor and placed and placed.data == light
        where = (placed.name, tuple(scene.cursor.location)) if at_cursor else (None, None)
        row = readout.known(light.name, stating.drawn(_asked, light, *where))
        if row is None:
            layout.label(text="Reading …")
            return
        from ..blender_rad.inspection import figure

        place = "at the Cursor" if at_cursor else f"at {group.distance:g} m"
        facing = "E" if light.type == 'SUN' else f"E {place}"
        column = layout.column(align=True)
        for words, key, unit in READ:
            if row[key] is None:
                continue
            split = column.split(factor=0.4)
            name = split.row()
            name.alignment = 'RIGHT'
            name.active = False
            name.label(text=words or facing)
            value = split.row()
            value.label(text=f"{figure(row[key])} {unit}")
            if not words and light.type != 'SUN':
                value.prop(scene, "radiometric_at_cursor", text="", icon='CURSOR', emboss=False)
        notes = layout.column(align=True)
        notes.active = False
        for note in row["notes"]:
            say(notes, context, note.replace("--", ""), 'DOT')


class _Glow(InProperties):
    bl_label = "Radiometry"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _block(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, block = self.layout, _block(context)
        layout.use_property_split = True
        layout.use_property_decorate = False
        if not stating.glows(block):
            layout.label(text="Textured or mixed: not one number", icon='INFO')
            return
        draw_value(layout, block)
        layout.prop(block.radiometry, "efficacy")


class RADIOMETRIC_PT_material(_Glow, bpy.types.Panel):
    bl_context = "material"


class RADIOMETRIC_PT_world(_Glow, bpy.types.Panel):
    bl_context = "world"


class RADIOMETRIC_OT_keys_to_power(Action, bpy.types.Operator):
    """Move the keys of the value to Blender's own power, which needs no add-on where it renders."""

    bl_idname = "radiometric.keys_to_power"
    bl_label = "Move Keys to Power"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return getattr(context, "light", None) is not None

    def work(self, context: bpy.types.Context) -> None:
        if stating.unit_of(context.light) == 'EV100':
            raise RadError("EV is not in proportion to power", "Unit", "choose another first")
        stating.move_keys(context.light)


class RADIOMETRIC_OT_source(Action, bpy.types.Operator):
    """Make the active light a real one, with its lumens, colour and size."""

    bl_idname = "radiometric.source"
    bl_label = "Real Light Source"
    bl_options = {'REGISTER', 'UNDO'}
    bl_property = "source"

    def _items(self, context: bpy.types.Context | None) -> list[tuple[str, str, str]]:
        from .sources import items

        return items()

    source: bpy.props.EnumProperty(name="Source", items=_items)
    add: bpy.props.BoolProperty(name="Add", options={'HIDDEN', 'SKIP_SAVE'})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.invoke_search_popup(self)
        return {'RUNNING_MODAL'}

    def work(self, context: bpy.types.Context) -> None:
        from .sources import SOURCES, apply

        light = getattr(context, "light", None)
        active = context.object
        if light is None and active is not None and active.type == 'LIGHT':
            light = active.data
        if self.add:
            light = bpy.data.lights.new(self.source, 'POINT')
            at_cursor(context, bpy.data.objects.new(light.name, light))
        if light is None:
            raise RadError("no light", "Real Light Source", "select one, or add one")
        source = SOURCES[self.source]
        apply(light, source)
        self.report({'INFO'}, f"{self.source}: ± {source.uncertainty_percent:g} %, {source.origin}")


class RADIOMETRIC_OT_luminaire(Action, bpy.types.Operator):
    """Add a luminaire from its photometric file: its candelas, and its luminous opening."""

    bl_idname = "radiometric.luminaire"
    bl_label = "Luminaire (IES, LDT)"
    bl_options = {'REGISTER', 'UNDO'}

    filepath: StringProperty(subtype='FILE_PATH')
    filter_glob: StringProperty(default="*.ies;*.ldt;*.IES;*.LDT", options={'HIDDEN'})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def work(self, context: bpy.types.Context) -> None:
        from ..blender_rad.bpy_io.ies import add_photometric_light
        from ..blender_rad.photometry import read_photometry

        found = read_photometry(self.filepath)
        lamp = add_photometric_light(found)
        at_cursor(context, lamp)
        _outline(context, lamp, found.opening)
        for finding in found.findings:
            self.report({'INFO' if finding.severity == "info" else 'WARNING'}, str(finding))


def _outline(context: bpy.types.Context, lamp: Any, opening: Any) -> None:
    """Show a luminaire's luminous opening as an outline, which does not render."""
    metre = stating.unit_scale()
    half = [0.5 * abs(side) / metre for side in (opening.along_c0, opening.along_c90)]
    if not all(half):
        return
    rectangle = opening.shape in {"rectangular", "box"}
    count = 4 if rectangle else 32
    turns = [2.0 * math.pi * (k + 0.5 * rectangle) / count for k in range(count)]
    reach = math.sqrt(2.0) if rectangle else 1.0
    corners = [(reach * half[0] * math.cos(t), reach * half[1] * math.sin(t), 0.0) for t in turns]
    mesh = bpy.data.meshes.new(f"{lamp.name} Opening")
    mesh.from_pydata(corners, [(k, (k + 1) % count) for k in range(count)], [])
    outline = bpy.data.objects.new(mesh.name, mesh)
    outline.hide_render, outline.parent = True, lamp
    context.collection.objects.link(outline)


def _add_menu(self: Any, _: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator("radiometric.source", text="Real Source …", icon='LIGHT').add = True
    self.layout.operator("radiometric.luminaire", icon='LIGHT_SPOT')


PROPERTIES = (
    (
        bpy.types.Scene,
        "radiometric_at_cursor",
        bpy.props.BoolProperty(
            name="At the 3D Cursor", description="Read E at the 3D cursor, facing the light"
        ),
    ),
)
MENUS = ((bpy.types.VIEW3D_MT_light_add, _add_menu),)
