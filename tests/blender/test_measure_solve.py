# SPDX-License-Identifier: GPL-3.0-or-later
"""`measure` and `solve` as they are promised, from outside, on real files."""

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import blender_rad

from . import reading
from .promised import (
    exr,
    inside,
    panel,
    point,
    refused,
    save,
    scene_file,
    sky,
    square,
    stage,
)

KM = 683.002
PROMISE = 1e-3


def empty(name: str, at: tuple[float, float, float], tilt: float = 0.0) -> Any:
    """An empty that looks up, or tilted towards +X."""
    made = reading.add(name, location=at)
    made.rotation_euler = (0.0, tilt, 0.0)
    return made


def lux(document: dict[str, Any]) -> list[float]:
    return [row["illuminance_lx"] for row in document["meters"]]


# Isotropic lamps of 1000 cd over meters 1 m apart, corners included: an independent calculation
# point by point (E = I cosθ/d²): room, height of lamps and meters, average, least and most.
ROOMS = [
    ((4, 4), [(2, 2, 3)], 0.8, 96.73378944240366, 47.81620945518243, 206.61157024793386),
    ((6, 4), [(2, 2, 3), (4, 2, 3)], 0.8, 154.183297437018, 65.5865313009079, 311.76934159678245),
    ((8, 10), [(4, 5, 3)], 0.8, 39.934659325862135, 7.088523237283271, 206.61157024793386),
]


@pytest.mark.parametrize("room", ROOMS)
def test_grids_of_rooms(tmp_path: Path, room: tuple[Any, ...]) -> None:
    size, lamps, z, average, least, most = room
    stage()
    for k, at in enumerate(lamps):
        point(f"Lamp {k}", at, 4 * math.pi * 1000 / KM)
    file = save(tmp_path / "room.blend")
    edges = f"-0.5,-0.5,{z},{size[0] + 0.5},{size[1] + 0.5}"
    ran = inside("measure", file, "--plane", edges, "--spacing", 1, "--json",
                 "--target-average", average * 0.99, "--target-uniformity", 0.9)  # fmt: skip
    figures = ran.document["grid"]
    assert (ran.code, figures["targets"]["pass"]) == (1, False)
    expected = {"columns": size[0] + 1, "rows": size[1] + 1, "average_lx": average}
    expected |= {"minimum_lx": least, "maximum_lx": most}
    expected |= {"uniformity_U0": least / average, "uniformity_Ud": least / most}
    assert {key: figures[key] for key in expected} == pytest.approx(expected, rel=1e-6)
    assert sum(row["average_lx"] for row in figures["lights"]) == pytest.approx(average, rel=1e-6)


def test_grid_object_hidden_and_turned(tmp_path: Path) -> None:
    """A mesh of 2 × 1 m, 1 m before a lamp, facing it; excluded, moved by a parent, less 0.25 m."""
    stage()
    point("Lamp", (5.0, 0.0, 1.0), 100.0)
    corners = [(-2, -0.5, 0), (2, -0.5, 0), (2, 0.5, 0), (-2, 0.5, 0)]
    task = reading.add("Task", reading.polygons("Task", corners, [(0, 1, 2, 3)]))
    parent = reading.add("Parent", location=(4.0, 0.0, 1.0))
    task.parent, task.scale, task.rotation_euler = parent, (0.5, 1, 1), (0, math.pi / 2, 0)
    reading.gathered("Away", task, shown=True)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    file = save(tmp_path / "task.blend")
    found = blender_rad.measure(file, grid="Task", spacing=0.5, margin=0.25, maintenance_factor=0.8)
    assert (found["grid"]["columns"], found["grid"]["rows"]) == (3, 1)
    place = np.array([row["position_m"] for row in found["meters"]])
    np.testing.assert_allclose(place[:, :2], [[4.0, 0.0]] * 3, atol=1e-6)
    np.testing.assert_allclose(np.sort(place[:, 2]), [0.5, 1.0, 1.5], atol=1e-6)
    d = np.hypot(1.0, place[:, 2] - 1.0)
    np.testing.assert_allclose(lux(found), 0.8 * KM * 100 / (4 * np.pi * d**3), rtol=1e-5)


