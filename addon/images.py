# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for the Image Editor: false colours of what was rendered, and differences."""

import tempfile
from pathlib import Path
from typing import Any

import bpy

from ..blender_rad.errors import RadError
from .shared import Action

TOLERANCES_SHOWN = 5.0  # at which the colours of a difference end


def show_image(file: Path, name: str) -> Any:
    """Load a picture into the file that is open, under a name, and show it."""
    if old := bpy.data.images.get(name):
        bpy.data.images.remove(old)
    image = bpy.data.images.load(str(file))
    image.name = name
    image.pack()
    context: Any = bpy.context
    editors = (
        area.spaces.active
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == 'IMAGE_EDITOR'
    )
    if editor := next(editors, None):
        editor.image = image
    return image


def show_difference(file: Path, tolerance: float) -> Any:
    """Show a check's map of (Cycles - ours) / ours in colours, what is not compared in grey."""
    import matplotlib as mpl
    import numpy as np
    from matplotlib.image import imsave

    from ..blender_rad.exr import read_passes
    from ..blender_rad.report.pictures import COLOURS, hatched

    relative = read_passes(file, ("Relative.V",))[0]["Relative.V"][..., 0]
    limit = TOLERANCES_SHOWN * tolerance
    colours = mpl.colormaps[COLOURS](np.nan_to_num(relative) / limit * 0.5 + 0.5, bytes=True)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "difference.png"
        imsave(picture, hatched(colours, np.isnan(relative)))
        ends = f"red +{100 * limit:g} %, blue -{100 * limit:g} %"
        return show_image(picture, f"Cycles - ours, {ends}")


def _exr(context: Any, scratch: Path) -> Path:
    """Return the file of the picture that the Image Editor shows, else of the render result."""
    shown = getattr(context.space_data, "image", None)
    if shown and shown.source == 'FILE' and Path(shown.filepath).suffix.lower() == ".exr":
        return Path(bpy.path.abspath(shown.filepath))
    result = next((i for i in bpy.data.images if i.type == 'RENDER_RESULT'), None)
    if result is None:
        raise RadError("nothing is rendered", "false colour", "expected a render, or an EXR shown")
    settings = context.scene.render.image_settings
    wanted = {"file_format": 'OPEN_EXR_MULTILAYER', "color_depth": '32'}
    if hasattr(settings, "media_type"):  # from Blender 5
        wanted = {"media_type": 'MULTI_LAYER_IMAGE', **wanted}
    before = {name: getattr(settings, name) for name in (*wanted, "color_mode")}
    try:
        for name, value in wanted.items():
            setattr(settings, name, value)
        result.save_render(str(scratch), scene=context.scene)
    except RuntimeError as error:
        raise RadError("nothing to draw", "render result", f"expected a render ({error})") from None
    finally:
        for name, value in before.items():
            setattr(settings, name, value)
    return scratch


class RADIOMETRIC_OT_false_colour(Action, bpy.types.Operator):
    """Draw the render result, or the picture shown, in colours with a legend in lux or cd/m²."""

    bl_idname = "radiometric.false_colour"
    bl_label = "False Colour"
    bl_options = {'REGISTER', 'UNDO'}

    quantity: bpy.props.EnumProperty(
        name="Quantity",
        items=(
            ('illuminance', "Illuminance", "Lux; of Cycles it needs the diffuse passes"),
            ('luminance', "Luminance", "Candela per square metre"),
        ),
    )

    def work(self, context: Any) -> None:
        from ..blender_rad.photometry import falsecolor

        scene = context.scene
        own, by_cycles = scene.radiometric, scene.render.engine == 'CYCLES'
        exposure = scene.cycles.film_exposure if by_cycles else 1.0
        with tempfile.TemporaryDirectory() as folder:
            drawn = Path(folder) / "picture.png"
            file = _exr(context, drawn.with_suffix(".exr"))
            light = falsecolor.read_map(
                file, self.quantity, efficacy_lm_W=own.efficacy, exposure=exposure
            )
            low, high = own.low or None, own.high or None
            limits = falsecolor.value_range(light.values, own.scale, low, high)
            falsecolor.write_map(light, drawn, own.scale, limits)
            for finding in light.findings:
                self.report({'INFO'}, str(finding))
            show_image(drawn, f"{self.quantity.capitalize()} [{light.unit}]")


class RADIOMETRIC_IMAGE_PT_false_colour(bpy.types.Panel):
    bl_label = "False Colour"
    bl_space_type = 'IMAGE_EDITOR'
    bl_region_type = 'UI'
    bl_category = "Radiometry"

    def draw(self, context: Any) -> None:
        layout: Any = self.layout
        layout.use_property_split = True
        own = context.scene.radiometric
        for name in ("scale", "low", "high", "efficacy"):
            layout.prop(own, name)
        row = layout.row(align=True)
        for quantity in ('illuminance', 'luminance'):
            name = RADIOMETRIC_OT_false_colour.bl_idname
            row.operator(name, text=quantity.capitalize()).quantity = quantity
