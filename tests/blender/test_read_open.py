# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening files: bad ones said in one line, good ones without scripts and without chatter."""

from pathlib import Path

import bpy
import pytest

from blender_rad.bpy_io.open import open_scene
from blender_rad.bpy_io.read import read_scene

from .promised import python, save
from .reading import SQUARE, add, camera, empty_scene, polygons


@pytest.fixture
def file(tmp_path: Path) -> Path:
    empty_scene()
    add("Plane", polygons("Plane", *SQUARE))
    camera()
    camera().name = "Second"
    bpy.context.scene.view_layers.new("Other")
    bpy.context.scene.name = "Main"
    return save(tmp_path / "scene.blend")


def test_a_chosen_camera_wins_over_markers(file: Path) -> None:
    scene = open_scene(file)
    scene.timeline_markers.new("Cut", frame=1).camera = bpy.data.objects["Second"]
    marked = save(file)
    for chosen, expected in (("Camera", "Camera"), (None, "Second")):
        assert open_scene(marked, frame=5, camera=chosen).camera.name == expected


def test_a_view_layer_has_its_own_objects(file: Path) -> None:
    scene = open_scene(file)
    extra = bpy.data.collections.new("Extra")
    scene.collection.children.link(extra)
    extra.objects.link(bpy.data.objects.new("More", polygons("More", *SQUARE)))
    scene.view_layers["Other"].layer_collection.children["Extra"].exclude = True
    layered = save(file)
    for layer, expected in ((None, ["More", "Plane"]), ("Other", ["Plane"])):
        found = read_scene(open_scene(layered, view_layer=layer)).instances
        assert sorted(i.name for i in found) == expected


def test_blocked_drivers_missing_images_and_libraries_are_findings(tmp_path: Path) -> None:
    empty_scene()
    for name, expression in (("Lamp", "[5 for x in (1,)][0]"), ("Simple", "frame + 2")):
        lamp = bpy.data.lights.new(name, 'POINT')
        add(name, lamp)
        driver = lamp.driver_add("energy").driver
        driver.type, driver.expression = 'SCRIPTED', expression
    image = bpy.data.images.new("Gone", 4, 4)
    image.source, image.filepath, image.use_fake_user = 'FILE', "//gone.png", True
    file = save(tmp_path / "scene.blend")
    scene = read_scene(open_scene(file, frame=1))
    codes = {(f.code, f.object) for f in scene.findings}
    assert codes == {("blocked-driver", "Lamp"), ("missing-image", "Gone")}
    assert {lamp.name: float(lamp.rgb[0]) for lamp in scene.lights}["Simple"] == 3


def test_libraries_name_what_is_ambiguous(tmp_path: Path) -> None:
    empty_scene()
    add("Lamp", bpy.data.lights.new("Lamp", 'POINT'))
    library = save(tmp_path / "library.blend")
    empty_scene()
    add("Lamp", bpy.data.lights.new("Lamp", 'POINT'))
    with bpy.data.libraries.load(str(library), link=True) as (_, target):
        target.objects = ["Lamp"]
    bpy.context.scene.collection.objects.link(target.objects[0])
    file = save(tmp_path / "scene.blend")
    names = [lamp.name for lamp in read_scene(open_scene(file)).lights]
    assert sorted(names) == ["Lamp", "library.blend/Lamp"]
    library.unlink()
    assert "missing-library" in {f.code for f in read_scene(open_scene(file)).findings}


QUIET = """
import sys
from typing import Sequence
from blender_rad.bpy_io.open import open_scene
from blender_rad.bpy_io.read import read_scene
from blender_rad.errors import RadError
try:
    open_scene(sys.argv[2])
except RadError:
    print("only this")
import bpy
class Keeper:
    def keeps(self): ...
Sequence[Keeper]  # typing keeps it for ever, and so these globals and bpy: Blender 4.5 then hung
read_scene(open_scene(sys.argv[1], frame=3))
sys.exit(7)
"""


@pytest.mark.parametrize("blocked", [False, True])
def test_standard_output_is_ours_and_blender_ends(blocked: bool, file: Path) -> None:
    if blocked:  # another thing that keeps bpy, in 4.5
        driver = bpy.data.objects["Plane"].driver_add("location", 0).driver
        driver.type, driver.expression = 'SCRIPTED', "[5 for x in (1,)][0]"
        save(file)
    broken = file.with_name("broken.blend")
    broken.write_text("not a scene")
    done = python("-c", QUIET, file, broken)
    assert (done.code, done.out.splitlines()) == (7, ["only this"])
    assert blocked or not done.err
