# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels and operators share: texts that fit any width, words for what goes wrong."""

import textwrap
from typing import Any

from ..blender_rad.errors import RadError

LETTER = 6.5  # px of a letter at a UI scale of 1, on average
AROUND, LEAST = 9, 20  # letters that icon and margins take, and of the narrowest line


class InProperties:
    """A panel of the Properties editor."""

    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'


class Action:
    """An operator that does its `work`, or says why it cannot."""

    def execute(self: Any, context: Any) -> Any:
        try:
            self.work(context)
        except (RadError, ModuleNotFoundError) as error:  # the preferences say what is missing
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        return {'FINISHED'}


def say(layout: Any, context: Any, text: str, icon: str) -> None:
    """Draw a text in as many lines as it needs."""
    scale = context.preferences.system.ui_scale
    width = max(int(context.region.width / (LETTER * scale)) - AROUND, LEAST)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon='BLANK1' if number else icon)


def select_alone(context: Any, chosen: Any) -> None:
    """Make an object the only one that is selected, and the active one."""
    for other in context.selected_objects:
        other.select_set(False)
    chosen.select_set(True)
    context.view_layer.objects.active = chosen


def at_cursor(context: Any, placed: Any) -> None:
    """Put an object into the active collection at the 3D cursor, selected alone."""
    if not placed.users_collection:
        context.collection.objects.link(placed)
    placed.location = context.scene.cursor.location
    select_alone(context, placed)
