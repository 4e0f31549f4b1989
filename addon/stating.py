# SPDX-License-Identifier: GPL-3.0-or-later
"""``light.radiometry``: a light's number in the unit that an artist thinks in.

Blender's `energy` and `color` stay the only truth. `value` is read from them and written to them,
so that undo, copies, drivers, later edits in Blender's own fields and a Blender without this add-on
need nothing from us; unit, spectrum and efficacy say how it is read. An animated `value` calls its
setter for each frame of each depsgraph, renders included.
"""

import math
from types import SimpleNamespace
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from ..blender_rad.errors import RadError
from ..blender_rad.quantities import K_M, unit_named

UNITS = (
    ('W', "W", "Radiant flux: all the power that leaves it as light"),
    ('lm', "lm", "Luminous flux: what of that power the eye sees. On the box of a lamp"),
    ('cd', "cd", "Luminous intensity: lumens a steradian where it is brightest. Of beams"),
    ('W/sr', "W/sr", "Radiant intensity: watts a steradian where it is brightest"),
    ('lx', "lx", "Illuminance: lumens a square metre on a surface that faces it"),
    ('W/m2', "W/m²", "Irradiance: watts a square metre on a surface that faces it"),
    ('cd/m2', "cd/m²", "Luminance: how bright its own surface looks, from any distance. Nits"),
    ('W/m2/sr', "W/(m² sr)", "Radiance: what a pixel holds of its own surface"),
    ('EV100', "EV", "Luminance as the exposure value at ISO 100 of a meter pointed at it"),
)
LABELS = {identifier: label for identifier, label, _ in UNITS}
SPECTRA = ("A", "D50", "D65", *(f"LED-B{k}" for k in range(1, 6)), "FL2", "FL11", "HP1",
           "blackbody:2700", "blackbody:3200", "blackbody:5600", "laser:532")  # fmt: skip
_drawn: dict[Any, Any] = {}
MOST = 4096  # of these, where nothing else ends them


def convention(group: Any) -> Any:
    """Return how `group` wants its numbers read."""
    from ..blender_rad import stated
    from ..blender_rad.bpy_io.read import working_space
    from ..blender_rad.working_space import WORKING_SPACES, luminance_weights

    weights = luminance_weights(WORKING_SPACES[working_space()])
    return stated.Convention(
        weights, group.efficacy, group.get("lm_per_W"), getattr(group, "distance", 1.0)
    )


def unit_scale() -> float:
    """Return metres a Blender unit of the scene at hand."""
    from ..blender_rad.bpy_io.read import unit_scale

    scene: Any = bpy.context.scene
    return unit_scale(scene) if scene else 1.0


def _shape(light: Any) -> Any:
    """Return the matrix of the light's object without place and turn: all that its flux feels."""
    import numpy as np

    if light.type not in {'AREA', 'SPOT'}:
        return np.eye(4)
    light = light.original
    active = getattr(bpy.context, "object", None)
    found = active if active and active.data == light else None
    found = found or next((o for o in bpy.data.objects if o.data == light), None)
    if found is None:
        return np.eye(4)
    turn = found.matrix_world.to_quaternion().to_matrix().to_4x4()
    shape = np.array(turn.transposed() @ found.matrix_world)
    shape[:3, 3] = 0.0
    return shape


def record_of(light: Any, matrix: Any = None) -> Any:
    """Return the library's record of a light datablock, as its first object has it."""
    import numpy as np

    from ..blender_rad.bpy_io.lights import light_record

    matrix = _shape(light) if matrix is None else np.array(matrix)
    return light_record(
        SimpleNamespace(data=light.type_recast()),  # its type may have changed
        light.name,
        matrix,
        unit_scale_m=unit_scale(),
    )


def _factor(light: Any, unit: str) -> float:
    """Return the light's SI value in `unit` over its energy."""
    from ..blender_rad import stated

    model = 'cycles' if light.radiometry.compensate else 'physical'
    return stated.per_energy(record_of(light), unit, convention(light.radiometry), model)


def unit_of(block: Any) -> str:
    """Return the unit of a light, world or material: its own, or the nearest that it can have."""
    from ..blender_rad.stated import unit_for

    kind = block.type if isinstance(block, bpy.types.Light) else block.id_type
    return unit_for(kind, block.radiometry.unit)


def defined(light: Any, unit: str) -> bool:
    """Return whether the quantity has a meaning for the light, such as a luminance of a point."""
    return math.isfinite(_factor(light, unit))


