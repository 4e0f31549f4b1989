# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a uniform background, maps of one by direction, or a record of why neither."""

from __future__ import annotations

from typing import Any

from ..lights import SkyMap
from ..scene import Unsupported, World
from ..textures import Expression, constant
from . import nodes
from .sky import known_sky, measure_sky, unmeasurable

_EMITTERS = {"ShaderNodeBackground", "ShaderNodeEmission"}


def shown_world(bl_scene: Any, layer: Any) -> Any | None:
    """Return the world that a view layer renders."""
    return (layer.world_override or bl_scene.world) if layer.use_sky else None


def read_maps(bl_scene: Any, layer: Any) -> tuple[SkyMap, ...]:
    """Return the maps of a world that is not uniform, which may take renders of their own."""
    bl_world = shown_world(bl_scene, layer)
    if bl_world is None or _uniform(bl_world)[1] is None or _unsupported(bl_world):
        return ()
    if _emission(bl_world)[2] is None:
        return ()  # `read_world` knows them
    return measure_sky(bl_world, (bl_scene.frame_current, bl_scene.frame_subframe))


def read_world(bl_world: Any | None, maps: tuple[SkyMap, ...] = ()) -> World:
    """Return the background of an evaluated world with the `maps` of it; None is black."""
    if bl_world is None:
        return World()
    radiance, feature = _uniform(bl_world)
    features = _unsupported(bl_world) if feature else _beyond(bl_world)
    if feature and not maps and not features:
        radiance, varying, unknown = _emission(bl_world)
        if unknown or varying is None:
            features = [feature]
        else:
            maps = (known_sky(bl_world, varying + constant(radiance)),)
    visible = bl_world.cycles_visibility
    return World(
        radiance=radiance,
        maps=maps,
        visible_camera=visible.camera,
        visible_diffuse=visible.diffuse,
        visible_glossy=visible.glossy,
        visible_transmission=visible.transmission,
        known=not features,
        unsupported=tuple(Unsupported("world", bl_world.name, f) for f in features),
    )


def _uniform(bl_world: Any) -> tuple[nodes.Triple, str | None]:
    """Return the radiance (3,) [W/(m² sr)], and the first feature that is not uniform."""
    if nodes.uses_nodes(bl_world):
        return nodes.uniform_emission(bl_world.node_tree, _EMITTERS)
    r, g, b = bl_world.color
    return (r, g, b), None


def _emission(bl_world: Any) -> tuple[nodes.Triple, Expression | None, str | None]:
    return nodes.emission(bl_world.node_tree, _EMITTERS)


def _unsupported(bl_world: Any) -> list[str]:
    return [f for f in (unmeasurable(bl_world), *_beyond(bl_world)) if f]


def _beyond(bl_world: Any) -> list[str]:
    """Return what else it does; without shadows Cycles still hides what rays of surfaces find."""
    output = bl_world.node_tree and bl_world.node_tree.get_output_node("CYCLES")
    volume = output and nodes.source(output.inputs["Volume"]).output
    features = ["World volume"] * bool(volume and nodes.uses_nodes(bl_world))
    return features + ["World without shadows"] * (
        not getattr(bl_world.cycles, "use_shadows", True)
    )
