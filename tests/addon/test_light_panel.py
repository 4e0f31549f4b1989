# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights stated in units: true to the library, to Blender's own fields, and to files without us."""

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.session import in_render
from blender_rad.inspection import inspect_lights
from blender_rad.quantities import K_M
from blender_rad.spectra import spectrum
from blender_rad.units import convert
from tests.blender.reading import light

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

SINGLE = 1e-6  # Blender keeps powers in single precision
Make = Callable[..., Any]


@pytest.fixture
def make(addon: Any) -> Make:
    def new(kind: str, **properties: Any) -> Any:
        placed = light(kind, rotation_euler=(0.3, 0.2, 0.1), **properties)
        bpy.context.view_layer.objects.active = placed
        bpy.context.view_layer.update()
        return placed.data

    return new


BALL = {"shadow_soft_size": 0.1, "use_soft_falloff": False}
POINT = {"shadow_soft_size": 0.0}
SPOT = {**POINT, "spot_size": 0.8, "spot_blend": 0.3}
DISC = {"shape": 'DISK', "size": 0.5, "spread": 2.0}
DISC_SHAPE = {"area": math.pi / 16, "spread": 2.0}


UNITS: list[tuple[Any, ...]] = [
    ('POINT', POINT, 800.0, "lm", "W", "point", {}),
    ('POINT', POINT, 800.0, "lm", "cd", "point", {}),
    ('POINT', POINT, 500.0, "lx", "lm", "point", {"distance": 2.0}),
    ('POINT', BALL, 64.0, "cd", "cd/m2", "sphere", {"radius": 0.1}),
    ('POINT', BALL, 12.0, "EV100", "W", "sphere", {"radius": 0.1}),
    ('POINT', BALL, 3.0, "W/m2/sr", "lx", "sphere", {"radius": 0.1, "distance": 2.0}),
    ('SPOT', SPOT, 1200.0, "cd", "lm", "spot", {"cone": 0.8, "blend": 0.3}),
    ('SPOT', SPOT, 5.0, "W", "lx", "spot", {"cone": 0.8, "blend": 0.3, "distance": 2.0}),
    ('AREA', DISC, 3000.0, "cd/m2", "lm", "area", DISC_SHAPE),
    ('AREA', DISC, 900.0, "lm", "W/sr", "area", DISC_SHAPE),
    ('SUN', {"angle": 0.01}, 80000.0, "lx", "W/m2", "sun", {}),
    ('SUN', {"angle": 0.01}, 80000.0, "lx", "cd/m2", "sun", {"angle": 0.01}),
]


@pytest.mark.parametrize("case", UNITS)
def test_units_are_those_of_convert(make: Make, case: tuple[Any, ...]) -> None:
    kind, properties, value, unit, to, emitter, shape = case
    group = make(kind, **properties).radiometry
    group.distance, group.unit, group.value = 2.0, unit, value
    assert group.value == pytest.approx(value, rel=SINGLE)
    group.unit = to
    expected = convert(value, unit, to, emitter=emitter, shape=shape, light=K_M).value
    assert group.value == pytest.approx(expected, rel=2e-6)


def test_a_white_light_of_plain_watts_has_them_as_its_power(make: Make) -> None:
    for kind, unit in (('POINT', "W"), ('AREA', "W"), ('SUN', "W/m2")):
        group = make(kind).radiometry
        group.unit, group.value = unit, 7.0
        assert group.id_data.energy == pytest.approx(7.0, rel=SINGLE)


@pytest.mark.parametrize("scale", [1.0, 0.01])
@pytest.mark.parametrize(
    ("kind", "properties"),
    [
        ('SPOT', {"color": (1.0, 0.5, 0.2), "exposure": 1.5, "use_temperature": True}),
        ('AREA', {"size": 0.3, "normalize": False}),
        ('POINT', {"shadow_soft_size": 0.3}),
    ],
)
def test_lumens_are_those_that_lights_tells(
    make: Make, kind: str, properties: dict[str, Any], scale: float
) -> None:
    bpy.context.scene.unit_settings.scale_length = scale
    light = make(kind, **properties)
    bpy.context.object.scale = (1.5, 2.0, 1.0)
    bpy.context.view_layer.update()
    light.radiometry.unit, light.radiometry.value = "lm", 800.0
    (row,), _ = inspect_lights(read_scene(bpy.context.scene), K_M)
    assert row["luminous_flux_lm"] == pytest.approx(800.0, rel=SINGLE)


def test_a_spectrum_gives_colour_and_watts_and_keeps_what_was_stated(make: Make) -> None:
    group = make('POINT').radiometry
    group.unit, group.value = "lm", 800.0
    group.spectrum = "LED-B1"
    assert group.value == pytest.approx(800.0, rel=SINGLE)
    red, green, blue = group.id_data.color
    assert red == 1.0 > green > blue > 0.0
    group.unit = "W"
    source = spectrum("LED-B1")
    assert group.value == pytest.approx(convert(800.0, "lm", "W", light=source).value, rel=SINGLE)
    group.spectrum = "no such lamp"
    assert group.spectrum == "LED-B1"
    assert "no such lamp" in group["error"]


