# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in a real Blender window: the first chapter of docs/guide.md by mouse and keyboard alone.

Usage: blender -P _walk.py -- FOLDER: a picture at each stop, and story.json with what came of it.
"""

import json
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

OUT = Path(sys.argv[-1])
LONGEST_S = 300
ADDON = "bl_ext.user_default.radiometric.addon"
# Places on the screen, 1200 × 720, once the Properties editor is as wide as WIDER makes it.
VIEW, WIDER = (435, 500), ((986, 400), (950, 400), (910, 400), (869, 400))
LIGHT_TAB, RENDER_TAB, FIRST_PANEL, SECOND_PANEL = (887, 515), (887, 238), (960, 269), (960, 297)
UNIT, LUMENS, VALUE = (1158, 357), (1106, 401), (1080, 356)
ENGINE, RADIOMETRIC, RENDERED = (1105, 235), (1068, 328), (855, 40)
SIDEBAR_TAB, TARGET, SOLVE = (854, 338), (745, 190), (710, 263)
FALSE_COLOUR, ILLUMINANCE = (1090, 328), (1090, 375)
TOLERANCE, CHECK = (1090, 356), (1045, 460)
Steps = Iterator[float]  # seconds to wait, in which Blender takes what it was given
bpy.context.preferences.view.show_splash = False
story = {}


def picture(name: str) -> None:
    file = OUT / f"{name}.png"
    grab = ["import", "-window", "root", "+dither", "-colors", "255"]
    subprocess.run([*grab, str(file)], check=True)


def hands(*words: object) -> None:
    """Have xdotool move the mouse and press keys, as a hand would."""
    subprocess.run(["xdotool", *map(str, words)], check=True)


def click(place: tuple[int, int], times: int = 1) -> Steps:
    hands("mousemove", *place)
    yield 1
    hands("click", "--repeat", times, "--delay", 80, 1)
    yield 2


def press(*keys: object) -> Steps:
    hands("mousemove", *VIEW)
    yield 0.5
    hands("key", "--delay", 60, *keys)
    yield 2


def fill(place: tuple[int, int], text: str) -> Steps:
    yield from click(place, 2)
    hands("key", "ctrl+a", "type", text)
    yield 1
    hands("key", "Return")
    yield 1


def add(words: str) -> Steps:
    """Take what the Add menu finds for words."""
    yield from press("shift+a")
    hands("type", words)
    yield 3
    hands("key", "Return")
    yield 2


def until(done: Callable[[], object]) -> Steps:
    for _ in range(LONGEST_S):
        if done():
            return
        yield 1


def desk() -> Steps:
    """Leave nothing but a desk of 4 m and a lamp of 0.5 m, 2 m above it."""
    yield from press("a", "Delete")
    yield from add("plane")
    yield from press("s", "2", "Return")
    yield from add("area")
    yield from press("s", "0", "period", "5", "Return")
    yield from press("g", "z", "2", "Return")
    hands("mousemove", *WIDER[0], "mousedown", 1)
    for place in WIDER[1:]:
        yield 1
        hands("mousemove", *place)
    yield 1
    hands("mouseup", 1)
    yield 1


def type_lumens() -> Steps:
    """State the lamp in lumens, take it back, and do it again."""

    readout = sys.modules[f"{ADDON}.readout"]

    def value() -> float:
        return bpy.data.lights[0].radiometry.value

    yield from click(LIGHT_TAB)
    yield from click(SECOND_PANEL)
    yield from until(lambda: readout._last)
    yield from click(UNIT)
    yield from click(LUMENS)
    yield from fill(VALUE, "5000")
    yield from until(lambda: abs(value() - 5000.0) < 1.0)
    yield 3
    story["typed_lm"] = value()
    picture("lumens")
    yield from press("ctrl+z")
    yield from until(lambda: abs(value() - 5000.0) > 1.0)
    story["undone_lm"] = value()
    yield from press("ctrl+shift+z")


def walk() -> Steps:
    modules = {name.removeprefix(f"{ADDON}."): found for name, found in sys.modules.items()}
    metering, panel = modules["metering"], modules["check_panel"]
    viewports = modules["drawing"].VIEWPORTS

    def lux() -> float:
        reading = metering.STATE.readings.get("Meter")
        return 0.0 if reading is None or metering.STATE.stale else reading.value

    def drawn() -> bool:
        return bool(viewports) and not any(v.refining for v in viewports.values())

    yield from desk()
    yield from type_lumens()
    yield from press("Home")
    yield from add("camera")
    yield from press("ctrl+alt+KP_0")
    yield from click(RENDER_TAB)
    yield from click(ENGINE)
    yield from click(RADIOMETRIC)
    yield from click(RENDERED)
    yield from add("lux")
    yield from press("n")
    yield from click(SIDEBAR_TAB)
    yield from until(lux)
    story["before_lx"] = lux()
    yield from fill(TARGET, "500")
    yield from click(SOLVE)
    yield from until(lambda: abs(lux() - 500) < 5)
    story["meter_lx"] = lux()
    yield from until(drawn)
    yield 2
    picture("desk")
    for place in (FIRST_PANEL, SECOND_PANEL, FALSE_COLOUR, ILLUMINANCE):
        yield from click(place)
    yield from until(drawn)
    yield 3
    picture("lux")
    yield from click(SECOND_PANEL)
    yield from fill(TOLERANCE, ".05")
    yield from click(CHECK)
    yield from until(panel._last)
    yield from until(lambda: not panel._last().running)
    yield 3
    check = panel._last()
    story["verdict"] = check.document["verdict"] if check.document else check.error
    picture("agree")
    file = str(OUT / "desk.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    yield from until(lux)
    story["reopened_lx"] = lux()


def step() -> float | None:
    """Go on, once Blender has turned a few times since the last step, however slow it is."""
    if turns:
        return turns.pop()
    try:
        turns.extend([0.3] * 3)
        return next(steps)
    except StopIteration:
        pass
    except Exception:
        story["error"] = traceback.format_exc()
    (OUT / "story.json").write_text(json.dumps(story))
    bpy.ops.wm.quit_blender()
    return None


turns: list[float] = []
steps = walk()
bpy.app.timers.register(step, first_interval=2, persistent=True)
