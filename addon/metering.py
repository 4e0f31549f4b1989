# SPDX-License-Identifier: GPL-3.0-or-later
"""Meters in the scene: read on a thread, shown in the viewport, met by solving the lights."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any, NamedTuple

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty

from ..blender_rad.errors import RadError
from . import beside, live
from .text import say

KINDS: Any = (
    ('LUX', "Lux Meter", "Illuminance on a surface that faces along its Z", 'LIGHT_SUN'),
    ('NIT', "Luminance Meter", "How bright what it sees along its Z looks", 'HIDE_OFF'),
    ('GRID', "Meter Grid", "Illuminance over its rectangle: average and uniformity", 'MESH_GRID'),
)
ERROR = 0.005  # relative, of live readings
LABELLED = 400  # cells of a grid that carry their number
APART = 20  # points, at least, between numbers of cells that are drawn
DOUBT = " (in doubt)"  # something that it sees, or is lit by, is not supported
MET = 0.02  # of a target: near enough
NEAR = (0.35, 0.9, 0.45, 1.0)
OFF = (1.0, 0.55, 0.3, 1.0)
PLAIN = (0.95, 0.95, 0.95, 1.0)


class Place(NamedTuple):
    """A meter as plain numbers, so that a thread can read it; lengths in metres."""

    name: str
    kind: str
    matrix: Any
    size: tuple[float, float]
    spacing: float


class Reading(NamedTuple):
    """What a meter reads: its figures, in words, and those of a grid's cells with their places."""

    value: float
    text: str
    cells: tuple[tuple[tuple[float, float, float], str], ...] = ()


class State:
    """What is known by now, and what is under way."""

    readings: dict[str, Reading]
    error = ""
    stale = False

    def __init__(self) -> None:
        self.readings = {}
        self.running = False
        self.handle: Any = None


STATE = State()


def meters(scene: Any) -> list[Any]:
    """Return the scene's meters by name."""
    return sorted(
        (o for o in scene.objects if o.radiometric_meter.kind != 'NONE'), key=lambda o: o.name
    )