def drawn(make: Any, light: Any, *what: Any) -> Any:
    """Return ``make(light, *what)``, from the last time while nothing has changed."""
    from ..blender_rad.bpy_io.expressions import plain_properties

    group = light.radiometry
    stated = light.session_uid, light.type, convention(group), group.compensate
    key = (make, *what, stated, *plain_properties(light).values())
    if len(_drawn) > MOST:
        _drawn.clear()
    if key not in _drawn:
        _drawn[key] = make(light, *what)
    return _drawn[key]


@bpy.app.handlers.persistent
def _look_again(*_: Any) -> None:
    _drawn.clear()


def glows(block: Any) -> bool:
    """Return whether what a world or material emits is one known number."""
    return _radiance(block) is not None


def _curves(light: Any) -> Any:
    """Return the F-curves of the light's action; none is an empty tuple."""
    moved = light.animation_data
    if not (moved and moved.action and moved.action_slot):
        return ()
    strips = [strip for layer in moved.action.layers for strip in layer.strips]
    bag = strips[0].channelbag(moved.action_slot) if strips else None
    return bag.fcurves if bag else ()


def value_curves(light: Any) -> list[Any]:
    """Return the F-curves on the light's value."""
    return [curve for curve in _curves(light) if curve.data_path == "radiometry.value"]


def move_keys(light: Any) -> None:
    """Make the F-curve of the value one of Blender's own power; in proportion, so it stays true."""
    scale = 1.0 / _factor(light, unit_of(light))
    curves = _curves(light)
    for old in [curve for curve in curves if curve.data_path == "energy"]:
        curves.remove(old)
    for curve in value_curves(light):
        for key in curve.keyframe_points:
            for point in (key.co, key.handle_left, key.handle_right):
                point.y *= scale
        curve.data_path = "energy"
        curve.update()


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _get_value(group: Any) -> float:
    light, unit = group.id_data, unit_of(group.id_data)
    factor = _factor(light, unit) if light.is_evaluated else drawn(_factor, light, unit)
    return _finite(unit_named(unit).from_si(factor * light.energy))


def _set_value(group: Any, value: float) -> None:
    light, unit = group.id_data, unit_of(group.id_data)
    factor = _factor(light, unit)
    if not (math.isfinite(factor) and factor):
        return
    light.energy = unit_named(unit).to_si(value) / factor


def _stated(key: str, default: Any) -> dict[str, Any]:
    """Return get and set of an entry that tells how the value is read: it stays what was stated."""

    def set_entry(group: Any, new: Any) -> None:
        value = group.value
        group[key] = new
        group.value = value

    return {"get": lambda group: group.get(key, default), "set": set_entry}


_EFFICACY: Any = FloatProperty(
    name="Efficacy",
    description="Lumens that a Blender watt of white stands for. One number for all lights of "
    "a scene, so that equal lumens look equally bright; 683.002 is the photopic convention",
    min=1e-3,
    soft_max=K_M,
    **_stated("efficacy", K_M),
)


def _set_spectrum(group: Any, name: str) -> None:
    """Take the colour and the efficacy of a spectrum; the stated value stays."""
    group["error"] = ""
    value = group.value
    if name:
        from ..blender_rad.bpy_io.read import working_space
        from ..blender_rad.spectra import spectrum
        from ..blender_rad.stated import colour
        from ..blender_rad.working_space import WORKING_SPACES

        try:
            found = spectrum(name)
        except RadError as error:
            group["error"] = f"{error.what}: {error.expected}"
            return
        group["lm_per_W"] = found.efficacy_lm_W
        group.id_data.color = colour(found, WORKING_SPACES[working_space()])
        group.id_data.use_temperature = False
    elif "lm_per_W" in group:
        del group["lm_per_W"]
    group["spectrum"] = name
    group.value = value


def _set_keep(group: Any, keep: bool) -> None:
    if keep and group.id_data.type == 'SPOT':
        group["cone"] = _cone(group.id_data)
    elif not keep:
        group.pop("cone", None)


def _cone(light: Any) -> list[float]:
    return [light.spot_size, light.spot_blend]


def _gathered(cone: Any) -> float:
    """Return the intensity on axis of a spot of one watt, by its angle and blend [1/sr]."""
    from ..blender_rad.units import convert

    shape = {"cone": cone[0], "blend": cone[1]}
    return convert(1.0, "W", "W/sr", emitter="spot", shape=shape).value


@bpy.app.handlers.persistent
def _keep_flux(_: Any, depsgraph: Any) -> None:
    """Follow new cones of spots that keep their flux; a handler, as Blender has no other word."""
    for update in depsgraph.updates:
        light = update.id.original
        if isinstance(light, bpy.types.SpotLight) and (cone := light.radiometry.get("cone")):
            if (before := list(cone)) != (now := _cone(light)):
                light.radiometry["cone"] = now
                light.energy *= _gathered(now) / _gathered(before)