def test_it_follows_blenders_own_field_undo_and_copies(make: Make) -> None:
    light = make('POINT')
    light.radiometry.unit, light.radiometry.value = "lm", 800.0
    light.energy *= 2.0
    assert light.radiometry.value == pytest.approx(1600.0, rel=SINGLE)
    bpy.ops.ed.undo_push(message="before")
    light.radiometry.value = 100.0
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    light = bpy.data.lights["Lamp"]
    assert light.radiometry.value == pytest.approx(1600.0, rel=SINGLE)
    other = light.copy()
    assert (other.radiometry.unit, other.radiometry.value) == ("lm", light.radiometry.value)


def test_a_cone_that_narrows_keeps_its_flux_where_that_is_wanted(make: Make) -> None:
    light = make('SPOT', **SPOT)
    light.radiometry.unit, light.radiometry.value = "lm", 800.0
    light.spot_size = 0.4
    bpy.context.view_layer.update()
    assert light.radiometry.value < 400.0
    light.radiometry.value, light.radiometry.keep_flux = 800.0, True
    light.spot_size, light.spot_blend = 1.1, 0.7
    bpy.context.view_layer.update()
    assert light.radiometry.value == pytest.approx(800.0, rel=1e-5)


def rendered_energies(frames: tuple[float, ...]) -> list[float]:
    """Return the power of the light that a render gets at frames."""

    def energy(depsgraph: Any) -> float:
        return next(o.data.energy for o in depsgraph.objects if o.type == 'LIGHT')

    scene, found = bpy.context.scene, list[float]()
    for frame in frames:
        scene.frame_set(int(frame))
        found.append(in_render(scene, scene.view_layers[0].name, energy))
    return found


PLAIN = """
import json, os, sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
found = {}
for frame in (1, 6):
    bpy.context.scene.frame_set(frame)
    found[frame] = {light.name: light.energy for light in bpy.data.lights}
assert not hasattr(bpy.types.Light, "radiometry")
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
open(sys.argv[2], "w").write(json.dumps(found))
sys.stdout.flush()
os._exit(0)
"""


def test_animated_lumens_reach_renders_appends_and_a_blender_without_us(
    make: Make, tmp_path: Path
) -> None:
    light = make('AREA')
    group = light.radiometry
    group.unit = "lm"
    for frame, value in ((1, 100.0), (11, 300.0)):
        group.value = value
        group.keyframe_insert("value", frame=frame)
    for curve in sys.modules[type(group).__module__].value_curves(light):
        for key in curve.keyframe_points:
            key.interpolation = 'LINEAR'
    expected = np.array([100.0, 200.0]) / K_M
    assert rendered_energies((1, 6)) == pytest.approx(expected, rel=SINGLE)
    with bpy.context.temp_override(light=light):
        assert bpy.ops.radiometric.keys_to_power() == {'FINISHED'}
    assert rendered_energies((1, 6)) == pytest.approx(expected, rel=SINGLE)

    driven = make('POINT').radiometry
    driven.unit = "lm"
    driven.driver_add("value").driver.expression = "100 * frame"
    bpy.data.objects["Lamp"].hide_render = True
    assert rendered_energies((1, 6)) == pytest.approx(np.array([100.0, 600.0]) / K_M, rel=SINGLE)
    bpy.data.objects["Lamp"].hide_render = False

    file, out = tmp_path / "lamp.blend", tmp_path / "plain.json"
    still = make('SPOT', **SPOT)
    still.name = "Still"
    still.radiometry.unit, still.radiometry.value = "cd", 55.0
    still.radiometry.spectrum = "D65"
    energy = still.energy
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    subprocess.run([sys.executable, "-c", PLAIN, file, out], check=True, timeout=60)
    plain = json.loads(out.read_text())
    assert [plain[frame]["Lamp"] for frame in "16"] == pytest.approx(expected, rel=SINGLE)
    assert plain["6"]["Still"] == energy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(file)) as (_, wanted):
        wanted.lights = ["Still"]
    (appended,) = wanted.lights
    own = appended.radiometry
    assert (own.unit, own.spectrum, appended.energy) == ("cd", "D65", energy)
    assert own.value == pytest.approx(55.0, rel=SINGLE)


def test_a_linked_light_can_be_overridden_in_lumens(make: Make, tmp_path: Path) -> None:
    make('POINT').radiometry.unit = "lm"
    library, file = tmp_path / "library.blend", tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.lights = ["Lamp"]
    own = wanted.lights[0].override_create()
    own.radiometry.value = 1234.0
    own.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.open_mainfile(filepath=str(file))
    (own,) = (light for light in bpy.data.lights if not light.library)
    assert own.radiometry.value == pytest.approx(1234.0, rel=SINGLE)
    assert own.energy == pytest.approx(1234.0 / K_M, rel=SINGLE)


