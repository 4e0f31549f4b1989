# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that sheds light in a scene, known or not, as one list for the estimator."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np

from .arrays import Floats, Ints
from .lights import RAYS, Light
from .lights._environment import WHOLE
from .lights.mesh import MeshLight
from .lights.world import Portal, WorldLight
from .rays import transform_points
from .scene import Instance, Material, Scene, Unsupported, World
from .shading import context_on
from .textures import Expression

WORLD_NAME = "World"


@dataclass(frozen=True)
class Emitter:
    """A light and the layer that it belongs to."""

    light: Light
    layer: int  # index into the layers' names, -1 for what only excludes
    cause: Unsupported | None = None  # why it is not known: points that it reaches are out


def emitters(scene: Scene) -> tuple[list[Emitter], list[str]]:
    """Return the scene's emitters and the names of their layers."""
    known: list[Light] = list(scene.lights)
    unknown: list[tuple[Light, Unsupported]] = []
    for instance in scene.instances:
        for slot, index in enumerate(() if instance.proxy else instance.materials):
            material = scene.materials[index]
            if not material.emission_known:
                cause = _cause(material.unsupported, "material", material.name)
                unknown.append((_mesh_light(scene, instance, slot, material), cause))
            elif material.emits:
                known.append(_mesh_light(scene, instance, slot, material))
    world = scene.world
    known += world_lights(scene)
    if not world.known:
        everywhere = WorldLight(name=WORLD_NAME, rgb=np.ones(3), reaches=reaches(world))
        unknown.append((everywhere, _cause(world.unsupported, "world", WORLD_NAME)))
    for light in scene.unknown_lights:
        own = tuple(u for u in scene.unsupported if u.kind == "light" and u.name == light.name)
        unknown.append((light, _cause(own, "light", light.name)))
    rays = set(RAYS if any(m.closures for m in scene.materials) else RAYS[:1])
    known = [light for light in known if rays & {*light.reaches}]
    names = list(dict.fromkeys(light.name for light in known))
    found = [Emitter(light, names.index(light.name)) for light in known]
    found += [Emitter(light, -1, cause) for light, cause in unknown if rays & {*light.reaches}]
    return found, names


def world_lights(scene: Scene) -> list[WorldLight]:
    """Return the known background in parts that add up: uniform, by direction, suns' discs."""
    world = scene.world
    if not world.known:
        return []
    portals = tuple(p for p in map(Portal.from_record, scene.light_records) if p)
    light = partial(WorldLight, name=WORLD_NAME, reaches=reaches(world))
    even = [light(rgb=np.array(world.radiance), portals=portals)] if any(world.radiance) else []
    return even + [
        light(rgb=np.full(3, sky.scale), sky=sky, portals=portals if sky.half == WHOLE else ())
        for sky in world.maps
        if sky.scale
    ]


def reaches(seen: Instance | World) -> tuple[str, ...]:
    """Return the kinds of lobes that something lights."""
    return tuple(ray for ray in RAYS if getattr(seen, f"visible_{ray}"))


def _mesh_light(scene: Scene, instance: Instance, slot: int, material: Material) -> Light:
    mesh = scene.meshes[instance.mesh]
    last = len(instance.materials) - 1
    chosen = np.flatnonzero(np.minimum(mesh.slots, last) == slot)
    vertices = transform_points(instance.world_from_object, mesh.vertices)
    rgb = np.array(material.emission) if material.emission_known else np.ones(3)
    linked = instance.name in scene.linking
    light = MeshLight(
        name=instance.name,
        rgb=rgb,
        triangles=vertices[mesh.triangles[chosen]],
        reaches=reaches(instance),
        solid=instance.visible_shadow and material.opaque and not (material.passes or linked),
    )
    if material.emission_texture is None or not material.emission_known:
        return light
    texture = partial(_glow, scene, instance, material, chosen)
    return replace(light, rgb=np.ones(3), texture=texture)


def _glow(scene: Scene, instance: Instance, material: Material, chosen: Ints, *at: Any) -> Floats:
    """Return the radiance of chosen triangles: `MeshLight.texture`."""
    triangle, uv, incoming = at
    context = context_on(scene, instance, chosen[triangle], uv, incoming)
    varying = cast("Expression", material.emission_texture)
    return np.array(material.emission) + varying.rgb(context, len(triangle))


def _cause(found: tuple[Unsupported, ...], kind: str, name: str) -> Unsupported:
    return found[0] if found else Unsupported(kind, name, "emission")  # type: ignore[arg-type]