def _place(meter: Any, metre: float) -> Place:
    import numpy as np

    own = meter.radiometric_meter
    corners = np.array(meter.bound_box) if meter.type == 'MESH' else np.zeros((8, 3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    world = np.array(meter.matrix_world)
    if meter.type == 'MESH':
        world[:3, 3] = (world @ [*low[:2], high[2], 1.0])[:3]
    world[:3] *= metre
    return Place(meter.name, own.kind, world, (high[0] - low[0], high[1] - low[1]), own.spacing)


def scene_now(context: bpy.types.Context) -> tuple[Any, list[Place]]:
    """Return the scene as arrays, as the viewport has it, and its meters."""
    scene = live.scene_of(context.evaluated_depsgraph_get())
    return scene, [_place(meter, scene.unit_scale_m) for meter in meters(context.scene)]


def read(scene: Any, places: list[Place], efficacy: float, error: float) -> dict[str, Reading]:
    """Return the readings by name; nothing of Blender is asked, so that any thread may."""
    import numpy as np

    from ..blender_rad.inspection import figure
    from ..blender_rad.meters import LuxMeter, grid

    meter = LuxMeter(scene, efficacy=efficacy, error=error, threads=1)
    found: dict[str, Reading] = {}
    for place in places:
        axes = place.matrix[:3, :3]
        normal, origin = axes[:, 2] / np.linalg.norm(axes[:, 2]), place.matrix[:3, 3]
        if place.kind == 'NIT':
            look = meter.look(origin, origin + normal)
            value = float(meter.weights @ look.radiance)
            found[place.name] = Reading(
                value, f"{figure(value)} cd/m²{DOUBT * bool(look.excluded)}"
            )
        elif place.kind == 'LUX':
            own = meter.read(origin[None], normal[None])
            value = float(own.illuminance[0])
            found[place.name] = Reading(value, f"{figure(value)} lx{DOUBT * bool(own.excluded)}")
        else:
            u, v = (axes[:, :2] * place.size).T
            cells = grid(origin, u, v, place.spacing)
            own = meter.read(cells.points, np.repeat(normal[None], len(cells.points), 0))
            lux = own.illuminance
            even = lux.min() / lux.mean() if lux.mean() else 0.0
            labels = cells.points / scene.unit_scale_m if len(lux) <= LABELLED else ()
            found[place.name] = Reading(
                float(lux.mean()),
                f"{figure(lux.mean())} lx, U0 {even:.2f}{DOUBT * bool(own.excluded)}",
                tuple((tuple(p), f"{x:.0f}") for p, x in zip(labels, lux, strict=False)),
            )
    return found


def start(context: bpy.types.Context) -> None:
    """Have the meters read on a thread; the scene's arrays are taken here and now."""
    STATE.stale, STATE.running = False, True
    scene, places = scene_now(context)
    beside.begin(_taken, read, scene, places, context.scene.radiometric.efficacy, ERROR)


def _taken(found: Future[dict[str, Reading]]) -> None:
    """Take what the thread has found; read again where the scene has changed meanwhile."""
    STATE.running = False
    try:
        STATE.readings, STATE.error = found.result(), ""
    except RadError as error:
        STATE.error = str(error)
    beside.redraw('VIEW_3D')
    _again()


def _again() -> None:
    """Read where that is wanted, and nothing is under way; as a timer too."""
    if STATE.stale and not STATE.running:
        try:
            start(bpy.context)
        except RadError as error:
            STATE.running, STATE.error = False, str(error)


def _wait() -> None:
    """Read soon: not in a handler, whose depsgraph is not done yet."""
    if not bpy.app.timers.is_registered(_again):
        bpy.app.timers.register(_again, first_interval=beside.POLL_S)


@bpy.app.handlers.persistent
def _changed(scene: Any, depsgraph: Any) -> None:
    """Ask for new readings where these are wanted live."""
    if scene.radiometric_live and any(
        update.is_updated_transform or update.is_updated_geometry or update.is_updated_shading
        for update in depsgraph.updates
    ):
        STATE.stale = True
        _wait()


def _toggled(scene: Any, _: bpy.types.Context) -> None:
    STATE.stale = scene.radiometric_live
    _wait()


@bpy.app.handlers.persistent
def _forget(*_: Any) -> None:
    """Let go of another file's readings."""
    STATE.readings, STATE.error, STATE.stale = {}, "", False


def met(meter: Any) -> bool | None:
    """Return whether the meter's target is met; None without a target or a reading."""
    reading, target = STATE.readings.get(meter.name), meter.radiometric_meter.target
    if reading is None or not target:
        return None
    short = reading.value - target
    return short >= -MET * target if meter.type == 'MESH' else abs(short) <= MET * target


def _draw() -> None:
    """Write the readings beside their meters, over the viewport."""
    import blf
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    context: Any = bpy.context
    if not STATE.readings or not context.space_data.overlay.show_overlays:
        return
    scale = context.preferences.system.ui_scale

    def seen(point: Any) -> Any:
        return location_3d_to_region_2d(context.region, context.region_data, point)

    def write(point: Any, text: str, size: float, colour: Any, offset: tuple[float, float]) -> None:
        if (spot := seen(point)) is not None:
            blf.size(0, size * scale)
            blf.color(0, *colour)
            blf.position(0, spot.x + offset[0] * scale, spot.y + offset[1] * scale, 0)
            blf.draw(0, text)

    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 0, 0.0, 0.0, 0.0, 0.9)  # a soft one takes 25 copies of each letter
    blf.shadow_offset(0, 1, -1)
    for meter in meters(context.scene):
        reading = STATE.readings.get(meter.name)
        if reading is None or not meter.visible_get():
            continue
        colour = {None: PLAIN, True: NEAR, False: OFF}[met(meter)]
        write(meter.matrix_world.translation, reading.text, 14, colour, (10.0, 8.0))
        first = [spot for point, _ in reading.cells[:2] if (spot := seen(point))]
        if len(first) == 2 and (first[1] - first[0]).length > APART * scale:
            for point, text in reading.cells:
                write(point, text, 10, PLAIN, (-8.0, -4.0))
    blf.disable(0, blf.SHADOW)


class RADIOMETRIC_PG_meter(bpy.types.PropertyGroup):
    """What makes an object a meter."""

    kind: EnumProperty(name="Kind", items=(('NONE', "None", "No meter"), *(k[:3] for k in KINDS)))
    target: FloatProperty(
        name="Target", description="Lux that it shall read, on average; 0 wants none", min=0.0
    )
    spacing: FloatProperty(
        name="Spacing", description="Between the cells of a grid, in metres", default=0.5, min=0.01
    )

    @classmethod
    def register(cls) -> None:
        bpy.types.Object.radiometric_meter = PointerProperty(type=cls)
        bpy.types.Scene.radiometric_live = BoolProperty(
            name="Live",
            description="Read again, beside your work, whenever the scene changes",
            update=_toggled,
        )

    @classmethod
    def unregister(cls) -> None:
        del bpy.types.Object.radiometric_meter, bpy.types.Scene.radiometric_live


class RADIOMETRIC_OT_add_meter(bpy.types.Operator):
    """Add a meter at the 3D cursor, looking up; turn it to where it shall look."""

    bl_idname = "radiometric.add_meter"
    bl_label = "Add Meter"
    bl_options = {'REGISTER', 'UNDO'}

    kind: EnumProperty(name="Kind", items=[kind[:3] for kind in KINDS])

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .light_panel import at_cursor

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
        return {'FINISHED'}


class RADIOMETRIC_OT_read_meters(bpy.types.Operator):
    """Read all meters of the scene, beside your work: the direct light, as the viewport has it."""

    bl_idname = "radiometric.read_meters"
    bl_label = "Read Meters"

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            start(context)
        except RadError as error:
            STATE.error = str(error)
        if STATE.error:
            self.report({'ERROR'}, STATE.error)
            return {'CANCELLED'}
        return {'FINISHED'}


class RADIOMETRIC_OT_solve(bpy.types.Operator):
    """Set the power of the lights so that the lux meters read their targets, as near as may be."""

    bl_idname = "radiometric.solve"
    bl_label = "Solve Lights for Targets"
    bl_options = {'REGISTER', 'UNDO'}

    selected: BoolProperty(name="Selected Lights Only", description="Leave the others as they are")

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            missed = self._solve(context)
        except RadError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        if missed:
            self.report({'WARNING'}, f"Out of reach, animated or driven: {', '.join(missed)}")
        return {'FINISHED'}

    def _solve(self, context: bpy.types.Context) -> list[str]:
        import numpy as np

        from ..blender_rad.bpy_io.powers import scale_power
        from ..blender_rad.meters import LuxMeter
        from ..blender_rad.solving import factors

        scene, places = scene_now(context)
        targets = {m.name: m.radiometric_meter.target for m in meters(context.scene)}
        chosen = [p for p in places if p.kind == 'LUX' and targets[p.name]]
        if not chosen:
            raise RadError("nothing to solve for", "meters", "expected a lux meter with a target")
        efficacy = context.scene.radiometric.efficacy
        axes = np.array([p.matrix[:3, 2] for p in chosen])
        normals = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        meter = LuxMeter(scene, efficacy=efficacy, error=ERROR)
        shares = meter.read(np.array([p.matrix[:3, 3] for p in chosen]), normals).lights
        picked = {o.name for o in context.selected_objects}
        free = np.array([not self.selected or name in picked for name in meter.names], bool)
        wanted = np.array([targets[p.name] for p in chosen]) - shares[:, ~free].sum(axis=1)
        for name, factor in zip(
            np.array(meter.names)[free], factors(shares[:, free], wanted), strict=True
        ):
            scale_power(context.scene, str(name), float(factor))
        context.view_layer.update()
        scene, places = scene_now(context)
        STATE.readings = read(scene, places, efficacy, ERROR)
        return [m.name for m in meters(context.scene) if met(m) is False]


class RADIOMETRIC_PT_meters(bpy.types.Panel):
    """Meters, their targets, and what they read."""

    bl_label = "Light Meters"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "Radiometry"

    def draw(self, context: bpy.types.Context) -> None:
        layout, found = self.layout, meters(context.scene)
        row = layout.row(align=True)
        for (kind, _, _, icon), text in zip(KINDS, ("Lux", "cd/m²", "Grid"), strict=True):
            row.operator("radiometric.add_meter", text=text, icon=icon).kind = kind
        for meter in found:
            box = layout.box()
            row = box.row()
            mark: Any = {None: 'BLANK1', True: 'CHECKMARK', False: 'ERROR'}[met(meter)]
            row.label(text=meter.name, icon=mark)
            right = row.row()
            right.alignment = 'RIGHT'
            reading = STATE.readings.get(meter.name)
            right.label(text=reading.text if reading else "–")
            own = meter.radiometric_meter
            row = box.row(align=True)
            if own.kind != 'NIT':
                row.prop(own, "target", text="Target lx")
            if own.kind == 'GRID':
                row.prop(own, "spacing")
        if not found:
            layout.label(text="No meters yet: add one above", icon='INFO')
            return
        row = layout.row(align=True)
        row.operator("radiometric.read_meters", icon='FILE_REFRESH')
        row.prop(context.scene, "radiometric_live", toggle=True)
        layout.operator("radiometric.solve", icon='LIGHT')
        if STATE.error:
            say(layout, context, STATE.error, 'ERROR')


class RADIOMETRIC_MT_meters(bpy.types.Menu):
    """Meters to add."""

    bl_label = "Light Meter"

    def draw(self, context: bpy.types.Context) -> None:
        for kind, name, _, icon in KINDS:
            self.layout.operator("radiometric.add_meter", text=name, icon=icon).kind = kind


def _add_menu(self: Any, _: bpy.types.Context) -> None:
    self.layout.menu(RADIOMETRIC_MT_meters.__name__, icon='LIGHT_SUN')


_register, _unregister = bpy.utils.register_classes_factory(  # pyright: ignore[reportGeneralTypeIssues] - pair
    (
        RADIOMETRIC_PG_meter,
        RADIOMETRIC_OT_add_meter,
        RADIOMETRIC_OT_read_meters,
        RADIOMETRIC_OT_solve,
        RADIOMETRIC_PT_meters,
        RADIOMETRIC_MT_meters,
    )
)


def register() -> None:
    _register()
    bpy.types.VIEW3D_MT_add.append(_add_menu)
    bpy.app.handlers.depsgraph_update_post.append(_changed)
    bpy.app.handlers.load_post.append(_forget)
    if not bpy.app.background:
        STATE.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), 'WINDOW', 'POST_PIXEL')


def unregister() -> None:
    if STATE.handle:
        bpy.types.SpaceView3D.draw_handler_remove(STATE.handle, 'WINDOW')
    bpy.app.handlers.load_post.remove(_forget)
    bpy.app.handlers.depsgraph_update_post.remove(_changed)
    bpy.types.VIEW3D_MT_add.remove(_add_menu)
    if bpy.app.timers.is_registered(_again):
        bpy.app.timers.unregister(_again)
    STATE.__init__()
    _unregister()
