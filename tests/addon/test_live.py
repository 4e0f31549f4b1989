# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene that is kept up to date is the scene as a new reading has it."""

import importlib
import pickle
from typing import Any

import bpy
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def build() -> None:
    for k, kind in enumerate(('POINT', 'SPOT', 'AREA', 'SUN')):
        bpy.ops.object.light_add(type=kind, location=(k, 0, 2))
        bpy.context.object.name = kind
    for k in range(3):
        bpy.ops.mesh.primitive_cube_add(location=(k, 1, 0))
        bpy.context.object.name = f"Cube{k}"
    objects = bpy.data.objects
    objects['SPOT'].parent = objects["Cube0"]
    objects["Cube1"].data = objects["Cube2"].data
    objects["Cube1"].data.materials.append(bpy.data.materials.new("Grey"))
    bpy.context.view_layer.update()


def turned(objects: Any) -> None:
    objects["Cube0"].location.z, objects["Cube1"].scale.x = 0.5, 2.0
    objects['AREA'].rotation_euler.x = 0.3


def relit(objects: Any) -> None:
    objects['POINT'].data.energy, objects['SPOT'].data.spot_size = 77.0, 0.4
    objects['SUN'].data.color = (1.0, 0.5, 0.2)


def coloured(objects: Any) -> None:
    bpy.data.materials["Grey"].diffuse_color = (0.1, 0.2, 0.3, 1.0)
    objects["Cube1"].data.materials.clear()


def dark(objects: Any) -> None:
    objects['POINT'].data.energy = 0.0
    objects['AREA'].visible_diffuse = False


def skied(objects: Any) -> None:
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    air = world.node_tree.nodes.new("ShaderNodeTexSky")
    background = world.node_tree.nodes["Background"]
    world.node_tree.links.new(air.outputs[0], background.inputs["Color"])


def gone(objects: Any) -> None:
    objects.remove(objects['SPOT'])
    objects["Cube0"].hide_viewport = True
    bpy.context.scene.unit_settings.scale_length = 0.1


@pytest.mark.parametrize(
    ("change", "read_again"),
    [
        *((turned, False), (relit, False), (coloured, True), (dark, True), (gone, True)),
        pytest.param(skied, True, marks=pytest.mark.slow),
    ],
)
def test_it_is_followed(
    addon: Any, monkeypatch: pytest.MonkeyPatch, change: Any, read_again: bool
) -> None:
    live = importlib.import_module(f"{addon.__name__}.live")
    name = addon.__name__.removesuffix("addon") + "blender_rad.bpy_io.read"
    reading = importlib.import_module(name)
    build()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    before = live.scene_of(depsgraph)
    assert live.scene_of(depsgraph) is before
    change(bpy.data.objects)
    bpy.context.view_layer.update()
    plain, calls = reading.read_depsgraph, list[int]()
    monkeypatch.setattr(
        reading, "read_depsgraph", lambda *a, **k: calls.append(1) or plain(*a, **k)
    )
    now = live.scene_of(depsgraph)
    assert now is not before
    assert bool(calls) == read_again
    skies = importlib.import_module(f"{addon.__name__}.skies")
    expected = plain(depsgraph, live=True, maps=skies.of_view(depsgraph))
    assert now.world.known, "a sky is measured beside Blender"
    for part in ("lights", "light_records", "instances", "materials", "world", "unit_scale_m"):
        ours, theirs = (pickle.dumps(pickle.loads(pickle.dumps(getattr(s, part))))
                        for s in (now, expected))  # fmt: skip
        assert ours == theirs, part
