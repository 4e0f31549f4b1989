# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: the closures that reach the surface output, in full or as clay.

Lambert, emission and what passes straight are kept as plain sums, everything else as closures for
`bsdfs`. What a node tree gives that is not known here is asked of Blender where that helps: where
the camera looks first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import bpy

from ..bsdfs import BSDFS
from ..scene import CLAY_ALBEDO, Closure, Material, Unsupported
from ..textures import Expression, constant, folded
from . import nodes
from .expressions import plain_properties
from .nodes import BLACK, Ask, Leaf, Triple
from .questions import Asking, Questions

Shading = Literal["full", "clay"]

DEFAULT_NAME = "(no material)"
DEFAULT_ALBEDO = 0.8  # Cycles' surface for empty slots, up to Blender 4.5

_TRANSPARENT = "ShaderNodeBsdfTransparent"
_HOLDOUT = "ShaderNodeHoldout"
_DIFFUSE = "ShaderNodeBsdfDiffuse"
_ALWAYS_PASS = {"ShaderNodeBsdfRayPortal", "ShaderNodeScript"}
_GLASS = {"ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"}
_PRINCIPLED = "ShaderNodeBsdfPrincipled"
_BEYOND = ("Subsurface Weight", "Thin Film Thickness")  # what no closure here does, unless it is 0
_LAYERS = (*_BEYOND, "Coat Weight", "Sheen Weight")  # what starts like them counts unless it is 0
_ABOVE_EMISSION = ("Alpha", "Coat", "Sheen", "Normal")
_SHADING_NORMAL = Expression("ShaderNodeNewGeometry", "Normal")
_OWN_TANGENT = Expression("ShaderNodeNewGeometry", "Tangent")
_PRINCIPLED_DEFAULTS = {  # of the surface of empty slots from Blender 5 on
    **dict.fromkeys(("Base Color",), 0.8),
    **dict.fromkeys(("Roughness", "Specular IOR Level", "Sheen Roughness"), 0.5),
    **dict.fromkeys(("IOR", "Coat IOR"), 1.5),
    **dict.fromkeys(("Alpha", "Specular Tint", "Sheen Tint", "Coat Tint"), 1.0),
    **dict.fromkeys(("Metallic", "Diffuse Roughness", "Anisotropic", "Anisotropic Rotation"), 0.0),
    **dict.fromkeys(("Transmission Weight", "Coat Weight", "Sheen Weight", "Thin Wall"), 0.0),
    "Coat Roughness": 0.03,
}


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
    transmittance, transmittance_texture : (3,) what passes it straight, and what of that varies.
    passes_shadow : whether shadow rays pass it in a way that is not known.
    transmits : whether light may pass it, in whatever way: what clay closes.
    glass : whether it passes bent.
    subsurface, displaced : whether Cycles leaves the normals in object space for it.
    closures : what reflects or lets through, and is not Lambert.
    normal : what the shading normal is, where displacement bends it.
    holdout, holdout_texture : (3,) what is held out, and what of that varies.
    asked : sockets whose values Blender is asked for.
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
    glass: bool = False
    subsurface: bool = False
    displaced: bool = False
    albedo_texture: Expression | None = None
    emission_texture: Expression | None = None
    transmittance_texture: Expression | None = None
    closures: tuple[Closure, ...] = ()
    normal: Expression | None = None
    holdout: Triple = BLACK
    holdout_texture: Expression | None = None
    asked: tuple[str, ...] = ()

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
        transmittance_texture=surface.transmittance_texture,
        closures=surface.closures,
        normal=surface.normal,
        holdout=surface.holdout,
        holdout_texture=surface.holdout_texture,
        glass=surface.glass,
        measured=bool(surface.asked),
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


def surface_of(bl_material: Any | None, questions: Questions | None = None) -> Surface:
    """Return what reaches the output of a material that Cycles would use.

    `questions` notes what Blender is to be asked; None asks it nothing.
    """
    if bl_material is None:
        return _empty_slot()
    if not nodes.uses_nodes(bl_material):
        r, g, b, _ = bl_material.diffuse_color
        return Surface(bl_material.name, albedo=(r, g, b), reflects=True)
    output = bl_material.node_tree.get_output_node("CYCLES")
    if output is None:
        return Surface(bl_material.name)
    return _from_output(bl_material, output, questions and questions.about(bl_material))


def _empty_slot() -> Surface:
    if bpy.app.version < (5, 0):
        return Surface(DEFAULT_NAME, albedo=nodes.grey(DEFAULT_ALBEDO), reflects=True)
    inputs = {name: constant(value) for name, value in _PRINCIPLED_DEFAULTS.items()}
    inputs["Coat Normal"] = _SHADING_NORMAL
    settings = {"distribution": "MULTI_GGX"}
    plain = Closure(_PRINCIPLED, nodes.WHOLE, inputs, settings)
    return Surface(DEFAULT_NAME, reflects=True, closures=(plain,))


