# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: what is constant Lambert and emission, what is not, and what clay makes of it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.materials import read_material, surface_of
from blender_rad.bpy_io.questions import Asking
from blender_rad.scene import CLAY_ALBEDO, Material
from blender_rad.textures import Context

from .reading import added, empty_scene, material, node

CLAY = (CLAY_ALBEDO,) * 3
PRINCIPLED = "ShaderNodeBsdfPrincipled"
RED = (0.8, 0.2, 0.1, 1)


@pytest.fixture(autouse=True)
def _empty() -> None:
    empty_scene()


def tree_of(created: Any) -> tuple[Any, Any, Any]:
    """Return a material's node tree, its output node, and the socket that is its surface."""
    output = created.node_tree.get_output_node('CYCLES')
    return created.node_tree, output, output.inputs[0].links[0].from_socket


def mixed(first: str, second: str, factor: float | None) -> Any:
    """A mix of two closures; None makes the factor depend on the side that is seen."""
    created = material("Mixed", first)
    tree, output, surface = tree_of(created)
    mix = node(tree, "ShaderNodeMixShader")
    tree.links.new(surface, mix.inputs[1])
    tree.links.new(node(tree, second).outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs[0])
    if factor is None:
        side = node(tree, "ShaderNodeNewGeometry")
        tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    else:
        mix.inputs[0].default_value = factor
    return created


def named(found: Material) -> list[str]:
    return [u.feature for u in found.unsupported]


def test_lambert_is_read() -> None:
    found = read_material(material("M", "ShaderNodeBsdfDiffuse", Color=RED), "full")
    assert found.albedo == pytest.approx(RED[:3])
    assert (found.opaque, found.emits, found.unsupported) == (True, False, ())


def test_rough_or_bent_diffuse_is_a_closure() -> None:
    created = material("M", "ShaderNodeBsdfDiffuse", Roughness=0.5)
    found = read_material(created, "full")
    assert [c.kind for c in found.closures] == ["ShaderNodeBsdfDiffuse"] and not any(found.albedo)
    tree, _, surface = tree_of(created)
    tree.links.new(node(tree, "ShaderNodeBump").outputs[0], surface.node.inputs["Normal"])
    assert named(read_material(created, "full")) == ["Diffuse BSDF"]
    assert read_material(created, "clay").albedo == CLAY


@pytest.mark.parametrize(("strength", "clay"), [(4, (0, 0, 0)), (0, CLAY)])
def test_emission_is_read_and_stays_pure_as_clay(strength: float, clay: Any) -> None:
    created = material("M", "ShaderNodeEmission", Color=(1, 0.5, 0.25, 1), Strength=strength)
    for shading, albedo in (("full", (0, 0, 0)), ("clay", clay)):
        found = read_material(created, shading)
        assert found.emission == (strength, strength / 2, strength / 4)
        assert (found.albedo, found.opaque, found.unsupported) == (albedo, True, ())


@pytest.mark.parametrize(("factor", "share"), [(0.25, 0.25), (-3.0, 0.0), (7.0, 1.0)])
def test_mix_weighs_with_a_clipped_factor(factor: float, share: float) -> None:
    found = read_material(mixed("ShaderNodeBsdfDiffuse", "ShaderNodeEmission", factor), "full")
    assert found.albedo == pytest.approx((0.8 * (1 - share),) * 3)
    assert found.emission == pytest.approx((share,) * 3)
    assert not found.unsupported


def test_add_adds() -> None:
    created = material("M", "ShaderNodeBsdfDiffuse", Color=RED)
    added(created, "ShaderNodeEmission")
    for shading, albedo in (("full", RED[:3]), ("clay", CLAY)):
        found = read_material(created, shading)
        assert found.albedo == pytest.approx(albedo)
        assert found.emission == (1, 1, 1)


