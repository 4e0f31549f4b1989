# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: the closures that reach the surface output, in full or as clay.

Lambert, emission and what passes straight are kept as plain sums, everything else as closures for
`bsdfs`. What a node tree gives that is not known here is asked of Blender where that helps: where
the camera looks first.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import bpy

from ..bsdfs import BSDFS
from ..scene import BLACK, CLAY_ALBEDO, RGB, Closure, Material, Unsupported
from ..textures import Expression, constant, folded
from . import nodes
from .expressions import default, plain_properties
from .nodes import Ask, Leaf
from .questions import Asking

Shading = Literal["full", "clay"]

DEFAULT_NAME = "(no material)"
DEFAULT_ALBEDO = 0.8  # Cycles' surface for empty slots, up to Blender 4.5

_TRANSPARENT = "ShaderNodeBsdfTransparent"
_HOLDOUT = "ShaderNodeHoldout"
_DIFFUSE = "ShaderNodeBsdfDiffuse"
_ALWAYS_PASS = {"ShaderNodeBsdfRayPortal", "ShaderNodeScript"}
_PRINCIPLED = "ShaderNodeBsdfPrincipled"
# Closures by what they do, where one of these sockets is not 0.
_GLASS = {
    **dict.fromkeys(("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"), ()),
    _PRINCIPLED: ("Transmission Weight",),
}
_SUBSURFACE = {"ShaderNodeSubsurfaceScattering": (), _PRINCIPLED: ("Subsurface Weight",)}
_GLOWING = {
    **dict.fromkeys(("ShaderNodeEmission", "ShaderNodeScript"), ()),
    "ShaderNodeVolumePrincipled": ("Emission Strength", "Blackbody Intensity"),
}
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
    """What reaches a material's output, before it is decided how it is to be shaded."""

    full: Material  # with all that it does; what cannot be evaluated is unsupported
    glow: tuple[RGB, Expression | None] = (BLACK, None)  # its emission without what covers it
    reflects: bool = True  # whether any closure does something else than emit
    unknown_emission: str = ""  # what of it emits in a way that is not known
    transmits: bool = False  # whether light may pass it, in whatever way: what clay closes
    moved: bool = False  # whether Cycles leaves the normals in object space for it
    asked: tuple[str, ...] = ()  # sockets whose values Blender is asked for

    @property
    def may_emit(self) -> bool:
        """Whether its surface emits, as far as is known."""
        return self.full.emits or bool(self.unknown_emission)

    @property
    def clay(self) -> Material:
        """Lambert 0.8 and opaque, with the emission kept; no coat, bump, displacement and volume.

        Only what purely emits does not reflect.
        """
        unknown = self.unknown_emission
        return Material(
            name=self.full.name,
            albedo=nodes.grey(0.0 if self.may_emit and not self.reflects else CLAY_ALBEDO),
            emission=self.glow[0],
            emission_texture=self.glow[1],
            emission_known=not unknown,
            unsupported=(Unsupported("material", self.full.name, unknown),) if unknown else (),
        )


def surface_of(bl_material: Any | None, questions: list[Asking] | None = None) -> Surface:
    """Return what reaches the output of a material that Cycles would use; None is an empty slot.

    `questions` gets what Blender is to be asked; None asks it nothing.
    """
    if bl_material is None:
        return Surface(_empty_slot())
    if not nodes.uses_nodes(bl_material):
        r, g, b, _ = bl_material.diffuse_color
        return Surface(Material(bl_material.name, albedo=(r, g, b)))
    output = bl_material.node_tree.get_output_node("CYCLES")
    if output is None:
        return Surface(Material(bl_material.name), reflects=False)
    if questions is None:
        return _from_output(bl_material, output, None)
    questions.append(Asking(bl_material.original))
    return _from_output(bl_material, output, questions[-1])