def test_marked_meters_both_models_and_unit_scale(tmp_path: Path) -> None:
    """In centimetres: `cycles` counts units in the fall-off, `physical` metres; both read there."""
    bl_scene = stage()
    bl_scene.unit_settings.scale_length = 0.01
    point("Lamp", (0.0, 0.0, 200.0), 10.0, radius=50.0, soft=True)
    empty("Meter low", (0.0, 0.0, 100.0))
    empty("Other", (0.0, 0.0, 100.0), math.radians(60))["meter"] = True
    empty("Neither", (0.0, 0.0, 50.0))
    file = save(tmp_path / "cm.blend")
    cycles, physical = KM * 10 / (4 * np.pi * (1e4 + 2500)), KM * 10 / (4 * np.pi)
    for model, own, other in (("cycles", cycles, physical), ("physical", physical, cycles)):
        found = blender_rad.measure(file, model=model)
        low, tilted = found["meters"]
        assert (low["name"], tilted["name"]) == ("Meter low", "Other")
        assert low["position_m"] == pytest.approx([0, 0, 1.0])
        assert low["illuminance_lx"] == pytest.approx(own, rel=PROMISE)
        assert low["other_model_illuminance_lx"] == pytest.approx(other, rel=PROMISE)
        assert tilted["normal"] == pytest.approx([math.sin(math.pi / 3), 0, 0.5])
        assert tilted["illuminance_lx"] == pytest.approx(own / 2, rel=PROMISE)
    assert lux(blender_rad.measure(file, at=[(0, 0, 1)])) == pytest.approx([cycles], rel=PROMISE)


def test_agrees_with_the_irradiance_layer_and_with_what_a_pixel_holds(tmp_path: Path) -> None:
    """Half in a board's shadow; the floor's radiance is albedo/π of its irradiance."""
    board = (-0.4, 0.0, 1.0)
    parts = point, panel, lambda: square("Board", 0.3, board), lambda: sky("Sky", (0.1, 0.2, 0.3))
    file = scene_file(tmp_path, "both", *parts)
    out = tmp_path / "out.exr"
    blender_rad.render(file, output=out, samples=64, resolution=(25, 25))
    channels = exr(out)[1]
    x, y = 0.8, -0.6  # centre of column 16, row 15; the picture is 5 m wide
    found = blender_rad.measure(file, at=[(x, y, 0.0)])["meters"][0]
    layer = [channels[f"Irradiance.{c}"][15, 16] for c in "RGB"]
    assert found["irradiance_W_m2"] == pytest.approx(layer, rel=5e-3)
    looked = blender_rad.measure(
        file, quantity="radiance", from_=[(x, y - 0.5, 1.0)], towards=[(x, y, 0.0)]
    )
    expected = np.array(found["irradiance_W_m2"]) * (0.8, 0.5, 0.25) / np.pi
    assert looked["radiance_W_m2_sr"] == pytest.approx(expected, rel=2e-3)
    assert looked["luminance_cd_m2"] == looked["meters"][0]["luminance_cd_m2"]
    shares = sum(light["illuminance_lx"] for light in found["lights"])
    assert shares == pytest.approx(found["illuminance_lx"])
    assert found["standard_error_lx"] <= 1e-3 * found["illuminance_lx"]


def test_dark_and_unsupported(tmp_path: Path) -> None:
    found = blender_rad.measure(scene_file(tmp_path, "dark"), at=[(0, 0, 0)])
    assert lux(found) == [0.0]
    assert [f["code"] for f in found["findings"]] == ["nothing-emits"]

    def veil() -> None:
        glass = reading.material("Glass", 'ShaderNodeBsdfTransparent')
        glass.use_transparent_shadow = False
        square("Veil", 3.0, (0, 0, 1)).data.materials[0] = glass

    file = scene_file(tmp_path, "veil", point, veil)
    found = blender_rad.measure(file, at=[(0, 0, 0), (0, 0, 1.5)])
    (finding,) = found["findings"]
    assert (finding["code"], finding["object"]) == ("unsupported", "Veil")
    assert "1 of 2" in finding["message"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("measure FILE --meter Nope", ["Nope", "Meter A"]),
        ("measure FILE --grid Nope --spacing 1", ["Nope", "Floor"]),
        ("measure FILE --grid Key --spacing 1", ["Key", "mesh"]),
        ("measure FILE --at 0,0,0 --normal 0,0,0", ["--normal"]),
        ("measure FILE --at 0,0,0 1,1,1 --normal 0,0,1", ["--normal"]),
        ("measure FILE --plane -1,-1,0,1,1", ["--spacing"]),
        ("measure FILE --plane -1,-1,0,1,1 --spacing 1 --margin 1", ["2 m"]),
        ("measure FILE --plane -1,-1,0,1,1 --spacing 1e-6", ["too many"]),
        ("measure FILE --quantity radiance", ["--from"]),
        ("solve FILE --target Nope=5", ["Nope", "Meter A"]),
        ("solve FILE --target 500", ["METER=LX"]),
        ("solve FILE --target Meter_A=500 --lights Sun", ["Sun", "Key"]),
        ("solve FILE --target Meter_A=500 -o FILE", ["input"]),
    ],
)
def test_refused(tmp_path_factory: pytest.TempPathFactory, words: str, named: list[str]) -> None:
    folder = tmp_path_factory.getbasetemp()
    file = folder / "refused.blend"
    if not file.exists():
        scene_file(folder, "refused", point, lambda: empty("Meter A", (0, 0, 0)))
    spelt = {"FILE": str(file), "Meter_A=500": "Meter A=500"}
    refused(inside(*(spelt.get(word, word) for word in words.split())), *named)


