# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene keeps for the engine, the check and the false colours."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from ..blender_rad.quantities import K_M


def _changed(settings: Any, _: Any) -> None:
    """Have viewports look again: Blender does not tell of an add-on's own properties."""
    settings.id_data.update_tag()


class RADIOMETRIC_PG_scene(bpy.types.PropertyGroup):
    model: EnumProperty(
        name="Lights",
        description="What a light's numbers mean",
        items=(
            ('cycles', "As Cycles", "What Cycles makes of them in this Blender"),
            ('physical', "As Units Say", "What their units say: a radius is a sphere's, and so on"),
        ),
        update=_changed,
    )
    shading: EnumProperty(
        name="Materials",
        items=(
            ('full', "Full", "Materials as they are"),
            ('clay', "Clay", "All that reflects is a diffuse 80 % grey"),
        ),
        update=_changed,
    )
    error: FloatProperty(
        name="Error",
        description="Relative standard error to reach",
        default=0.01,
        min=1e-4,
        max=1.0,
        precision=4,
        step=1,
        update=_changed,
    )
    samples: IntProperty(
        name="Samples",
        description="Fixed samples a pixel; 0 takes as many as the error needs",
        min=0,
        max=65536,
    )
    efficacy: FloatProperty(
        name="Efficacy",
        description="Lumens a watt of lights that carry no spectrum",
        default=K_M,
        min=1e-3,
        update=_changed,
    )
    pass_lights: BoolProperty(name="Passes by Light", description="A pass with each light's share")
    tolerance: FloatProperty(
        name="Tolerance",
        description="Relative difference that Cycles may have",
        default=0.01,
        min=1e-4,
        max=0.5,
        precision=3,
        step=1,
    )
    view: EnumProperty(
        name="False Colour",
        description="What rendered viewports show, with a legend",
        items=(
            ('radiance', "Off", "Radiance, through the scene's view transform"),
            ('illuminance', "Illuminance", "Lux on surfaces"),
            ('luminance', "Luminance", "Candela per square metre towards the camera"),
        ),
        update=_changed,
    )
    scale: EnumProperty(
        name="Scale", items=(('log', "Log", ""), ('linear', "Linear", "")), update=_changed
    )
    low: FloatProperty(name="From", description="Lower end; 0 finds one", min=0.0, update=_changed)
    high: FloatProperty(name="To", description="Upper end; 0 finds one", min=0.0, update=_changed)


PROPERTIES = ((bpy.types.Scene, "radiometric", PointerProperty(type=RADIOMETRIC_PG_scene)),)
