# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: what is constant Lambert and emission, what is not, and what clay makes of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.materials import read_material, surface_of
from blender_rad.bpy_io.questions import Asking
from blender_rad.scene import CLAY_ALBEDO, Material
from blender_rad.textures import Context

from .reading import added, empty_scene, material, node, put, shows

CLAY, BLACK, RED = (CLAY_ALBEDO,) * 3, (0.0,) * 3, (0.8, 0.2, 0.1)
DIFFUSE, GLOW, CLEAR = "BsdfDiffuse", "Emission", "BsdfTransparent"
PRINCIPLED, SHADER = "ShaderNodeBsdfPrincipled", "ShaderNode"


@pytest.fixture(autouse=True)
def _empty() -> None:
    empty_scene()


def shown(created: Any) -> Any:
    """Return the node that is a material's surface."""
    return created.node_tree.get_output_node('CYCLES').inputs[0].links[0].from_node


def mixed(first: str, second: str, factor: float | None) -> Any:
    """A mix of two closures; None makes the factor depend on the side that is seen."""

    def wire(tree: Any) -> Any:
        side = node(tree, "NewGeometry").outputs["Backfacing"]
        share = side if factor is None else factor
        return node(tree, "MixShader", share, node(tree, first), node(tree, second))

    return material("Mixed", wire)


def noisy(created: Any, socket: int | str) -> Any:
    """Put noise into a socket of what a material shows."""
    tree = created.node_tree
    tree.links.new(node(tree, "TexNoise").outputs[0], shown(created).inputs[socket])
    return created


def into(socket: str, kind: str, **values: Any) -> Any:
    """Lambert, and a node on another socket of the output."""
    created = material("M", DIFFUSE)
    shows(created.node_tree, node(created.node_tree, kind, **values), socket)
    return created


def bent() -> Any:
    tree = (created := material("M", DIFFUSE)).node_tree
    tree.links.new(node(tree, "Bump").outputs[0], shown(created).inputs["Normal"])
    return created


def both() -> Any:
    created = material("M", DIFFUSE, Color=RED)
    added(created, GLOW)
    return created


def bare() -> Any:
    created = material("M", DIFFUSE)
    created.node_tree.links.clear()
    return created


def displaced(method: str) -> Any:
    return put(into("Displacement", "Displacement"), displacement_method=method)


def facts(found: Material) -> dict[str, Any]:
    return {
        "albedo": found.albedo,
        "emission": found.emission,
        "passes": found.transmittance,
        "opaque": found.opaque,
        "known": found.emission_known,
        "unsupported": [u.feature for u in found.unsupported],
        "kinds": [closure.kind for closure in found.closures],
    }