def _from_output(bl_material: Any, output: Any, ask: Asking | None) -> Surface:
    closures = list(nodes.leaves(output.inputs["Surface"], ask=ask))
    volume = list(nodes.leaves(output.inputs["Volume"]))
    displacement = output.inputs["Displacement"]
    height = nodes.source(displacement).output is not None
    displaced = height and bl_material.displacement_method != "BUMP"
    normal = ask.normal(displacement) if ask and height and not displaced else None
    others = [leaf for leaf in closures if leaf.node.bl_idname != "ShaderNodeEmission"]
    corrected = getattr(bl_material.cycles, "use_bump_map_correction", True)
    shaded = [_shaded(leaf, corrected, ask) for leaf in others]
    glowing = [(leaf, _emission(leaf)) for leaf in closures]
    unknown = [nodes.feature(leaf) for leaf, rgb in glowing if rgb is None]
    features = [each for each in shaded if isinstance(each, str)]
    features += ["Volume"] * bool(volume)
    features += ["Displacement"] * displaced
    features += ["Bump from displacement"] * (height and not displaced and normal is None)
    passing = [_transmittance(leaf) for leaf in closures]
    passes = any(rgb is None or not nodes.is_zero(rgb) for rgb in passing)
    glass = any(map(_is_glass, closures))
    half = passes and not bl_material.use_transparent_shadow  # Cycles' BSDF sampling sees through
    albedo, albedo_texture = nodes.split(each for each in shaded if isinstance(each, Expression))
    emission, emission_texture = nodes.split(rgb for _, rgb in glowing if rgb)
    transmittance, transmittance_texture = nodes.split(rgb for rgb in passing if rgb)
    held = (leaf.weight for leaf in others if leaf.node.bl_idname == _HOLDOUT)
    holdout, holdout_texture = nodes.split(weight for weight in held if weight)
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
        transmittance=transmittance,
        transmittance_texture=transmittance_texture,
        holdout=holdout,
        holdout_texture=holdout_texture,
        passes_shadow=None in passing or half or bool(volume) or displaced,
        transmits=passes or bool(volume) or glass,
        glass=glass,
        subsurface=any(map(_subsurface, closures)),
        displaced=displaced,
        closures=tuple(each for each in shaded if isinstance(each, Closure)),
        normal=normal,
        asked=tuple(ask.names) if ask else (),
    )


def _shaded(leaf: Leaf, corrected: bool, ask: Ask | None) -> Expression | Closure | str:
    """Return what a leaf does: an albedo, a closure, or what is not known of it."""
    node, kind = leaf.node, leaf.node.bl_idname
    beyond = [name for name in _BEYOND if nodes.input_number(leaf, name) != 0.0]
    if leaf.weight is None or beyond or _transmittance(leaf) is None:
        return " ".join((nodes.feature(leaf), *beyond))
    if kind in {_TRANSPARENT, _HOLDOUT}:
        return nodes.NOTHING
    tilted = "Normal" in node.inputs and nodes.source(node.inputs["Normal"], leaf.groups).output
    if kind == _DIFFUSE and not tilted and nodes.input_number(leaf, "Roughness") == 0.0:
        rgb = nodes.read(node.inputs["Color"], leaf.groups, ask)
        return nodes.feature(leaf) if rgb is None else leaf.weight * rgb
    bare = {nodes.input_number(leaf, n) for n in ("Anisotropic", "Anisotropy")} == {0.0}
    sockets = [s for s in node.inputs if s.enabled and not (bare and s.name == "Tangent")]
    inputs = {socket.name: _input(leaf, socket, ask) for socket in sockets}
    if kind not in BSDFS or None in inputs.values():
        return nodes.feature(leaf)
    known = {name: each for name, each in inputs.items() if each is not None}
    return Closure(
        kind=kind,
        weight=leaf.weight,
        normal=known.pop("Normal", None) if tilted else None,
        tangent=known.pop("Tangent", None),
        inputs=known,
        settings=plain_properties(node) | {"use_bump_map_correction": corrected},
    )


def _input(leaf: Leaf, socket: Any, ask: Ask | None) -> Expression | None:
    """Return the value of a closure's socket; what cannot count is not followed."""
    linked = nodes.source(socket, leaf.groups).output is not None
    layers = [n for n in _LAYERS if socket.name.startswith(n.rsplit(" ", 1)[0])]
    idle = any(nodes.input_number(leaf, layer) == 0.0 for layer in layers)
    if idle or socket.name.startswith("Emission"):
        value = socket.default_value
        return constant(value if isinstance(value, int | float) else tuple(value)[:3])
    if not linked and socket.name in {"Normal", "Coat Normal"}:
        return _SHADING_NORMAL
    if not linked and socket.name == "Tangent":
        return _OWN_TANGENT
    return nodes.read(socket, leaf.groups, ask)


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
    if rgb is None or nodes.is_zero(rgb):
        return rgb
    sockets = {s.name: s for s in leaf.node.inputs if s.name.startswith(_ABOVE_EMISSION)}
    inputs = {name: _input(leaf, socket, None) for name, socket in sockets.items()}
    known = {name: each for name, each in inputs.items() if each}
    alpha = _clipped(known.get("Alpha"))
    if len(known) < len(inputs) or alpha is None:
        return None
    if [nodes.input_number(leaf, name) for name in ("Coat Weight", "Sheen Weight")] == [0.0, 0.0]:
        return rgb * alpha
    return rgb * Expression("EMITTED", inputs=known)


def _transmittance(leaf: Leaf) -> Expression | None:
    """Return what the closure lets pass straight, None where that is not known."""
    kind = leaf.node.bl_idname
    if kind in _ALWAYS_PASS:
        return None
    if kind == _TRANSPARENT:
        rgb = nodes.read(leaf.node.inputs["Color"], leaf.groups)
    elif kind == _PRINCIPLED:
        alpha = _clipped(nodes.read(leaf.node.inputs["Alpha"], leaf.groups))
        thin = nodes.input_number(leaf, "Thin Wall") != 0.0 and _is_glass(leaf)
        rgb = None if alpha is None or thin else alpha * constant(-1.0) + nodes.WHOLE
    else:
        return nodes.NOTHING
    if rgb is None or nodes.is_zero(rgb):
        return rgb
    return None if leaf.everywhere is None else leaf.everywhere * rgb


def _clipped(value: Expression | None) -> Expression | None:
    return value and folded(Expression("CLIP", inputs={"a": value}))


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
