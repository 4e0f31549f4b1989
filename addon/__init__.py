# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's face: properties, panels, operators. No physics; heavy libraries load when used."""

from . import engine, preferences, settings

MODULES = (preferences, settings, engine)


def register() -> None:
    for module in MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(MODULES):
        module.unregister()
