# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's face: properties, panels, operators. No physics; heavy libraries load when used."""

from . import (
    beside,
    check_panel,
    drawing,
    engine,
    engine_panel,
    images,
    light_panel,
    lint_panel,
    live,
    meter_panel,
    metering,
    preferences,
    readout,
    settings,
    skies,
    stating,
    translations,
)

MODULES = (
    preferences,
    settings,
    beside,
    skies,
    live,
    drawing,
    engine,
    engine_panel,
    check_panel,
    lint_panel,
    images,
    stating,
    readout,
    light_panel,
    meter_panel,
    metering,
    translations,
)


def register() -> None:
    for module in MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(MODULES):
        module.unregister()