def test_emission_and_albedo_may_vary_but_not_in_ways_that_are_not_known() -> None:
    created = mixed("ShaderNodeBsdfDiffuse", "ShaderNodeEmission", None)
    found = read_material(created, "full")
    assert found.emits and found.emission_known and not found.unsupported
    assert found.albedo == (0, 0, 0) and found.albedo_texture and found.emission_texture
    for share, side in ((1.0, 0.0), (0.0, 1.0)):
        seen = Context(backfacing=np.array([[side]]))
        assert found.albedo_texture.rgb(seen, 1) == pytest.approx(0.8 * share * np.ones((1, 3)))
        assert found.emission_texture.rgb(seen, 1) == pytest.approx(side * np.ones((1, 3)))
    tree, output, _ = tree_of(created)
    factor = output.inputs[0].links[0].from_node.inputs[0]
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], factor)
    for shading in ("full", "clay"):
        found = read_material(created, shading)
        assert not found.emission_known
        assert "Emission of Emission" in named(found)
    assert read_material(created, "clay").albedo == CLAY


def test_transparent_lets_shadows_pass_and_clay_closes_it() -> None:
    created = mixed("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent", 0.3)
    found = read_material(created, "full")
    assert (found.opaque, found.unsupported) == (True, ())
    assert found.transmittance == pytest.approx((0.3, 0.3, 0.3))
    assert surface_of(created).transmits
    clay = read_material(created, "clay")
    assert (clay.opaque, clay.albedo, clay.unsupported) == (True, CLAY, ())
    created.use_transparent_shadow = False
    assert not read_material(created, "full").opaque  # Cycles' BSDF sampling sees through it
    varying = mixed("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent", None)
    found = read_material(varying, "full")
    assert found.opaque and found.passes and found.transmittance_texture


@pytest.mark.parametrize("kind", ["ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"])
def test_glass_throws_a_shadow_and_clay_closes_it(kind: str) -> None:
    created = material("M", kind)
    assert read_material(created, "full").opaque
    assert surface_of(created).transmits


@pytest.mark.parametrize(
    ("inputs", "passes", "emission", "known"),
    [
        ({}, 0.0, (0, 0, 0), True),
        ({"Alpha": 0.5}, 0.5, (0, 0, 0), True),
        ({"Emission_Strength": 2.0}, 0.0, (2, 2, 2), True),
        ({"Emission_Strength": 2.0, "Coat_Weight": 1.0}, 0.0, (0, 0, 0), True),
        ({"Emission_Strength": 2.0, "Alpha": 0.25}, 0.75, (0.5, 0.5, 0.5), True),
    ],
)
def test_principled(inputs: Any, passes: float, emission: Any, known: bool) -> None:
    found = read_material(material("M", "ShaderNodeBsdfPrincipled", **inputs), "full")
    assert (found.opaque, found.emission, found.emission_known) == (True, emission, known)
    assert found.transmittance == (passes, passes, passes)
    assert not found.unsupported and [c.kind for c in found.closures] == [PRINCIPLED]
    assert bool(found.emission_texture) == ("Coat_Weight" in inputs)


@pytest.mark.parametrize(
    ("inputs", "feature"),
    [
        ({"Subsurface_Weight": 0.3}, "Principled BSDF Subsurface Weight"),
        ({"Thin_Film_Thickness": 300.0}, "Principled BSDF Thin Film Thickness"),
    ],
)
def test_what_no_closure_does_is_unsupported(inputs: Any, feature: str) -> None:
    found = read_material(material("M", PRINCIPLED, **inputs), "full")
    assert (named(found), found.closures) == ([feature], ())


def test_closures_have_what_their_sockets_get() -> None:
    created = mixed("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfAnisotropic", 0.25)
    glossy = next(n for n in created.node_tree.nodes if n.bl_idname.endswith("Anisotropic"))
    glossy.inputs["Roughness"].default_value = 0.125
    created.node_tree.links.new(
        node(created.node_tree, "ShaderNodeNormalMap").outputs[0], glossy.inputs["Normal"]
    )
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
    paint = node(group, "ShaderNodeBsdfDiffuse", node(group, "ShaderNodeTexNoise"))
    node(group, "NodeGroupOutput", paint)
    created = material("M", "ShaderNodeEmission")
    tree, output, surface = tree_of(created)
    painted = node(tree, "ShaderNodeGroup")
    painted.node_tree = group
    tree.links.new(node(tree, "ShaderNodeAddShader", painted, surface).outputs[0], output.inputs[0])
    questions: list[Asking] = []
    found = surface_of(created, questions).full
    (asking,) = questions
    assert asking.slots == {(("Group",), "Diffuse BSDF", "Color"): 0}
    assert found.albedo_texture and found.albedo_texture.measured and not found.unsupported
    tree.links.new(node(tree, "ShaderNodeTexNoise").outputs[0], surface.node.inputs["Strength"])
    assert surface_of(created, []).unknown_emission
    group.links.new(node(group, "ShaderNodeBevel").outputs[0], paint.inputs["Color"])
    assert "Diffuse BSDF" in named(surface_of(created, []).full)  # a mean over rays


