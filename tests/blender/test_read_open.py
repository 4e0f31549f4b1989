# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening files: bad ones said in one line, good ones without scripts and without chatter."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

from blender_rad.bpy_io.open import open_scene  # noqa: E402
from blender_rad.bpy_io.read import read_scene  # noqa: E402
from blender_rad.errors import RadError  # noqa: E402

from .reading import SQUARE, add, camera, empty_scene, polygons  # noqa: E402


def saved(path: Path) -> Path:
    file = path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


@pytest.fixture
def file(tmp_path: Path) -> Path:
    empty_scene()
    add("Plane", polygons("Plane", *SQUARE))
    camera()
    second = camera()
    second.name = "Second"
    bpy.context.scene.view_layers.new("Other")
    bpy.context.scene.name = "Main"
    return saved(tmp_path)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(RadError, match="no such file"):
        open_scene(tmp_path / "none.blend")
    with pytest.raises(RadError, match="a folder"):
        open_scene(tmp_path)


@pytest.mark.parametrize("keep", [0.5, 0.001])
def test_truncated_files(keep: float, file: Path) -> None:
    content = file.read_bytes()
    broken = file.with_name("broken.blend")
    broken.write_bytes(content[: int(len(content) * keep)])
    with pytest.raises(RadError, match="cannot read the file") as error:
        open_scene(broken)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["text.blend", "text.glb", "text.gltf"])
def test_text_is_no_scene(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("not a scene")
    with pytest.raises(RadError, match="cannot read the file") as error:
        open_scene(tmp_path / name)
    assert "\n" not in str(error.value)


def test_unknown_names_list_those_that_exist(file: Path) -> None:
    with pytest.raises(RadError, match=r"unknown camera 'X'.*Camera, Second"):
        open_scene(file, camera="X")
    with pytest.raises(RadError, match=r"unknown scene 'X'.*Main"):
        open_scene(file, scene="X")
    with pytest.raises(RadError, match=r"unknown view layer 'X'.*Other"):
        open_scene(file, view_layer="X")


@pytest.mark.parametrize("frame", [-1048575, 1048575])
def test_frames_out_of_range(frame: int, file: Path) -> None:
    with pytest.raises(RadError, match="out of range"):
        open_scene(file, frame=frame)


def test_choices_are_read(file: Path) -> None:
    scene = read_scene(open_scene(file, frame=-1048574, camera="Camera", view_layer="Other"))
    assert scene.frame == -1048574
    assert scene.camera is not None
    assert scene.camera.name == "Camera"
    assert scene.file == str(file)
    assert scene.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert scene.blender_version == tuple(bpy.app.version)


def test_a_chosen_camera_wins_over_markers(file: Path) -> None:
    scene = open_scene(file)
    scene.timeline_markers.new("Cut", frame=1).camera = bpy.data.objects["Second"]
    marked = saved(file.parent)
    found = read_scene(open_scene(marked, frame=5, camera="Camera"))
    assert found.camera is not None
    assert found.camera.name == "Camera"
    found = read_scene(open_scene(marked, frame=5))
    assert found.camera is not None
    assert found.camera.name == "Second"


def test_a_view_layer_has_its_own_objects(file: Path) -> None:
    scene = open_scene(file)
    extra = bpy.data.collections.new("Extra")
    scene.collection.children.link(extra)
    extra.objects.link(bpy.data.objects.new("More", polygons("More", *SQUARE)))
    scene.view_layers["Other"].layer_collection.children["Extra"].exclude = True
    layered = saved(file.parent)
    names = [i.name for i in read_scene(open_scene(layered)).instances]
    assert sorted(names) == ["More", "Plane"]
    others = read_scene(open_scene(layered, view_layer="Other")).instances
    assert [i.name for i in others] == ["Plane"]


def test_no_camera(tmp_path: Path) -> None:
    empty_scene()
    camera()
    bpy.context.scene.camera = None
    file = saved(tmp_path)
    assert open_scene(file).camera is None
    with pytest.raises(RadError, match=r"no active camera.*Camera"):
        open_scene(file, need_camera=True)


def test_blocked_drivers_missing_images_and_libraries_are_findings(tmp_path: Path) -> None:
    empty_scene()
    lamp = bpy.data.lights.new("Lamp", 'POINT')
    add("Lamp", lamp)
    driver = lamp.driver_add("energy").driver
    driver.type, driver.expression = 'SCRIPTED', "[5 for x in (1,)][0]"
    simple = bpy.data.lights.new("Simple", 'POINT')
    add("Simple", simple)
    simple.driver_add("energy").driver.expression = "frame + 2"
    image = bpy.data.images.new("Gone", 4, 4)
    image.source, image.filepath, image.use_fake_user = 'FILE', "//gone.png", True
    file = saved(tmp_path)
    scene = read_scene(open_scene(file, frame=1))
    codes = {(f.code, f.object) for f in scene.findings}
    assert ("blocked-driver", "Lamp") in codes
    assert ("blocked-driver", "Simple") not in codes
    assert ("missing-image", "Gone") in codes
    assert {lamp.name: float(lamp.rgb[0]) for lamp in scene.lights}["Simple"] == 3


def test_libraries_name_what_is_ambiguous(tmp_path: Path) -> None:
    empty_scene()
    add("Lamp", bpy.data.lights.new("Lamp", 'POINT'))
    library = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    empty_scene()
    add("Lamp", bpy.data.lights.new("Lamp", 'POINT'))
    with bpy.data.libraries.load(str(library), link=True) as (_, target):
        target.objects = ["Lamp"]
    bpy.context.scene.collection.objects.link(target.objects[0])
    file = saved(tmp_path)
    names = [lamp.name for lamp in read_scene(open_scene(file)).lights]
    assert sorted(names) == ["Lamp", "library.blend/Lamp"]
    library.unlink()
    codes = {f.code for f in read_scene(open_scene(file)).findings}
    assert "missing-library" in codes


def test_gltf_is_imported(tmp_path: Path) -> None:
    empty_scene()
    add("Plane", polygons("Plane", *SQUARE))
    file = tmp_path / "scene.glb"
    bpy.ops.export_scene.gltf(filepath=str(file))
    scene = read_scene(open_scene(file))
    assert [i.name for i in scene.instances] == ["Plane"]
    assert scene.file == str(file)
    assert scene.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()


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
        saved(file.parent)
    broken = file.with_name("broken.blend")
    broken.write_text("not a scene")
    command: list[Any] = [sys.executable, "-c", QUIET, str(file), str(broken)]
    root = Path(__file__).parents[2]
    done = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=60, cwd=root
    )
    assert done.returncode == 7
    assert done.stdout.splitlines() == ["only this"]
    assert blocked or not done.stderr