def test_every_real_source_becomes_a_light_of_that_value(addon: Any, make: Make) -> None:
    sources = __import__(f"{addon.__name__}.sources", fromlist=["SOURCES"]).SOURCES
    light = make('POINT')
    for name, source in sources.items():
        assert bpy.ops.radiometric.source(source=name) == {'FINISHED'}
        group = bpy.context.object.data.radiometry
        assert not group.get("error"), name
        assert (light.type, group.unit, group.spectrum) == (
            source.kind, source.unit, source.spectrum,
        )  # fmt: skip
        assert group.value == pytest.approx(source.value, rel=1e-5), name
        assert source.origin
        assert 0.0 < source.uncertainty_percent <= 50.0


@pytest.mark.parametrize(("block", "unit"), [("world", "lx"), ("material", "cd/m2")])
def test_worlds_and_materials_are_as_bright_as_stated(addon: Any, block: str, unit: str) -> None:
    bpy.ops.mesh.primitive_plane_add()
    if block == "world":
        made = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    else:
        made = bpy.data.materials.new("Glow")
        bpy.context.object.data.materials.append(made)
    made.use_nodes = True
    made.radiometry.unit, made.radiometry.value = unit, 5000.0
    assert made.radiometry.value == pytest.approx(5000.0, rel=SINGLE)
    (row,), _ = inspect_lights(read_scene(bpy.context.scene), K_M)
    key = "illuminance_lx" if unit == "lx" else "luminance_cd_m2"
    assert row[key] == pytest.approx(5000.0, rel=SINGLE)


def test_meters_read_and_lights_are_solved_in_one_step(addon: Any, make: Make) -> None:
    light = make('POINT', **POINT)
    bpy.context.object.location.z = 2.0
    light.radiometry.unit, light.radiometry.value = "cd", 400.0
    for kind in ('LUX', 'NIT', 'GRID'):
        assert bpy.ops.radiometric.add_meter(kind=kind) == {'FINISHED'}
    meter = bpy.data.objects["Meter"]
    bpy.context.view_layer.update()
    assert bpy.ops.radiometric.read_meters() == {'FINISHED'}
    metering = sys.modules[f"{addon.__name__}.metering"]
    assert metering.STATE.readings["Meter"].value == pytest.approx(100.0, rel=1e-4)
    side = 0.5 * np.arange(-3.5, 4.0)
    x, y = np.meshgrid(side, side)
    grid = metering.STATE.readings["Meter Grid"]
    assert grid.value == pytest.approx((800.0 / (x**2 + y**2 + 4.0) ** 1.5).mean(), rel=1e-4)
    assert len(grid.cells) == x.size
    with pytest.raises(RuntimeError, match="nothing to solve for"):
        bpy.ops.radiometric.solve()
    meter.radiometric_meter.target = 250.0
    name = light.name
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.radiometric.solve('EXEC_DEFAULT', True) == {'FINISHED'}
    assert light.radiometry.value == pytest.approx(1000.0, rel=1e-4)
    assert metering.met(meter) is True
    bpy.ops.ed.undo()
    assert bpy.data.lights[name].radiometry.value == pytest.approx(400.0, rel=1e-4)
    bpy.data.objects["Meter"].radiometric_meter.target = 0.0
    floor = bpy.context.view_layer.objects.active = bpy.data.objects["Meter Grid"]
    assert bpy.ops.radiometric.standard(task="Classroom") == {'FINISHED'}
    assert bpy.ops.radiometric.solve() == {'FINISHED'}
    assert metering.STATE.readings["Meter Grid"].value == pytest.approx(300.0, rel=1e-4)
    assert metering.met(floor) is False, "one lamp lights a floor of 4 m too unevenly"
    floor.radiometric_meter.uniformity = 0.3
    assert metering.met(floor) is True


def test_materials_are_put_to_the_laws(addon: Any) -> None:
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Grey"))
    bpy.context.view_layer.update()
    assert bpy.ops.radiometric.laws() == {'FINISHED'}
    found = sys.modules[f"{addon.__name__}.law_panel"]._judged["Grey"]
    assert found.positive and found.energy_conserving
    assert 0.79 < found.max_albedo < 1.0


LUMINAIRE = """IESNA:LM-63-2002
[TEST] none
TILT=NONE
1 -1 1 3 1 1 2 0.6 1.2 0
1 1 20
0 45 90
0
100 70 0
"""


def test_a_photometric_file_becomes_its_candelas_with_its_opening(
    addon: Any, tmp_path: Path
) -> None:
    file = tmp_path / "lamp.ies"
    file.write_text(LUMINAIRE)
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    assert bpy.ops.radiometric.luminaire(filepath=str(file)) == {'FINISHED'}
    lamp = bpy.context.object
    assert tuple(lamp.location) == (1.0, 2.0, 3.0)
    group = lamp.data.radiometry
    group.unit, group.efficacy = "cd", 177.83
    lamp.data.energy = 1.0
    assert group.value == pytest.approx(100.0, rel=1e-3)
    (outline,) = lamp.children
    assert sorted(outline.dimensions) == pytest.approx([0.0, 0.6, 1.2], abs=SINGLE)
    with pytest.raises(RuntimeError, match="expected"):
        bpy.ops.radiometric.luminaire(filepath=str(tmp_path / "none.ies"))
