# SPDX-License-Identifier: GPL-3.0-or-later
"""Meters in the scene: read on a thread whenever it changes, and written over the viewport."""

from concurrent.futures import Future
from typing import Any, NamedTuple

import bpy

from ..blender_rad.errors import RadError
from . import beside, live
from .drawing import shadows

ERROR = 0.005  # relative, of live readings
LABELLED = 400  # cells of a grid that carry their number
APART = 20  # points, at least, between numbers of cells that are drawn
DOUBT = " (in doubt)"  # something that it sees, or is lit by, is not supported
MET = 0.02  # of a target: near enough
COLOURS = {None: (0.95, 0.95, 0.95), True: (0.35, 0.9, 0.45), False: (1.0, 0.55, 0.3)}
OLD = 0.45  # opacity of readings of a scene that has changed since


class Place(NamedTuple):
    """A meter as plain numbers, so that a thread can read it: points (n, 3) [m], one normal."""

    name: str
    kind: str
    points: Any
    normal: Any


class Reading(NamedTuple):
    """What a meter reads: its figures, in words, and those of a grid's cells with their places."""

    value: float
    text: str
    uniformity: float = 1.0
    cells: tuple[tuple[Any, str], ...] = ()


class Mark(NamedTuple):
    """A meter as it is shown: without a text until it is read, without a place where hidden."""

    name: str
    text: str | None
    met: bool | None
    place: Any
    cells: tuple[tuple[Any, str], ...]


class State:
    """What is known by now, and what is under way."""

    def __init__(self) -> None:
        self.readings: dict[str, Reading] = {}
        self.error = ""
        self.stale = False  # whether the scene has changed since the meters began to be read
        self.running = False
        self.marks: tuple[int, list[Mark]] | None = None  # of which scene; None to look again


STATE = State()


def meters(scene: Any) -> list[Any]:
    """Return the scene's meters by name."""
    found = (o for o in scene.objects if o.radiometric_meter.kind != 'NONE')
    return sorted(found, key=lambda o: o.name)


def _place(meter: Any, metre: float) -> Place:
    import numpy as np

    from ..blender_rad.meters import grid

    world = np.array(meter.matrix_world)
    world[:3] *= metre
    axes, origin = world[:3, :3], world[:3, 3]
    points, kind = origin[None], meter.radiometric_meter.kind
    if kind == 'GRID' and meter.type == 'MESH':
        corners = np.array(meter.bound_box)
        (x, y, _), (width, height, _) = corners.min(axis=0), np.ptp(corners, axis=0)
        corner = (world @ (x, y, corners[:, 2].max(), 1.0))[:3]
        u, v = axes[:, 0] * width, axes[:, 1] * height
        points = grid(corner, u, v, meter.radiometric_meter.spacing).points
    return Place(meter.name, kind, points, axes[:, 2] / np.linalg.norm(axes[:, 2]))


def scene_now(context: bpy.types.Context) -> tuple[Any, list[Place]]:
    """Return the scene as arrays, as the viewport has it, and its meters."""
    scene = live.scene_of(context.evaluated_depsgraph_get())
    return scene, [_place(meter, scene.unit_scale_m) for meter in meters(context.scene)]


def illuminance(meter: Any, places: list[Place]) -> tuple[list[Any], list[bool]]:
    """Return lux by light (n, lights) of places, all read at once, and which are in doubt."""
    import numpy as np

    points = np.concatenate([place.points for place in places])
    ends = np.cumsum([len(place.points) for place in places])[:-1]
    normals = np.concatenate([np.tile(p.normal, (len(p.points), 1)) for p in places])
    own = meter.read(points, normals)
    doubtful = np.any([np.zeros(len(points), bool), *own.excluded.values()], axis=0)
    return np.split(own.lights, ends), [bool(d.any()) for d in np.split(doubtful, ends)]


def read(scene: Any, places: list[Place], efficacy: float, error: float) -> dict[str, Reading]:
    """Return the readings by name; nothing of Blender is asked, so that any thread may."""
    from ..blender_rad.inspection import figure
    from ..blender_rad.meters import LuxMeter

    meter = LuxMeter(scene, efficacy=efficacy, error=error, threads=1)
    found: dict[str, Reading] = {}
    for place in places:
        if place.kind == 'NIT':
            look = meter.look(place.points[0], place.points[0] + place.normal)
            value, doubt = float(meter.weights @ look.radiance), DOUBT * bool(look.excluded)
            found[place.name] = Reading(value, f"{figure(value)} cd/m²{doubt}")
    lit = [place for place in places if place.kind != 'NIT']
    for place, lights, doubt in zip(lit, *illuminance(meter, lit), strict=True) if lit else ():
        lux = lights.sum(axis=1)
        value, text = float(lux.mean()), f"{figure(lux.mean())} lx"
        if place.kind == 'LUX':
            found[place.name] = Reading(value, text + DOUBT * doubt)
            continue
        even = float(lux.min() / value) if value else 0.0
        text += f" ({lux.min():.0f} to {lux.max():.0f}), U0 {even:.2f}"
        labels = place.points / scene.unit_scale_m if len(lux) <= LABELLED else ()
        cells = tuple((point, f"{cell:.0f}") for point, cell in zip(labels, lux, strict=False))
        found[place.name] = Reading(value, text + DOUBT * doubt, even, cells)
    return found


