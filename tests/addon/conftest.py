# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on as it lies in the tree, registered around each test of a fresh scene."""

import importlib
import json
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.addon.building import ROOT, build, run

NAME = "radiometric_tree"
SIZE = (48, 32)  # pixels


@pytest.fixture(scope="session")
def package() -> ModuleType:
    """Return the root package, imported under a name of its own."""
    spec = spec_from_file_location(
        NAME, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    assert spec and spec.loader
    sys.modules[NAME] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])
    return sys.modules[NAME]


@pytest.fixture
def addon(package: ModuleType) -> Iterator[Any]:
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    module = importlib.import_module(f"{NAME}.addon")
    module.register()
    yield module
    module.unregister()


@pytest.fixture(scope="session")
def zip_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("build"))


def sky(turn: tuple[float, float, float]) -> None:
    import bpy

    from tests.blender.reading import node, shows, with_nodes, world

    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(1).uniform(0.1, 0.5, (16, 32, 3))
    image = bpy.data.images.new("Sky", 32, 16, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    tree = with_nodes(world("Sky"))
    mapping = node(tree, "Mapping", node(tree, "TexCoord").outputs["Generated"], Rotation=turn)
    parts = node(tree, "TexEnvironment", mapping, image=image), node(tree, "TexSky")
    shows(tree, node(tree, "AddShader", *(node(tree, "Background", part) for part in parts)))


@pytest.fixture(scope="session")
def done(zip_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder with what the installed extension made of a scene."""
    import bpy

    folder = tmp_path_factory.mktemp("engine")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.ops.object.light_add(type='POINT', location=(0, 0, 2))
    bpy.context.object.data.shadow_soft_size = 0.0
    sky((0.4, -0.3, 2.0))
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "desk.blend"))
    script = Path(__file__).with_name("_in_blender.py")
    user = {"BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("user")), "PYTHONPATH": ""}
    run(script, zip_path, folder / "desk.blend", folder, **user)
    return folder


@pytest.fixture(scope="session")
def story(done: Path) -> dict[str, object]:
    return json.loads((done / "story.json").read_text())
