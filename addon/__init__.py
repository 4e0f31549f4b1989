# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's face: properties, panels, operators. No physics; heavy libraries load when used.

A module says what Blender is to know of it: its classes, and what it names in PROPERTIES, HANDLERS,
MENUS, OVERLAYS and TIMERS; its `enabled` and `disabled` are called.
"""

from importlib import import_module
from typing import Any

import bpy

NAMES = """
    preferences settings beside skies live drawing engine engine_panel check_panel lint_panel
    images stating readout light_panel law_panel meter_panel metering translations
"""
MODULES: list[Any] = [import_module(f".{name}", __package__) for name in NAMES.split()]
_overlays: list[Any] = []


def _of(module: Any, what: str) -> tuple[Any, ...]:
    return getattr(module, what, ())


def _classes(module: Any) -> list[type]:
    """Return the classes of a module that Blender is to know."""
    return [
        found
        for found in vars(module).values()
        if isinstance(found, type)
        and issubclass(found, bpy.types.bpy_struct)
        and found.__module__ == module.__name__
    ]


def register() -> None:
    for module in MODULES:
        for found in _classes(module):
            bpy.utils.register_class(found)
        for owner, name, value in _of(module, "PROPERTIES"):
            setattr(owner, name, value)
        for moment, handler in _of(module, "HANDLERS"):
            getattr(bpy.app.handlers, moment).append(handler)
        for menu, draw in _of(module, "MENUS"):
            menu.append(draw)
        for draw in _of(module, "OVERLAYS"):
            add: Any = bpy.types.SpaceView3D.draw_handler_add
            _overlays.append(add(draw, (), 'WINDOW', 'POST_PIXEL'))
        if enabled := getattr(module, "enabled", None):
            enabled()


def unregister() -> None:
    while _overlays:
        bpy.types.SpaceView3D.draw_handler_remove(_overlays.pop(), 'WINDOW')
    for module in reversed(MODULES):
        for timer in _of(module, "TIMERS"):
            if bpy.app.timers.is_registered(timer):
                bpy.app.timers.unregister(timer)
        for menu, draw in _of(module, "MENUS"):
            menu.remove(draw)
        for moment, handler in _of(module, "HANDLERS"):
            getattr(bpy.app.handlers, moment).remove(handler)
        if disabled := getattr(module, "disabled", None):
            disabled()
        for owner, name, _ in _of(module, "PROPERTIES"):
            delattr(owner, name)
        for found in reversed(_classes(module)):
            bpy.utils.unregister_class(found)