def start(context: bpy.types.Context) -> None:
    """Have the meters read on a thread; the scene's arrays are taken here and now."""
    STATE.stale = False
    try:
        scene, places = scene_now(context)
    except (RadError, ModuleNotFoundError) as error:
        STATE.error = str(error)
        return
    STATE.running = True
    beside.begin(_taken, read, scene, places, context.scene.radiometric.efficacy, ERROR)


def _taken(found: Future[dict[str, Reading]]) -> None:
    """Take what the thread has found; read again where the scene has changed meanwhile."""
    STATE.running = False
    try:
        STATE.readings, STATE.error = found.result(), ""
    except RadError as error:
        STATE.error = str(error)
    show()
    _again()


def show() -> None:
    STATE.marks = None
    beside.redraw('VIEW_3D')


def _again() -> None:
    """Read where that is wanted, and nothing is under way; as a timer too."""
    scene = bpy.context.scene
    if STATE.stale and not STATE.running and scene.radiometric_live and marks(scene):
        start(bpy.context)


def _wait() -> None:
    """Read soon: not in a handler, whose depsgraph is not done yet."""
    if not bpy.app.timers.is_registered(_again):
        bpy.app.timers.register(_again, first_interval=beside.POLL_S, persistent=True)


@bpy.app.handlers.persistent
def _changed(scene: Any, depsgraph: Any) -> None:
    """Ask for new readings where these are wanted live, once an animation stands still."""
    STATE.marks = None
    if not STATE.stale and any(
        update.is_updated_transform or update.is_updated_geometry or update.is_updated_shading
        for update in depsgraph.updates
    ):
        STATE.stale = True
    screen: Any = bpy.context.screen
    if STATE.stale and scene.radiometric_live and not (screen and screen.is_animation_playing):
        _wait()


def reread(block: Any, context: Any) -> None:
    STATE.stale = True
    _wait()


@bpy.app.handlers.persistent
def _forget(*_: Any) -> None:
    """Let go of another file's readings; read this one's."""
    STATE.readings, STATE.error, STATE.marks = {}, "", None
    reread(None, None)


def met(meter: Any) -> bool | None:
    """Return whether the meter's targets are met; None without a target or a reading."""
    reading, own = STATE.readings.get(meter.name), meter.radiometric_meter
    if reading is None or not own.target:
        return None
    if own.kind != 'GRID':
        return abs(reading.value - own.target) <= MET * own.target
    enough = reading.value >= (1.0 - MET) * own.target
    return enough and reading.uniformity >= own.uniformity


def marks(scene: Any) -> list[Mark]:
    """Return what there is to say of the scene's meters, from the last time if it can be."""
    if STATE.marks is None or STATE.marks[0] != scene.session_uid:
        rows: list[Mark] = []
        for meter in meters(scene):
            reading = STATE.readings.get(meter.name)
            place = meter.matrix_world.translation.copy() if meter.visible_get() else None
            cells = reading.cells if reading else ()
            rows.append(Mark(meter.name, reading and reading.text, met(meter), place, cells))
        STATE.marks = scene.session_uid, rows
    return STATE.marks[1]


def _draw() -> None:
    """Write the readings beside their meters, over the viewport."""
    import blf
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    context: Any = bpy.context
    if not STATE.readings or not context.space_data.overlay.show_overlays:
        return
    scale, region, view = context.preferences.system.ui_scale, context.region, context.region_data

    def seen(point: Any) -> Any:
        return location_3d_to_region_2d(region, view, point)

    def write(point: Any, text: str, offset: tuple[float, float]) -> None:
        if (spot := seen(point)) is not None:
            blf.position(0, spot.x + offset[0] * scale, spot.y + offset[1] * scale, 0)
            blf.draw(0, text)

    with shadows():
        for mark in marks(context.scene):
            if mark.text is None or mark.place is None:
                continue
            red, green, blue = COLOURS[mark.met]
            blf.color(0, red, green, blue, OLD if STATE.stale else 1.0)
            blf.size(0, 14 * scale)
            write(mark.place, mark.text, (10.0, 8.0))
            first = [spot for point, _ in mark.cells[:2] if (spot := seen(point))]
            if len(first) == 2 and (first[1] - first[0]).length > APART * scale:
                blf.size(0, 10 * scale)
                for point, number in mark.cells:
                    write(point, number, (-8.0, -4.0))


def disabled() -> None:
    STATE.__init__()


HANDLERS = (
    ("depsgraph_update_post", _changed),
    ("frame_change_post", _changed),
    ("animation_playback_post", _changed),
    ("load_post", _forget),
)
OVERLAYS = (_draw,)
TIMERS = (_again,)
