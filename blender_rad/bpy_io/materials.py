# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: the closures that reach the surface output, in full or as clay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import bpy

from ..scene import CLAY_ALBEDO, Material, Unsupported
from ..textures import Expression, constant
from . import nodes
from .nodes import BLACK, Leaf, Triple

Shading = Literal["full", "clay"]

DEFAULT_NAME = "(no material)"
DEFAULT_ALBEDO = 0.8  # Cycles' surface for empty slots, up to Blender 4.5

_TRANSPARENT = "ShaderNodeBsdfTransparent"
_ALWAYS_PASS = {"ShaderNodeBsdfRayPortal", "ShaderNodeScript"}
_GLASS = {"ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"}
_PRINCIPLED = "ShaderNodeBsdfPrincipled"
_CLOSURE_CUTOFF = 1e-5  # alphas this near to 1 count as 1 in Cycles


@dataclass(frozen=True)
class Surface:
    """What reaches a material's output, before it is decided how it is to be shaded.

    Attributes
    ----------
    name : of the material.
    albedo, albedo_texture : (3,) of the constant Lambert parts, and of those that vary.
    emission, emission_texture : (3,) constant radiance [W/(m² sr)], and what varies.
    reflects : whether any closure does something else than emit.
    unknown_emission : what emits in a way that is not known; empty when nothing does.
    unknown_volume_emission : the same for the volume.
    features : closures and settings that are not Lambert.
    transmittance : (3,) what passes it straight, as far as it is constant.
    passes_shadow : whether shadow rays pass it in a way that is not known.
    transmits : whether light may pass it, in whatever way: what clay closes.
    subsurface, displaced : whether Cycles leaves the normals in object space for it.
    """

    name: str
    albedo: Triple = BLACK
    emission: Triple = BLACK
    reflects: bool = False
    unknown_emission: str = ""
    unknown_volume_emission: str = ""
    features: tuple[str, ...] = ()
    transmittance: Triple = BLACK
    passes_shadow: bool = False
    transmits: bool = False
    subsurface: bool = False
    displaced: bool = False
    albedo_texture: Expression | None = None
    emission_texture: Expression | None = None

    @property
    def generated(self) -> bool:
        """Whether it looks at Generated coordinates."""
        textures = filter(None, (self.albedo_texture, self.emission_texture))
        return any(("ShaderNodeTexCoord", "Generated") in each.kinds for each in textures)

    @property
    def may_emit(self) -> bool:
        """Whether its surface emits, as far as is known."""
        known = self.emission != BLACK or self.emission_texture is not None
        return known or bool(self.unknown_emission)


def read_material(bl_material: Any | None, shading: Shading) -> Material:
    """Return the material as the estimator sees it; None is an empty slot."""
    surface = surface_of(bl_material)
    return clay(surface) if shading == "clay" else full(surface)


def full(surface: Surface) -> Material:
    """Return the material with what it does; what is not Lambert or constant is unsupported."""
    emission = surface.unknown_emission or surface.unknown_volume_emission
    features = dict.fromkeys((*surface.features, *filter(None, [emission])))
    return Material(
        name=surface.name,
        albedo=surface.albedo,
        albedo_texture=surface.albedo_texture,
        emission=surface.emission,
        emission_texture=surface.emission_texture,
        opaque=not surface.passes_shadow,
        transmittance=surface.transmittance,
        emission_known=not emission,
        unsupported=tuple(Unsupported("material", surface.name, f) for f in features),
    )


def clay(surface: Surface) -> Material:
    """Return the material as clay: Lambert 0.8 and opaque, with its emission kept.

    Only what purely emits does not reflect. Bump, displacement and volume are gone.
    """
    reflects = surface.reflects or not surface.may_emit
    unknown = surface.unknown_emission
    return Material(
        name=surface.name,
        albedo=nodes.grey(CLAY_ALBEDO) if reflects else BLACK,
        emission=surface.emission,
        emission_texture=surface.emission_texture,
        emission_known=not unknown,
        unsupported=(Unsupported("material", surface.name, unknown),) if unknown else (),
    )


def surface_of(bl_material: Any | None) -> Surface:
    """Return what reaches the output of a material that Cycles would use."""
    if bl_material is None:
        return _empty_slot()
    if not nodes.uses_nodes(bl_material):
        r, g, b, _ = bl_material.diffuse_color
        return Surface(bl_material.name, albedo=(r, g, b), reflects=True)
    output = bl_material.node_tree.get_output_node("CYCLES")
    if output is None:
        return Surface(bl_material.name)
    return _from_output(bl_material, output)


def _empty_slot() -> Surface:
    if bpy.app.version >= (5, 0):
        return Surface(DEFAULT_NAME, reflects=True, features=("Principled BSDF (default)",))
    return Surface(DEFAULT_NAME, albedo=nodes.grey(DEFAULT_ALBEDO), reflects=True)