M = partial(material, "M")
LAMBERT = {"albedo": (0.8,) * 3}
# A material, and what is read of it, in full and as clay; where nothing is said it is opaque,
# emission is known, and all is supported.
CASES: dict[str, tuple[Callable[[], Any], dict[str, Any], dict[str, Any]]] = {
    "lambert": (partial(M, DIFFUSE, Color=RED), {"albedo": RED, "emission": BLACK}, {}),
    "rough diffuse": (
        partial(M, DIFFUSE, Roughness=0.5), {"albedo": BLACK, "kinds": [SHADER + DIFFUSE]}, {}
    ),
    "bent diffuse": (bent, {"unsupported": ["Diffuse BSDF"]}, {}),
    "emission": (
        partial(M, GLOW, Color=(1, 0.5, 0.25), Strength=4),
        {"albedo": BLACK, "emission": (4, 2, 1)}, {"albedo": BLACK, "emission": (4, 2, 1)},
    ),
    "dark emission": (
        partial(M, GLOW, Strength=0), {"albedo": BLACK, "emission": BLACK}, {"emission": BLACK}
    ),
    "mix": (
        partial(mixed, DIFFUSE, GLOW, 0.25), {"albedo": (0.6,) * 3, "emission": (0.25,) * 3},
        {"emission": (0.25,) * 3},
    ),
    "mix below": (partial(mixed, DIFFUSE, GLOW, -3.0), {**LAMBERT, "emission": BLACK}, {}),
    "mix above": (
        partial(mixed, DIFFUSE, GLOW, 7.0), {"albedo": BLACK, "emission": (1,) * 3},
        {"albedo": BLACK, "emission": (1,) * 3},
    ),
    "sum": (both, {"albedo": RED, "emission": (1, 1, 1)}, {"emission": (1, 1, 1)}),
    "half clear": (partial(mixed, DIFFUSE, CLEAR, 0.3), {"passes": (0.3,) * 3}, {}),
    "half clear without shadows": (  # Cycles' BSDF sampling sees through it
        lambda: put(mixed(DIFFUSE, CLEAR, 0.3), use_transparent_shadow=False), {"opaque": False}, {}
    ),
    "glass": (partial(M, "BsdfGlass"), {"passes": BLACK}, {}),
    "refraction": (partial(M, "BsdfRefraction"), {"passes": BLACK}, {}),
    "no surface": (bare, {"albedo": BLACK}, {}),
    "volume": (
        partial(into, "Volume", "VolumePrincipled"),
        {"opaque": False, "unsupported": ["Volume"]}, {},
    ),
    "glowing volume": (
        partial(into, "Volume", "VolumePrincipled", Emission_Strength=1),
        {"opaque": False, "known": False, "unsupported": ["Volume", "Volume emission"]}, {},
    ),
    "bump": (partial(displaced, 'BUMP'), {"unsupported": ["Bump from displacement"]}, {}),
    "displacement": (
        partial(displaced, 'DISPLACEMENT'), {"opaque": False, "unsupported": ["Displacement"]}, {}
    ),
    "principled": (partial(M, PRINCIPLED), {"kinds": [PRINCIPLED], "emission": BLACK}, {}),
    "alpha": (partial(M, PRINCIPLED, Alpha=0.5), {"kinds": [PRINCIPLED], "passes": (0.5,) * 3}, {}),
    "glow": (partial(M, PRINCIPLED, Emission_Strength=2.0), {"emission": (2, 2, 2)}, {}),
    "glow under a coat": (
        partial(M, PRINCIPLED, Emission_Strength=2.0, Coat_Weight=1.0), {"emission": BLACK}, {}
    ),
    "glow and alpha": (
        partial(M, PRINCIPLED, Emission_Strength=2.0, Alpha=0.25),
        {"emission": (0.5,) * 3, "passes": (0.75,) * 3}, {},
    ),
    "subsurface": (
        partial(M, PRINCIPLED, Subsurface_Weight=0.3),
        {"kinds": [], "unsupported": ["Principled BSDF Subsurface Weight"]}, {},
    ),
    "thin film": (
        partial(M, PRINCIPLED, Thin_Film_Thickness=300.0),
        {"kinds": [], "unsupported": ["Principled BSDF Thin Film Thickness"]}, {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_materials_are_read(name: str) -> None:
    build, full, clay = CASES[name]
    created = build()
    plain = {"opaque": True, "known": True, "unsupported": []}
    for shading, wanted in (("full", full), ("clay", {"albedo": CLAY, **clay})):
        found = facts(read_material(created, shading))
        for key, value in {**plain, **wanted}.items():
            exact = key in {"opaque", "known", "unsupported", "kinds"}
            assert found[key] == (value if exact else pytest.approx(value)), (shading, key)


@pytest.mark.parametrize("name", ["half clear", "glass", "refraction"])
def test_what_transmits_is_known(name: str) -> None:
    assert surface_of(CASES[name][0]()).transmits


def test_emission_and_albedo_may_vary_but_not_in_ways_that_are_not_known() -> None:
    created = mixed(DIFFUSE, GLOW, None)
    found = read_material(created, "full")
    assert found.emits and found.emission_known and not found.unsupported
    assert found.albedo == (0, 0, 0) and found.albedo_texture and found.emission_texture
    for share, side in ((1.0, 0.0), (0.0, 1.0)):
        seen = Context(backfacing=np.array([[side]]))
        assert found.albedo_texture.rgb(seen, 1) == pytest.approx(0.8 * share * np.ones((1, 3)))
        assert found.emission_texture.rgb(seen, 1) == pytest.approx(side * np.ones((1, 3)))
    noisy(created, 0)
    for shading in ("full", "clay"):
        found = read_material(created, shading)
        assert not found.emission_known
        assert "Emission of Emission" in facts(found)["unsupported"]
    assert read_material(created, "clay").albedo == CLAY
    varying = read_material(mixed(DIFFUSE, CLEAR, None), "full")
    assert varying.opaque and varying.passes and varying.transmittance_texture


def test_closures_have_what_their_sockets_get() -> None:
    created = mixed(DIFFUSE, "BsdfAnisotropic", 0.25)
    tree = created.node_tree
    glossy = tree.nodes["Glossy BSDF"]
    glossy.inputs["Roughness"].default_value = 0.125
    tree.links.new(node(tree, "NormalMap").outputs[0], glossy.inputs["Normal"])
    (closure,) = read_material(created, "full").closures
    constants = {name: each.value for name, each in closure.inputs.items()}
    assert (closure.weight.value, constants["Roughness"]) == (0.25, 0.125)
    assert constants["Color"] == pytest.approx(0.8 * np.ones((1, 3)))
    assert closure.settings["distribution"] == "MULTI_GGX"
    assert closure.normal and closure.normal.kind == "ShaderNodeNormalMap"
    assert closure.tangent is None
    glossy.inputs["Anisotropy"].default_value = 0.5
    (closure,) = read_material(created, "full").closures
    assert closure.tangent and closure.tangent.output == "Tangent"


def test_unknown_nodes_become_questions() -> None:
    """Sockets in groups are asked at the group that they are in; light is never asked for."""
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    paint = node(group, DIFFUSE, node(group, "TexNoise"))
    node(group, "NodeGroupOutput", paint)
    created = material("M", GLOW)
    tree, glow = created.node_tree, shown(created)
    shows(tree, node(tree, "AddShader", node(tree, "Group", node_tree=group), glow))
    questions: list[Asking] = []
    found = surface_of(created, questions).full
    (asking,) = questions
    assert asking.slots == {(("Group",), "Diffuse BSDF", "Color"): 0}
    assert found.albedo_texture and found.albedo_texture.measured and not found.unsupported
    tree.links.new(node(tree, "TexNoise").outputs[0], glow.inputs["Strength"])
    assert surface_of(created, []).unknown_emission
    group.links.new(node(group, "Bevel").outputs[0], paint.inputs["Color"])
    assert "Diffuse BSDF" in facts(surface_of(created, []).full)["unsupported"]  # a mean over rays


def test_groups_reroutes_values_and_muted_nodes_are_followed() -> None:
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    group.interface.new_socket("Tint", in_out='INPUT', socket_type='NodeSocketColor')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    paint = node(group, DIFFUSE, node(group, "NodeGroupInput"))
    node(group, "NodeGroupOutput", paint)

    created = material("M", DIFFUSE)
    tree = created.node_tree
    painted = node(tree, "Group", node_tree=group, Tint=RED)
    shows(tree, node(tree, "NodeReroute", painted))
    assert read_material(created, "full").albedo == pytest.approx(RED)

    rgb = node(tree, "ShaderNodeRGB")
    rgb.outputs[0].default_value = (0.1, 0.2, 0.3, 1)
    link = tree.links.new(rgb.outputs[0], painted.inputs[0])
    assert read_material(created, "full").albedo == pytest.approx((0.1, 0.2, 0.3))
    link.is_muted = True
    assert read_material(created, "full").albedo == pytest.approx(RED)

    add = added(created, GLOW)
    assert read_material(created, "full").emits
    add.mute = True
    found = read_material(created, "full")
    assert (found.emits, found.unsupported) == (False, ())
    assert found.albedo == pytest.approx(RED)


def test_empty_slots() -> None:
    found = read_material(None, "full")
    if bpy.app.version < (5, 0):
        assert (found.albedo, found.unsupported) == ((0.8,) * 3, ())
    else:
        assert ([c.kind for c in found.closures], found.unsupported) == ([PRINCIPLED], ())
    assert read_material(None, "clay").albedo == CLAY
