# SPDX-License-Identifier: GPL-3.0-or-later
"""Holdouts and indirect-only collections, ours against those of Cycles, alpha included."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest

from .agreement import both_sides, lamp
from .reading import SQUARE, add, material, node, polygons
from .test_features_cycles import SIZE, agrees, glowing, stage, world
from .test_transparency_cycles import panes

pytestmark = pytest.mark.feature("picture and alpha: tiles 1 %, energy 0.2 %", area="Holdouts")


def lit() -> Any:
    """The stage under a lamp and a world; its box is returned."""
    box = stage()
    lamp('AREA', (-1, -1.2, 2.5))
    world()
    return box


def held() -> None:
    lit().is_holdout = True


def held_and_glowing() -> None:
    """What is held out lights other surfaces as ever, but is not seen."""
    box = lit()
    glowing(box.data)
    box.is_holdout = True


def layer(flag: str, build: Callable[[], Any] = lit) -> Callable[[], None]:
    def inside() -> None:
        """The stage's box and a lamp that shows in a collection with a flag of the layer."""
        box = build() or bpy.data.objects["Box"]
        shown = lamp('AREA', (-1, 0.3, 1.4), (0.5, -6, 3), size=0.7)
        shown.visible_camera = True
        made = bpy.data.collections.new("Made")
        bpy.context.scene.collection.children.link(made)
        for each in (box, shown):
            made.objects.link(each)
            bpy.context.scene.collection.objects.unlink(each)
        setattr(bpy.context.view_layer.layer_collection.children["Made"], flag, True)

    return inside


def shader() -> None:
    """30 % held out by a shader, in front of the box."""
    lit()
    made = material("Hole", "ShaderNodeBsdfDiffuse")
    tree, output = made.node_tree, made.node_tree.get_output_node('CYCLES')
    diffuse = tree.nodes["Diffuse BSDF"]
    mix = node(tree, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.3
    for k, closure in enumerate((diffuse, tree.nodes.new("ShaderNodeHoldout"))):
        tree.links.new(closure.outputs[0], mix.inputs[k + 1])
    tree.links.new(mix.outputs[0], output.inputs[0])
    mesh = polygons("Pane", *SQUARE)
    mesh.materials[0] = made
    add("Pane", mesh, location=(-0.3, -1, 0.6), scale=(0.7, 0.7, 1), rotation_euler=(1.3, 0, 0.1))


def held_panes() -> None:
    """Tinted panes, of which one is held out: behind it there is what it lets pass."""
    panes()
    lamp('AREA', (-1, -1.2, 2.9))
    world()
    bpy.data.objects["Pane 1"].is_holdout = True


def clear(build: Callable[[], Any]) -> Callable[[], None]:
    def built() -> None:
        build()
        bpy.context.scene.render.film_transparent = True

    return built


CASES = {
    "object": held,
    "object-on-clear-film": clear(held),
    "emitting-object": held_and_glowing,
    "collection": layer("holdout"),
    "indirect-only-collection": layer("indirect_only"),
    "shader": shader,
    "shader-on-clear-film": clear(shader),
    "tinted-panes": clear(held_panes),
}
QUICK = ("object-on-clear-film", "indirect-only-collection", "shader")


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_holdout_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    sides = both_sides(SIZE, ours=192 if name == "emitting-object" else 128)
    agrees(sides)
    assert not sides.scene.unsupported
    alpha = sides.seeds[..., 3].mean(axis=0)
    assert abs(alpha.mean() - sides.film.alpha.mean()) < 0.003
    assert "indirect" in name or np.ptp(alpha) > 0.2
