# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's entry in Blender's preferences."""

from importlib.util import find_spec

import bpy

from .. import __package__ as root_package
from ..blender_rad import __version__

NEEDED_FOR = {
    "embreex": "rendering, meters and checks",
    "OpenEXR": "checks, and false colours of renders",
    "colour": "spectra and colour temperatures",
    "matplotlib": "false colours, and the pictures in reports",
    "jinja2": "reports",
    "tqdm": "checks",
}


class RADIOMETRIC_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = str(root_package)

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.label(text=f"Radiometric {__version__}")
        for package, what in NEEDED_FOR.items():
            if find_spec(package) is None:
                column.label(text=f"{package} is missing: no {what}", icon='ERROR')
