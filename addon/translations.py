# SPDX-License-Identifier: GPL-3.0-or-later
"""Display texts in other languages: one dictionary, registered once under the root package."""

from typing import Any

import bpy

from .. import __package__ as root_package

TEXTS: Any = {
    'de_DE': {
        ("*", "Radiometry"): "Radiometrie",
        ("*", "What It Emits"): "Was es abgibt",
        ("*", "Luminance"): "Leuchtdichte",
        ("*", "Illuminance"): "Beleuchtungsstärke",
        ("*", "Light Meters"): "Lichtmesser",
        ("Operator", "Read Meters"): "Messen",
        ("Operator", "Real Light Source"): "Echte Lichtquelle",
    }
}


def enabled() -> None:
    bpy.app.translations.register(str(root_package), TEXTS)


def disabled() -> None:
    bpy.app.translations.unregister(str(root_package))