def _from_output(bl_material: Any, output: Any) -> Surface:
    closures = list(nodes.leaves(output.inputs["Surface"]))
    volume = list(nodes.leaves(output.inputs["Volume"]))
    bumped = nodes.source(output.inputs["Displacement"]).output is not None
    displaced = bumped and bl_material.displacement_method != "BUMP"
    others = [leaf for leaf in closures if leaf.node.bl_idname != "ShaderNodeEmission"]
    lambert = [(leaf, _lambert(leaf)) for leaf in others]
    glowing = [(leaf, _emission(leaf)) for leaf in closures]
    unknown = [nodes.feature(leaf) for leaf, rgb in glowing if rgb is None]
    features = [nodes.feature(leaf) for leaf, rgb in lambert if rgb is None]
    features += ["Volume"] * bool(volume)
    features += ["Displacement" if displaced else "Bump from displacement"] * bumped
    passing = [_transmittance(leaf) for leaf in closures]
    passes = any(rgb != BLACK for rgb in passing)
    half = passes and not bl_material.use_transparent_shadow  # Cycles' BSDF sampling sees through
    albedo, albedo_texture = nodes.split(rgb for _, rgb in lambert if rgb)
    emission, emission_texture = nodes.split(rgb for _, rgb in glowing if rgb)
    return Surface(
        name=bl_material.name,
        albedo=albedo,
        albedo_texture=albedo_texture,
        emission=emission,
        emission_texture=emission_texture,
        reflects=bool(others),
        unknown_emission=f"Emission of {unknown[0]}" if unknown else "",
        unknown_volume_emission="Volume emission" if any(map(_volume_emits, volume)) else "",
        features=tuple(features),
        transmittance=nodes.total(rgb for rgb in passing if rgb),
        passes_shadow=None in passing or half or bool(volume) or displaced,
        transmits=passes or bool(volume) or any(map(_is_glass, closures)),
        subsurface=any(map(_subsurface, closures)),
        displaced=displaced,
    )


def _lambert(leaf: Leaf) -> Expression | None:
    """Return the albedo of a plain Diffuse BSDF, None for what is not known."""
    if leaf.node.bl_idname == _TRANSPARENT and _transmittance(leaf) is not None:
        return nodes.NOTHING
    if leaf.node.bl_idname != "ShaderNodeBsdfDiffuse" or leaf.weight is None:
        return None
    rgb = nodes.read(leaf.node.inputs["Color"], leaf.groups)
    rough = nodes.input_number(leaf, "Roughness")
    tilted = nodes.source(leaf.node.inputs["Normal"], leaf.groups).output is not None
    return None if rgb is None or rough != 0.0 or tilted else leaf.weight * rgb


def _emission(leaf: Leaf) -> Expression | None:
    """Return the radiance that a closure emits, None when it may emit and is not known."""
    kind = leaf.node.bl_idname
    if kind == "ShaderNodeEmission":
        return nodes.leaf_emission(leaf)
    if kind == "ShaderNodeScript":
        return None
    if kind != _PRINCIPLED:
        return nodes.NOTHING
    rgb = nodes.leaf_emission(leaf, "Emission Strength", "Emission Color")
    layers = [nodes.input_number(leaf, name) for name in ("Coat Weight", "Sheen Weight")]
    alpha = nodes.input_number(leaf, "Alpha", 1.0)
    if rgb is None or nodes.is_zero(rgb):
        return rgb
    if alpha is None or layers != [0.0, 0.0]:
        return None
    return rgb * constant(min(max(alpha, 0.0), 1.0))


def _transmittance(leaf: Leaf) -> Triple | None:
    """Return what the closure lets pass straight, None where that is not constant."""
    kind = leaf.node.bl_idname
    if kind == _TRANSPARENT:
        rgb = nodes.colour(leaf.node.inputs["Color"], leaf.groups)
    elif kind == _PRINCIPLED:
        alpha = nodes.input_number(leaf, "Alpha", 1.0)
        thin = nodes.input_number(leaf, "Thin Wall") != 0.0 and _is_glass(leaf)
        rgb = None if alpha is None or thin else nodes.grey(1.0 - min(max(alpha, 0.0), 1.0))
    else:
        rgb = None if kind in _ALWAYS_PASS else BLACK
    share = leaf.share
    if rgb is None or share is None:
        return rgb if rgb == BLACK else None
    rgb = nodes.scaled(rgb, share)
    return rgb if sum(rgb) >= 3.0 * _CLOSURE_CUTOFF else BLACK


def _is_glass(leaf: Leaf) -> bool:
    if leaf.node.bl_idname == _PRINCIPLED:
        return nodes.input_number(leaf, "Transmission Weight") != 0.0
    return leaf.node.bl_idname in _GLASS


def _subsurface(leaf: Leaf) -> bool:
    if leaf.node.bl_idname == _PRINCIPLED:
        return nodes.input_number(leaf, "Subsurface Weight") != 0.0
    return leaf.node.bl_idname == "ShaderNodeSubsurfaceScattering"


def _volume_emits(leaf: Leaf) -> bool:
    if leaf.node.bl_idname == "ShaderNodeVolumePrincipled":
        glow = [nodes.input_number(leaf, n) for n in ("Emission Strength", "Blackbody Intensity")]
        return glow != [0.0, 0.0]
    return leaf.node.bl_idname in {"ShaderNodeEmission", "ShaderNodeScript"}
