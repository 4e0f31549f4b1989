# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a real Blender window: what we add to a redraw with 500 lights and 50 meters.

Usage: blender -P _redraw.py -- FOLDER: story.json with processor times [ms] of our functions alone.
"""

import inspect
import json
import sys
import time
from collections import Counter
from pathlib import Path

import addon_utils
import bpy
import numpy as np

OUT = Path(sys.argv[-1])
PACKAGE = "bl_ext.user_default.radiometric"
ADDON = f"{PACKAGE}.addon"
LIGHTS, METERS, DRAWS, LONGEST_S = 500, 50, 4, 200
KINDS = ('POINT', 'SPOT', 'AREA')
bpy.context.preferences.view.show_splash = False
spent = Counter()


def timed(owner, name):
    """Have the time of a function counted; calls of ours from ours are counted once."""
    function = getattr(owner, name)

    def measured(*args, **kwargs):
        start = time.thread_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent[f"{owner.__name__.rpartition('.')[2]}.{name}"] += time.thread_time() - start

    code = function.__code__
    names = [f"a{k}" for k in range(code.co_argcount)]  # Blender counts them
    names = ", ".join(names + ["*rest"] * bool(code.co_flags & inspect.CO_VARARGS))
    setattr(owner, name, eval(f"lambda {names}: measured({names})", {"measured": measured}))


def enable():
    """Return the processor time [s] of enabling, after once when files are compiled."""
    for _ in range(2):
        addon_utils.disable(PACKAGE)
        start = time.thread_time()
        addon_utils.enable(PACKAGE)
        found = time.thread_time() - start
    return found


def instrument():
    """Have our drawing, our overlays and our handlers counted."""
    modules = sys.modules[ADDON].MODULES
    sys.modules[ADDON].unregister()
    for module in modules:
        overlays, handlers = getattr(module, "OVERLAYS", ()), getattr(module, "HANDLERS", ())
        for name in {found.__name__ for found in (*overlays, *(h for _, h in handlers))}:
            timed(module, name)
        now = vars(module)
        module.OVERLAYS = [now[draw.__name__] for draw in overlays]
        module.HANDLERS = [(moment, now[handler.__name__]) for moment, handler in handlers]
        for found in list(now.values()):
            if isinstance(found, type) and found.__module__ == module.__name__:
                for method in {"draw", "draw_item", "view_update", "view_draw"} & set(vars(found)):
                    timed(found, method)
    sys.modules[ADDON].register()


def build():
    scene, rng = bpy.context.scene, np.random.default_rng(1)
    for found in list(bpy.data.objects):
        bpy.data.objects.remove(found)
    bpy.ops.mesh.primitive_plane_add(size=24)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=128)
    for k in range(LIGHTS):
        light = bpy.data.lights.new(f"Light {k}", KINDS[k % 3])
        light.energy = 10.0
        placed = bpy.data.objects.new(light.name, light)
        scene.collection.objects.link(placed)
        placed.location = rng.uniform((-9, -9, 2), (9, 9, 4))
    for k in range(METERS):
        meter = bpy.data.objects.new(f"Meter {k}", None)
        scene.collection.objects.link(meter)
        meter.location = rng.uniform((-9, -9, 0), (9, 9, 0.1))
        meter.radiometric_meter.kind, meter.radiometric_meter.target = 'LUX', 100.0
    scene.render.engine = 'RADIOMETRIC'
    scene.radiometric.shading, scene.radiometric.error = 'clay', 1.0
    bpy.context.view_layer.objects.active = bpy.data.objects["Light 1"]


def draws(change):
    """Return our milliseconds of each function a redraw, with a change before each."""
    spent.clear()
    for step in range(DRAWS):
        change(step)
        print(step, flush=True)
        bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)
    return {name: round(1e3 * s / DRAWS, 2) for name, s in spent.most_common() if s > 1e-5}


def walk():
    story["enabling_s"] = round(enable(), 3)
    instrument()
    build()
    screen = bpy.context.window_manager.windows[0].screen
    area = next(a for a in screen.areas if a.type == 'VIEW_3D')
    properties = next(a for a in screen.areas if a.type == 'PROPERTIES')
    area.spaces.active.shading.type = 'RENDERED'
    area.spaces.active.show_region_ui = True
    yield 1
    next(r for r in area.regions if r.type == 'UI').active_panel_category = "Radiometry"
    properties.spaces.active.context = 'DATA'
    metering = sys.modules[f"{ADDON}.metering"]
    viewports, start = sys.modules[f"{ADDON}.drawing"].VIEWPORTS, time.monotonic()
    for _ in range(LONGEST_S):
        yield 1
        if len(metering.STATE.readings) == METERS:
            story.setdefault("meters_read_s", round(time.monotonic() - start))
            if not any(v.refining for v in viewports.values()):
                break
    lamp = bpy.data.objects["Light 1"]
    story["meters_shown"] = len(metering.STATE.readings)
    for name, view in (("lights", 'radiance'), ("false_colour", 'illuminance')):
        bpy.context.scene.radiometric.view = view
        yield 2
        story[name] = draws(lambda step: None)
    properties.spaces.active.context = 'RENDER'
    yield 1
    story["render_panels"] = draws(lambda step: None)
    story["while_a_light_moves"] = draws(lambda step: setattr(lamp, "location", (step, 0, 3)))
    story["ms_a_redraw"] = max(
        sum(story[k].values()) for k in ("lights", "false_colour", "render_panels")
    )


def step():
    try:
        pause = next(steps)
        print(story, flush=True)
        return pause
    except StopIteration:
        pass
    except Exception as error:
        story["error"] = repr(error)
    (OUT / "story.json").write_text(json.dumps(story))
    bpy.ops.wm.quit_blender()
    return None


story = {}
steps = walk()
bpy.app.timers.register(step, first_interval=2, persistent=True)
