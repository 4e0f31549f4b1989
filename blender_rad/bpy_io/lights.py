# SPDX-License-Identifier: GPL-3.0-or-later
"""Light objects: their properties as they are, and what their node tree multiplies."""

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..lights._base import LightRecord
from ..textures import constant
from . import nodes
from .expressions import plain_properties
from .ies import ies_emission

NOT_FINITE = "its position, energy or size is not finite"


def light_record(
    bl_object: Any,
    name: str,
    world_from_light: NDArray[Any],
    *,
    unit_scale_m: float,
    visible_camera: bool = False,
    shown: bool = True,
) -> LightRecord:
    """Return the record of a light object, evaluated if it is to emit something.

    Every scalar, enum and vector property of the light is copied by Blender's name, those of
    Cycles as ``cycles.NAME``; a constant node tree comes as ``node_emission``, (3,), one that
    varies as ``node_texture``, and one that is not known does not. An IES texture comes as
    ``ies_text``, ``ies_frame``.
    """
    light, unknown = bl_object.data, None
    properties = plain_properties(light)
    properties |= {f"cycles.{key}": value for key, value in plain_properties(light.cycles).items()}
    if nodes.uses_nodes(light):
        emission, varying, unknown = nodes.emission(light.node_tree, {"ShaderNodeEmission"})
        found: dict[str, Any] = {"node_emission": emission}
        if varying:
            whole = varying + constant(emission)
            found = {"node_emission": nodes.grey(1.0), "node_texture": whole}
        elif unknown and (ies := ies_emission(light, world_from_light)):
            found, unknown = ies
        properties |= {} if unknown else found
    numbers = [value for value in properties.values() if isinstance(value, float)]
    if not (np.isfinite(numbers).all() and np.isfinite(world_from_light).all()):
        unknown = NOT_FINITE
    return LightRecord(
        name=name,
        bl_type=light.type,
        properties=properties,
        world_from_light=world_from_light,
        unit_scale_m=unit_scale_m,
        blender_version=bpy.app.version,
        visible_camera=visible_camera,
        data=light.name,
        shown=shown,
        unknown=unknown or "",
    )
