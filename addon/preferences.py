# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's entry in Blender's preferences."""

import bpy

from .. import __package__ as root_package
from ..blender_rad import __version__


class RADIOMETRIC_AP_preferences(bpy.types.AddonPreferences):
    """Tells which version runs, and how to check a file."""

    bl_idname = str(root_package)

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.label(text=f"Radiometric {__version__}")
        column.label(text="Save the file, then check its light in a terminal:")
        column.label(text=f"blender-rad check \"{bpy.data.filepath or 'FILE.blend'}\"")


register, unregister = bpy.utils.register_classes_factory(  # pyright: ignore[reportGeneralTypeIssues] - it returns a pair
    (RADIOMETRIC_AP_preferences,)
)