class RADIOMETRIC_PG_light(bpy.types.PropertyGroup):
    unit: EnumProperty(
        name="Unit",
        description="What the value counts. A new unit says the same light in other words",
        items=UNITS,
        override={'LIBRARY_OVERRIDABLE'},
    )
    value: FloatProperty(
        name="Value",
        description="How much light, in this unit: all of colour, cone, spread, nodes and scale "
        "count. It sets Blender's own power, and follows it",
        get=_get_value,
        set=_set_value,
        soft_min=0.0,
        soft_max=1e6,
        precision=3,
        override={'LIBRARY_OVERRIDABLE'},
    )
    distance: FloatProperty(
        name="At Distance",
        description="From the light's centre along its axis, in metres, where it is read",
        min=1e-3,
        soft_max=100.0,
        **_stated("distance", 1.0),
    )
    spectrum: StringProperty(
        name="Spectrum",
        description="What a watt of it is in lumens, and its colour: a CIE illuminant such as "
        "LED-B3, blackbody:2700, laser:532, or a CSV file. Watts are then those of this source",
        get=lambda group: group.get("spectrum", ""),
        set=_set_spectrum,
        search=lambda group, context, text: [s for s in SPECTRA if text.lower() in s.lower()],
        search_options={'SUGGESTION'},
        override={'LIBRARY_OVERRIDABLE'},
    )
    efficacy: _EFFICACY
    compensate: BoolProperty(
        name="Compensate Unit Scale",
        description="Cycles counts a unit as a metre where light falls off, whatever the scene's "
        "unit scale: set the power with which the real scene gets this light",
        **_stated("compensate", True),
    )
    keep_flux: BoolProperty(
        name="Keep Flux",
        description="A narrower cone gathers the light instead of cutting it off, as a zoom lens "
        "does. To hold it while a cone moves in an animation, key the value in lm as well",
        get=lambda group: "cone" in group,
        set=_set_keep,
        options=set(),
    )


def _radiance(block: Any) -> Any:
    """Return the constant radiance (3,) of a world or material, None where it is not one."""
    if isinstance(block, bpy.types.World):
        from ..blender_rad.bpy_io.world import read_world

        world = read_world(block)
        return world.radiance if world.known else None
    from ..blender_rad.bpy_io.materials import surface_of

    surface = surface_of(block)
    return None if surface.unknown_emission else surface.full.emission


def _glow(group: Any, unit: str) -> float:
    """Return the SI value in `unit` of what a world or material emits; nan where not known."""
    import numpy as np

    from ..blender_rad.lights.world import WorldLight
    from ..blender_rad.stated import amount

    rgb = _radiance(group.id_data)
    if rgb is None:
        return math.nan
    return amount(WorldLight(name="", rgb=np.array(rgb)), unit, convention(group))


def _get_glow(group: Any) -> float:
    unit = unit_of(group.id_data)
    return _finite(unit_named(unit).from_si(_glow(group, unit)))


def _set_glow(group: Any, value: float) -> None:
    from ..blender_rad.bpy_io.powers import scale_emission

    block, unit = group.id_data, unit_of(group.id_data)
    now = _glow(group, unit)
    if now == 0.0:
        scale_emission(block, 1.0, start=1.0)
        now = _glow(group, unit)
    if math.isfinite(now) and now:
        scale_emission(block, unit_named(unit).to_si(value) / now)


class RADIOMETRIC_PG_glow(bpy.types.PropertyGroup):
    unit: EnumProperty(
        name="Unit", description="What the value counts", items=UNITS, default='cd/m2'
    )
    value: FloatProperty(
        name="Value",
        description="How bright it looks from anywhere. Sets the strength of the nodes that emit",
        get=_get_glow,
        set=_set_glow,
        soft_min=0.0,
        soft_max=1e6,
        precision=3,
        options=set(),
    )
    efficacy: _EFFICACY


def disabled() -> None:
    _drawn.clear()


PROPERTIES = (
    (
        bpy.types.Light,
        "radiometry",
        PointerProperty(type=RADIOMETRIC_PG_light, override={'LIBRARY_OVERRIDABLE'}),
    ),
    (bpy.types.Material, "radiometry", PointerProperty(type=RADIOMETRIC_PG_glow)),
    (bpy.types.World, "radiometry", PointerProperty(type=RADIOMETRIC_PG_glow)),
)
HANDLERS = (
    ("depsgraph_update_post", _keep_flux),
    ("depsgraph_update_post", _look_again),
    ("frame_change_post", _look_again),
    ("load_post", _look_again),
)