def test_no_surface_is_black_and_clay_is_clay() -> None:
    created = material("M", "ShaderNodeBsdfDiffuse")
    created.node_tree.links.clear()
    assert read_material(created, "full").albedo == (0, 0, 0)
    assert read_material(created, "clay").albedo == CLAY


def test_volumes_are_unsupported_and_gone_as_clay() -> None:
    created = material("M", "ShaderNodeBsdfDiffuse")
    tree, output, _ = tree_of(created)
    fog = node(tree, "ShaderNodeVolumePrincipled")
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    found = read_material(created, "full")
    assert (found.opaque, found.emission_known, named(found)) == (False, True, ["Volume"])
    fog.inputs["Emission Strength"].default_value = 1
    assert not read_material(created, "full").emission_known
    assert read_material(created, "clay").unsupported == ()


@pytest.mark.parametrize(("method", "opaque"), [('BUMP', True), ('DISPLACEMENT', False)])
def test_displacement(method: str, opaque: bool) -> None:
    created = material("M", "ShaderNodeBsdfDiffuse")
    tree, output, _ = tree_of(created)
    height = node(tree, "ShaderNodeDisplacement")
    tree.links.new(height.outputs[0], output.inputs["Displacement"])
    created.displacement_method = method
    found = read_material(created, "full")
    assert found.opaque is opaque
    assert len(found.unsupported) == 1
    assert read_material(created, "clay").unsupported == ()


def test_groups_reroutes_values_and_muted_nodes_are_followed() -> None:
    group = bpy.data.node_groups.new("Paint", 'ShaderNodeTree')
    group.interface.new_socket("Tint", in_out='INPUT', socket_type='NodeSocketColor')
    group.interface.new_socket("Out", in_out='OUTPUT', socket_type='NodeSocketShader')
    paint = node(group, "ShaderNodeBsdfDiffuse", node(group, "NodeGroupInput"))
    node(group, "NodeGroupOutput", paint)

    created = material("M", "ShaderNodeBsdfDiffuse")
    tree, output, _ = tree_of(created)
    painted = node(tree, "ShaderNodeGroup")
    painted.node_tree = group
    painted.inputs[0].default_value = RED
    way = node(tree, "NodeReroute", painted)
    tree.links.new(way.outputs[0], output.inputs[0])
    assert read_material(created, "full").albedo == pytest.approx(RED[:3])

    rgb = node(tree, "ShaderNodeRGB")
    rgb.outputs[0].default_value = (0.1, 0.2, 0.3, 1)
    link = tree.links.new(rgb.outputs[0], painted.inputs[0])
    assert read_material(created, "full").albedo == pytest.approx((0.1, 0.2, 0.3))
    link.is_muted = True
    assert read_material(created, "full").albedo == pytest.approx(RED[:3])

    add = added(created, "ShaderNodeEmission")
    assert read_material(created, "full").emits
    add.mute = True
    found = read_material(created, "full")
    assert (found.emits, found.unsupported) == (False, ())
    assert found.albedo == pytest.approx(RED[:3])


def test_empty_slots() -> None:
    found = read_material(None, "full")
    if bpy.app.version < (5, 0):
        assert (found.albedo, found.unsupported) == ((0.8,) * 3, ())
    else:
        assert ([c.kind for c in found.closures], found.unsupported) == ([PRINCIPLED], ())
    assert read_material(None, "clay").albedo == CLAY