def test_solve_round_trip(tmp_path: Path) -> None:
    """A copy reads what was asked for: lamps that share data, exposure, glowing meshes, world."""
    stage()
    first = point("A", (-2.0, 0.0, 2.0), 50.0)
    first.data.exposure = 1.5
    second = reading.add("B", first.data, location=(2.0, 0.0, 2.0))
    group = bpy.data.collections.new("Group")
    group.objects.link(second)
    reading.add("Twin", location=(0.0, 6.0, 0.0)).instance_collection = group
    bpy.data.objects["Twin"].instance_type = "COLLECTION"
    glow = reading.material("Glow", 'ShaderNodeEmission', Strength=3.0)
    for name, y in (("C", -2.0), ("D", 2.0)):
        square(name, 0.5, (0.0, y, 2.0)).data.materials[0] = glow
    sky("Sky", (0.05, 0.05, 0.05))
    targets = [(300.0, (-2, 0, 0)), (900.0, (2, 0, 0)), (700.0, (0, -2, 0)), (400.0, (0, 2, 0))]
    for k, (_, at) in enumerate(targets):
        empty(f"M{k}", at)
    file = save(tmp_path / "in.blend")
    before, out = file.read_bytes(), tmp_path / "out.blend"
    asked = [(f"M{k}", wanted) for k, (wanted, _) in enumerate(targets)]
    solved = blender_rad.solve(file, target=asked, lights="A,B,C,D", output=out)
    assert file.read_bytes() == before
    assert solved["residual_lx"] < 0.01
    assert [row["name"] for row in solved["lights"]] == ["A", "B", "C", "D"]
    read = blender_rad.measure(out, meter=[name for name, _ in asked])
    np.testing.assert_allclose(lux(read), [wanted for _, wanted in asked], rtol=2e-3)
    before = {row["name"]: row["illuminance_lx"] for row in read["meters"][0]["lights"]}
    for row in solved["lights"][:2]:
        energies = [row["blender_energy"], 50.0 * row["factor"]]
        energy = bpy.data.objects[row["name"]].data.energy
        assert energies == pytest.approx([energy] * 2, rel=1e-6)
    solved = blender_rad.solve(file, target="M0=3000", lights="World", output=out)
    assert solved["lights"][0]["blender_energy"] == pytest.approx(solved["lights"][0]["factor"])
    assert lux(blender_rad.measure(out, meter="M0")) == pytest.approx([3000.0], rel=2e-3)
    again = blender_rad.measure(file, meter="M0")["meters"][0]["lights"]
    assert {r["name"]: r["illuminance_lx"] for r in again}["World"] == pytest.approx(
        before["World"], rel=5e-3
    )


def test_solve_refuses_what_it_cannot_set(tmp_path: Path) -> None:
    library = scene_file(tmp_path, "library", lambda: point("Linked"))
    stage()
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["Linked"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["Linked"])
    driven = point("Driven", (1.0, 0.0, 2.0))
    driven.data.driver_add("energy").driver.expression = "7.0"
    empty("Meter", (0.0, 0.0, 0.0))
    file, out = save(tmp_path / "in.blend"), tmp_path / "out.blend"
    for name, word in (("Linked", "linked"), ("Driven", "driven")):
        run = inside("solve", file, "--target", "Meter=500", "--lights", name, "-o", out)
        refused(run, name, word)
        assert not out.exists()
    dry = blender_rad.solve(file, target="Meter=500", lights="Linked")
    assert dry["lights"][0]["blender_energy"] is None
    assert dry["meters"][0]["illuminance_lx"] == pytest.approx(500.0)
    assert [f["code"] for f in dry["findings"]] == ["power-not-set"]
