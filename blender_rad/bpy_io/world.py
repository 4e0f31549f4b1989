# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a uniform background, maps of one by direction, or a record of why neither."""

from typing import Any

from ..lights import RAYS, SkyMap
from ..scene import BLACK, RGB, Unsupported, World
from ..textures import Expression, constant
from . import nodes
from .sky import known_sky, measure_sky, unmeasurable

_EMITTERS = {"ShaderNodeBackground", "ShaderNodeEmission"}


def shown_world(bl_scene: Any, layer: Any) -> Any | None:
    """Return the world that a view layer renders."""
    return (layer.world_override or bl_scene.world) if layer.use_sky else None


def unknown_world(bl_scene: Any, layer: Any) -> Any | None:
    """Return the world that a view layer renders, where Blender has to be asked what it gives."""
    world = shown_world(bl_scene, layer)
    return world if world and _emission(world)[2] and not _unsupported(world) else None


def read_maps(bl_scene: Any, layer: Any) -> tuple[SkyMap, ...]:
    """Return the maps of a world whose nodes are not known, which take renders of their own."""
    world = unknown_world(bl_scene, layer)
    frame = bl_scene.frame_current, bl_scene.frame_subframe
    return measure_sky(world, frame) if world else ()


def read_world(bl_world: Any | None, maps: tuple[SkyMap, ...] = ()) -> World:
    """Return the background of an evaluated world with the `maps` of it; None is black."""
    if bl_world is None:
        return World()
    radiance, varying, unknown = _emission(bl_world)
    features = _unsupported(bl_world) if varying or unknown else _beyond(bl_world)
    if varying:
        if not (maps or features):
            maps = (known_sky(bl_world, varying + constant(radiance)),)
        radiance = BLACK
    elif unknown and not (maps or features):
        features = [unknown]
    shown = {f"visible_{r}": getattr(bl_world.cycles_visibility, r) for r in ("camera", *RAYS)}
    return World(
        radiance=radiance,
        maps=maps,
        **shown,
        known=not features,
        unsupported=tuple(Unsupported("world", bl_world.name, f) for f in features),
    )


def _emission(bl_world: Any) -> tuple[RGB, Expression | None, str | None]:
    """Return the radiance [W/(m² sr)]: constant, varying, and what is not known of it."""
    if nodes.uses_nodes(bl_world):
        return nodes.emission(bl_world.node_tree, _EMITTERS)
    r, g, b = bl_world.color
    return (r, g, b), None, None


def _unsupported(bl_world: Any) -> list[str]:
    return [f for f in (unmeasurable(bl_world), *_beyond(bl_world)) if f]


def _beyond(bl_world: Any) -> list[str]:
    """Return what else it does; without shadows Cycles still hides what rays of surfaces find."""
    output = nodes.uses_nodes(bl_world) and bl_world.node_tree.get_output_node("CYCLES")
    features = ["World volume"] * bool(output and nodes.source(output.inputs["Volume"]).output)
    return features + ["World without shadows"] * (
        not getattr(bl_world.cycles, "use_shadows", True)
    )