def _empty_slot() -> Material:
    if bpy.app.version < (5, 0):
        return Material(DEFAULT_NAME, albedo=nodes.grey(DEFAULT_ALBEDO))
    inputs = {name: constant(value) for name, value in _PRINCIPLED_DEFAULTS.items()}
    inputs["Coat Normal"] = _SHADING_NORMAL
    plain = Closure(_PRINCIPLED, nodes.WHOLE, inputs, {"distribution": "MULTI_GGX"})
    return Material(DEFAULT_NAME, closures=(plain,))


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
    glowing = [(leaf, *_emission(leaf)) for leaf in closures]
    passing = [_transmittance(leaf) for leaf in closures]
    passes = any(rgb is None or not nodes.is_zero(rgb) for rgb in passing)
    half = passes and not bl_material.use_transparent_shadow  # Cycles' BSDF sampling sees through
    held = (leaf.weight for leaf in others if leaf.node.bl_idname == _HOLDOUT)
    glass = any(_does(leaf, _GLASS) for leaf in closures)
    unknown = [f"Emission of {nodes.feature(leaf)}" for leaf, rgb, _ in glowing if rgb is None][:1]
    dark = unknown or ["Volume emission"] * any(_does(leaf, _GLOWING) for leaf in volume)
    features = [each for each in shaded if isinstance(each, str)]
    features += ["Volume"] * bool(volume)
    features += ["Displacement"] * displaced
    features += ["Bump from displacement"] * (height and not displaced and normal is None)
    name, asked = bl_material.name, tuple(ask.names) if ask else ()
    material = Material(
        name=name,
        **_parts("albedo", (each for each in shaded if isinstance(each, Expression))),
        **_parts("emission", (rgb for _, rgb, _ in glowing if rgb)),
        **_parts("transmittance", filter(None, passing)),
        **_parts("holdout", filter(None, held)),
        emission_known=not dark,
        opaque=not (None in passing or half or volume or displaced),
        closures=tuple(each for each in shaded if isinstance(each, Closure)),
        normal=normal,
        glass=glass,
        measured=bool(asked),
        unsupported=tuple(
            Unsupported("material", name, feature) for feature in dict.fromkeys(features + dark)
        ),
    )
    return Surface(
        full=material,
        glow=nodes.split(bare for *_, bare in glowing if bare),
        reflects=bool(others),
        unknown_emission="".join(unknown),
        transmits=passes or bool(volume) or glass,
        moved=displaced or any(_does(leaf, _SUBSURFACE) for leaf in closures),
        asked=asked,
    )


def _parts(name: str, parts: Iterable[Expression]) -> dict[str, Any]:
    """Return the sum of expressions as the two fields of a `Material`, constant and varying."""
    constant_part, varying = nodes.split(parts)
    return {name: constant_part, f"{name}_texture": varying}


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
        return default(socket)
    if not linked and socket.name in {"Normal", "Coat Normal"}:
        return _SHADING_NORMAL
    if not linked and socket.name == "Tangent":
        return _OWN_TANGENT
    return nodes.read(socket, leaf.groups, ask)


def _emission(leaf: Leaf) -> tuple[Expression | None, Expression | None]:
    """Return the radiance that a closure emits, and what it would be without coat and sheen.

    None when it may emit and is not known.
    """
    kind, rgb = leaf.node.bl_idname, nodes.NOTHING
    if kind == "ShaderNodeScript":
        rgb = None
    elif kind == "ShaderNodeEmission":
        rgb = nodes.leaf_emission(leaf)
    elif kind == _PRINCIPLED:
        rgb = nodes.leaf_emission(leaf, "Emission Strength", "Emission Color")
    if kind != _PRINCIPLED or rgb is None or nodes.is_zero(rgb):
        return rgb, rgb
    sockets = {s.name: s for s in leaf.node.inputs if s.name.startswith(_ABOVE_EMISSION)}
    inputs = {name: _input(leaf, socket, None) for name, socket in sockets.items()}
    known = {name: each for name, each in inputs.items() if each}
    alpha = _clipped(known.get("Alpha"))
    if len(known) < len(inputs) or alpha is None:
        return None, None
    layers = {nodes.input_number(leaf, name) for name in ("Coat Weight", "Sheen Weight")}
    bare = rgb * alpha
    return (bare if layers == {0.0} else rgb * Expression("EMITTED", inputs=known)), bare


def _transmittance(leaf: Leaf) -> Expression | None:
    """Return what the closure lets pass straight, None where that is not known."""
    kind = leaf.node.bl_idname
    if kind in _ALWAYS_PASS:
        return None
    if kind == _TRANSPARENT:
        rgb = nodes.read(leaf.node.inputs["Color"], leaf.groups)
    elif kind == _PRINCIPLED:
        alpha = _clipped(nodes.read(leaf.node.inputs["Alpha"], leaf.groups))
        thin = nodes.input_number(leaf, "Thin Wall") != 0.0 and _does(leaf, _GLASS)
        rgb = None if alpha is None or thin else alpha * constant(-1.0) + nodes.WHOLE
    else:
        return nodes.NOTHING
    if rgb is None or nodes.is_zero(rgb):
        return rgb
    return None if leaf.everywhere is None else leaf.everywhere * rgb


def _clipped(value: Expression | None) -> Expression | None:
    return value and folded(Expression("CLIP", inputs={"a": value}))


def _does(leaf: Leaf, kinds: dict[str, tuple[str, ...]]) -> bool:
    """Return whether a closure is of one of `kinds`, with any of the sockets it needs not 0."""
    sockets = kinds.get(leaf.node.bl_idname)
    return sockets == () or any(nodes.input_number(leaf, name) != 0.0 for name in sockets or ())


def without_velvet(material: Material) -> Material:
    """Return a material for scenes with light that is for diffuse rays but not glossy, or reversed.

    Velvet is unsupported then: glossy where Cycles samples lights, diffuse where it samples
    surfaces, its picture is a mix of both.
    """
    if all(each.settings.get("distribution") != "ASHIKHMIN" for each in material.closures):
        return material
    cause = Unsupported("material", material.name, "Velvet in light for some rays")
    return replace(material, unsupported=(*material.unsupported, cause))
