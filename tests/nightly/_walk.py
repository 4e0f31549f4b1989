# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a real Blender window: the first chapter of docs/guide.md, a picture at each stop.

Usage: blender -P _walk.py -- FOLDER: the pictures, and story.json with what came of it.
"""

import json
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy

OUT = Path(sys.argv[-1])
LONGEST_S = 240
LUMENS, CHECK, VIEW = (1117, 663), (1115, 548), (495, 500)  # places on the screen, 1200 × 720
ADDON = "bl_ext.user_default.radiometric.addon"
bpy.context.preferences.view.show_splash = False
story = {}


def area(kind):
    return next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == kind)


def picture(name):
    file = OUT / f"{name}.png"
    grab = ["import", "-window", "root", "+dither", "-colors", "128"]
    subprocess.run([*grab, str(file)], check=True)


def hands(*words):
    """Have xdotool move the mouse and press keys, as a hand would."""
    subprocess.run(["xdotool", *map(str, words)], check=True)


def until(done) -> Iterator[float]:
    for _ in range(LONGEST_S):
        if done():
            return
        yield 1


def type_lumens() -> Iterator[float]:
    """Type lumens into the panel of the lamp, and undo that; the panel is in the default engine."""
    name = bpy.context.object.data.name
    bpy.data.lights[name].radiometry.unit = 'lm'

    def value() -> float:
        return bpy.data.lights[name].radiometry.value

    area('PROPERTIES').spaces.active.context = 'DATA'
    bpy.ops.ed.undo_push(message="Lamp")
    yield 5
    hands("mousemove", *LUMENS, "click", "--repeat", 2, "--delay", 80, 1)
    yield 5
    hands("key", "ctrl+a", "type", "5000")
    yield 5
    hands("key", "Return")
    yield from until(lambda: abs(value() - 5000.0) < 1.0)
    yield 5
    story["typed_lm"] = value()
    picture("lumens")
    hands("mousemove", *VIEW, "key", "ctrl+z")
    yield from until(lambda: abs(value() - 5000.0) > 1.0)
    story["undone_lm"] = value()


def in_view(operator, **options):
    """Call an operator as from the 3D view."""
    view = area('VIEW_3D')
    region = next(r for r in view.regions if r.type == 'WINDOW')
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, area=view, region=region):
        return operator(**options)


def walk() -> Iterator[float]:
    """Do the steps; yield seconds to wait."""
    for found in list(bpy.data.objects):
        bpy.data.objects.remove(found)
    scene, add = bpy.context.scene, bpy.ops.object
    in_view(bpy.ops.mesh.primitive_plane_add, size=4)
    in_view(add.light_add, type='AREA', location=(0, 0, 2))
    bpy.context.object.name = "Lamp"
    bpy.context.object.data.size = 0.5
    yield from type_lumens()
    scene = bpy.context.scene
    in_view(add.camera_add, location=(0, -4, 2.5), rotation=(1.05, 0, 0))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = 96, 64
    scene.render.engine, own = 'RADIOMETRIC', scene.radiometric
    own.error, own.shading = 0.05, 'clay'
    area('PROPERTIES').spaces.active.context = 'RENDER'
    space = area('VIEW_3D').spaces.active
    space.shading.type, space.region_3d.view_perspective = 'RENDERED', 'CAMERA'
    scene.cursor.location = (0, 0, 0.001)
    yield 1
    in_view(bpy.ops.radiometric.add_meter, kind='LUX')
    meter = bpy.context.object
    meter.radiometric_meter.target = 500
    in_view(bpy.ops.radiometric.solve)
    story["meter_lx"] = sys.modules[f"{ADDON}.metering"].STATE.readings[meter.name].value
    drawing = sys.modules[f"{ADDON}.drawing"]
    yield 3
    yield from until(lambda: not any(v.refining for v in drawing.VIEWPORTS.values()))
    picture("desk")
    own.view = 'illuminance'
    yield 4
    picture("lux")
    own.view, own.tolerance = 'radiance', 0.05
    yield 5
    hands("mousemove", *CHECK, "click", 1)
    panel = sys.modules[f"{ADDON}.check_panel"]
    yield from until(panel._last)
    check = panel._last()
    yield from until(lambda: not check.running)
    yield 2
    story["verdict"] = check.document["verdict"] if check.document else check.error
    picture("agree")


def step() -> float | None:
    try:
        return next(steps)
    except StopIteration:
        pass
    except Exception:
        story["error"] = traceback.format_exc()
    (OUT / "story.json").write_text(json.dumps(story))
    bpy.ops.wm.quit_blender()
    return None


steps = walk()
bpy.app.timers.register(step, first_interval=2, persistent=True)
