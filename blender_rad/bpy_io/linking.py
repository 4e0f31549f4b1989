# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and shadow linking, as Cycles takes the collections of objects."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import bpy
import numpy as np

from ..arrays import Bools
from ..errors import Finding
from ..lights import Light, LightRecord
from ..scene import Linking


def read_linking(
    depsgraph: Any, placed: Sequence[tuple[int, int]], name: Callable[[Any], str]
) -> dict[str, Linking]:
    """Return the linking of lights and emitting objects by `name`, of those that have any.

    `placed` tells by instance which object it is and what instances it, by their originals'
    addresses.
    """
    objects: list[Any] = [e.original for e in depsgraph.ids if isinstance(e, bpy.types.Object)]
    linked = [(name(o), o.light_linking) for o in objects if o.light_linking]
    reached: list[dict[str, Bools]] = []
    for kind in ("receiver_collection", "blocker_collection"):
        chosen = {key: _chosen(c) for key, links in linked if (c := getattr(links, kind))}
        # An instancer that any collection names stands for what it instances.
        ever = {member for members in chosen.values() for member in members}
        told = [parent if parent in ever else own for own, parent in placed]
        reached.append({key: _reached(members, told) for key, members in chosen.items()})
    every = np.ones(len(placed) + 1, dtype=bool)
    lit, shadowing = reached
    found = {k: Linking(lit.get(k, every), shadowing.get(k, every)) for k in lit | shadowing}
    return {k: links for k, links in found.items() if not np.all(links)}


def lost_in_cycles(
    linking: Mapping[str, Linking], lights: Sequence[Light], records: Sequence[LightRecord]
) -> list[Finding]:
    """Return for which lights Cycles ends rays at objects that do not shadow them.

    It does with rays that it samples by the surface and that find the light; those that it samples
    by the light are right, and are all where Multiple Importance is off.
    """
    deltas = {light.name for light in lights if light.is_delta}
    key = "cycles.use_multiple_importance_sampling"
    single = {r.name for r in records if not r.properties[key]} | deltas
    lamps = {record.name for record in records}
    loss = "Cycles loses some of its light behind objects that its shadow linking leaves out"
    remedy = ": switch off its Multiple Importance"
    return [
        Finding("shadow-linking", "warning", name, loss + remedy * (name in lamps))
        for name, links in linking.items()
        if not links.shadowing[-1] and name not in single
    ]


def _chosen(collection: Any) -> dict[int, bool]:
    """Return by object whether the collection includes or excludes it; what comes last counts."""
    pairs = [
        (member, state)
        for child, state in zip(collection.children, collection.collection_children, strict=True)
        for member in child.all_objects
    ]
    pairs += zip(collection.objects, collection.collection_objects, strict=True)
    return {o.as_pointer(): s.light_linking.link_state == "INCLUDE" for o, s in pairs}


def _reached(members: Mapping[int, bool], told: Sequence[int]) -> Bools:
    """Return what it includes or, where that is nothing, all but what it excludes."""
    others = not any(members.values())
    return np.array([*(members.get(key, others) for key in told), others])
