# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a uniform background, or a record of why it is not one."""

from __future__ import annotations

from typing import Any

from ..scene import Unsupported, World
from . import nodes

_EMITTERS = {"ShaderNodeBackground", "ShaderNodeEmission"}


def read_world(bl_world: Any | None, *, shown: bool = True) -> World:
    """Return the background of an evaluated world; None and hidden ones are black."""
    if bl_world is None or not shown:
        return World()
    radiance, feature = _radiance(bl_world)
    visible = bl_world.cycles_visibility
    features = [f for f in (feature, _volume(bl_world)) if f]
    return World(
        radiance=radiance,
        visible_camera=visible.camera,
        visible_diffuse=visible.diffuse,
        known=not features,
        unsupported=tuple(Unsupported("world", bl_world.name, f) for f in features),
    )


def _radiance(bl_world: Any) -> tuple[nodes.Triple, str | None]:
    """Return the radiance (3,) [W/(m² sr)], and the first feature that is not uniform."""
    if nodes.uses_nodes(bl_world):
        return nodes.uniform_emission(bl_world.node_tree, _EMITTERS)
    r, g, b = bl_world.color
    return (r, g, b), None


def _volume(bl_world: Any) -> str | None:
    output = bl_world.node_tree and bl_world.node_tree.get_output_node("CYCLES")
    volume = output and nodes.source(output.inputs["Volume"]).output
    return "World volume" if volume and nodes.uses_nodes(bl_world) else None
