# SPDX-License-Identifier: GPL-3.0-or-later
"""The depsgraph's object instances as meshes, instances and lights."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy as np

from ..arrays import Floats
from ..errors import Finding, RadError
from ..lights import RAYS, Light, Model
from ..lights._base import LightRecord, light_from_record
from ..scene import Instance, Linking, Material, Mesh, Unsupported
from .arrays import gathered, matrix
from .expressions import IMAGES
from .lights import NOT_FINITE, light_record
from .linking import lost_in_cycles, read_linking
from .materials import Shading, Surface, surface_of
from .meshes import box_mesh, read_mesh
from .questions import Asking

_PROXIES = {"CURVES": "Hair", "POINTCLOUD": "Point cloud", "VOLUME": "Volume object"}
Bounds = tuple[Floats, Floats]
NOTES = {
    "area-sheared": "its axes are not at right angles (a parent scaled unevenly): Cycles takes a"
    " wrong area, so that its light is not what its power says",
    "ies-unreadable": "Cycles cannot read its IES file, and takes 100 for it in every direction",
    "ies-seam": "Cycles before Blender 5 makes axially symmetric IES light 8.3 % too strong, and as"
    " much as 12.5 % opposite its seam",
    "ies-mirrored": "IES planes turn against the clock, seen from above; Cycles turns them with it,"
    " so that its light is mirrored",
}
_RAYS = ("camera", *RAYS, "volume_scatter", "shadow")


@dataclass(frozen=True)
class _Facts:
    """What holds for an object under one instancer."""

    name: str
    visible: dict[str, bool]  # by kind of ray
    features: tuple[str, ...]  # what it does that cannot be evaluated
    transparent: bool  # whether shadow rays may pass it for that reason
    held_out: bool  # whether the camera sees nothing of it
    modified: bool


@dataclass
class Reader:
    """Collects meshes, materials, instances and lights from a render depsgraph."""

    depsgraph: Any
    shading: Shading
    model: Model
    unit_scale_m: float
    questions: list[Asking] | None = None
    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    unknown_lights: list[Light] = field(default_factory=list)
    records: list[LightRecord] = field(default_factory=list)
    linking: dict[str, Linking] = field(default_factory=dict[str, Linking])
    unsupported: list[Unsupported] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def __post_init__(self) -> None:
        IMAGES.clear()
        self._scene = self.depsgraph.scene
        self._layer = self.depsgraph.view_layer
        self._known = Counter(o.name for o in bpy.data.objects)
        self._mesh_index: dict[Any, int | None] = {}
        self._material_index: dict[Any, int] = {}
        self._surfaces: dict[int, Surface] = {}
        self._templates: dict[Any, list[Instance]] = {}  # what an object gives, not yet placed
        self._placed: list[tuple[Instance, tuple[int, int], Floats]] = []
        self._apart: set[int] = set()  # meshes whose normals Cycles leaves in object space

    def read(self) -> None:
        """Go through all instances of the depsgraph."""
        for item in self.depsgraph.object_instances:
            self._read_instance(item)
        self._record_hidden()
        self._place()
        self.findings += lost_in_cycles(self.linking, self.lights, self.records)
        self.findings = list(dict.fromkeys(self.findings))
        self.unsupported = list(dict.fromkeys(self.unsupported))

    def _read_instance(self, item: Any) -> None:
        shown, real = item.object, item.instance_object if item.is_instance else item.object
        parent = item.parent if item.is_instance else shown
        data = shown.data
        if isinstance(data, bpy.types.Light):
            if item.show_self:
                self.read_light(shown, matrix(item.matrix_world), real, parent)
            return
        if not isinstance(data, bpy.types.Mesh) and shown.type not in _PROXIES:
            return
        key = (real.as_pointer(), parent.as_pointer(), data.as_pointer())
        if key not in self._templates:
            self._templates[key] = [*self._geometry(item, real, self._facts(shown, real, parent))]
        owners = (real.original.as_pointer(), parent.original.as_pointer())
        for template in self._templates[key]:
            self._placed.append((template, owners, matrix(item.matrix_world)))

    def _place(self) -> None:
        """Put the templates where they stand; what stands nowhere is left out."""
        users = Counter(template.mesh for template, *_ in self._placed)
        owners: list[tuple[int, int]] = []
        for template, owner, world in self._placed:
            if not np.isfinite(world).all():
                self._left_out(template.name, "its position is not finite")
                continue
            owners.append(owner)
            alone = users[template.mesh] == 1 and template.mesh not in self._apart
            placed = replace(template, world_from_object=world, normals_in_world=alone)
            self.instances.append(placed)
        self.linking = read_linking(self.depsgraph, owners, self._name)

    def _geometry(self, item: Any, real: Any, facts: _Facts) -> Iterator[Instance]:
        """Yield what an object shows: itself, and its particle hair."""
        shown, layer = item.object, self._layer
        if not any(facts.visible.values()):
            return
        drawn = {"CURVES": layer.use_strand, "VOLUME": layer.use_volumes, "POINTCLOUD": True}
        if item.show_self and drawn.get(shown.type, layer.use_solid):
            if shown.type in _PROXIES:
                corners = np.array([tuple(corner) for corner in shown.bound_box])
                bounds = corners.min(axis=0), corners.max(axis=0)
                yield self._proxy(shown, facts, _PROXIES[shown.type], bounds)
            else:
                yield from self._mesh_instance(shown, real, facts)
        hair = _hair_bounds(shown) if item.show_particles and layer.use_strand else None
        if hair is not None:
            yield self._proxy(shown, facts, "Particle hair", hair)

    def _facts(self, shown: Any, real: Any, parent: Any) -> _Facts:
        held = parent.original.holdout_get(view_layer=self._layer_original)
        both = (shown, parent)
        visible = {ray: all(getattr(o, f"visible_{ray}") for o in both) for ray in _RAYS}
        if not held and parent.original.indirect_only_get(view_layer=self._layer_original):
            visible["camera"] = False
        diced, culled = _adaptive(shown, self._scene), _culled(shown, self._scene)
        features = {
            "Shadow catcher": any(o.is_shadow_catcher for o in both),
            "Adaptive subdivision": diced,
            "Render-time culling": culled,
        }
        return _Facts(
            name=self._name(real.original),
            visible=visible,
            features=tuple(feature for feature, shows in features.items() if shows),
            held_out=bool(held),
            transparent=diced or culled,
            modified=real.type == "META"
            or real.is_modified(self._scene, "RENDER")
            or any(slot.link == "OBJECT" for slot in real.material_slots),
        )

    @property
    def _layer_original(self) -> Any:
        return self._scene.original.view_layers[self._layer.name]

    def _name(self, original: Any) -> str:
        """Return the object's name, its library first where two objects share it."""
        name, library = original.name, original.library
        return f"{library.name}/{name}" if library and self._known[name] > 1 else name

    def _mesh_instance(self, shown: Any, real: Any, facts: _Facts) -> Iterator[Instance]:
        """Yield an instance of a mesh; one mesh for every geometry that Cycles keeps apart."""
        own = shown.data == real.data
        key = real.as_pointer() if own and facts.modified else shown.data.as_pointer()
        if key not in self._mesh_index:
            mesh, left_out = read_mesh(shown.data, modified=facts.modified)
            if left_out:
                self._left_out(facts.name, f"{left_out} of its triangles are not finite")
            self._mesh_index[key] = len(self.meshes) if len(mesh.triangles) else None
            self.meshes += [mesh] * (len(mesh.triangles) > 0)
        index = self._mesh_index[key]
        if index is None:
            return
        override = self._layer.material_override
        blocks = [override or slot.material for slot in shown.material_slots] or [override]
        used = int(self.meshes[index].slots.max()) + 1  # those beyond the last take it
        surfaces = [self._surface(block) for block in blocks][:used]
        surfaces += surfaces[-1:] * (used - len(surfaces))
        moved = self.shading == "full" and any(surface.moved for surface in surfaces)
        if moved or "Adaptive subdivision" in facts.features:
            self._apart.add(index)
        yield self._instance(shown, facts, index, surfaces)

    def _surface(self, block: Any | None) -> Surface:
        key = block.as_pointer() if block else 0
        if key not in self._surfaces:
            surface = surface_of(block, self.questions if self.shading == "full" else None)
            self._surfaces[key] = surface
            if count := len(surface.asked):
                names = ", ".join(surface.asked)
                message = f"{count} socket{'s' * (count > 1)} measured through Cycles: {names}"
                self.findings.append(Finding("measured", "info", surface.full.name, message))
            if self.shading == "clay" and surface.transmits:
                message = "lets light pass; as clay it is opaque"
                self.findings.append(Finding("clay-opaque", "warning", surface.full.name, message))
        return self._surfaces[key]

    def _instance(
        self, shown: Any, facts: _Facts, mesh: int, surfaces: list[Surface], *, proxy: bool = False
    ) -> Instance:
        return Instance(
            name=facts.name,
            mesh=mesh,
            world_from_object=np.eye(4),
            materials=tuple(self._material(s, facts, proxy) for s in surfaces),
            **{f"visible_{ray}": facts.visible[ray] for ray in ("camera", "shadow", *RAYS)},
            terminator_geometry_offset=shown.shadow_terminator_geometry_offset,
            terminator_shading_offset=shown.shadow_terminator_shading_offset,
            proxy=proxy,
        )

    def _material(self, surface: Surface, facts: _Facts, proxy: bool) -> int:
        """Return the index of the surface's material, as it is on this object."""
        records = tuple(Unsupported("object", facts.name, f) for f in facts.features)
        self.unsupported.extend(records)
        key = (surface, records, proxy, facts.held_out)
        if key not in self._material_index:
            self._material_index[key] = len(self.materials)
            material = surface.clay if self.shading == "clay" else surface.full
            if proxy and material.emits:
                black = (0.0, 0.0, 0.0)
                material = replace(
                    material, emission=black, emission_texture=None, emission_known=False
                )
            own = replace(
                material,
                opaque=material.opaque and not proxy and not facts.transparent,
                closures=() if facts.held_out else material.closures,
                held_out=facts.held_out,
                unsupported=material.unsupported + records,
            )
            self.materials.append(own)
        return self._material_index[key]

    def _proxy(self, shown: Any, facts: _Facts, feature: str, bounds: Bounds) -> Instance:
        """Return the bounding box of something that cannot be read."""
        self.meshes.append(box_mesh(f"{facts.name} ({feature})", *bounds))
        facts = replace(facts, features=(*facts.features, feature), transparent=True)
        surface = self._surface(next((s.material for s in shown.material_slots), None))
        return self._instance(shown, facts, len(self.meshes) - 1, [surface], proxy=True)

    def read_light(self, shown: Any, world: Floats, real: Any = None, parent: Any = None) -> None:
        """Add a light object at `world` (4, 4), that of `real` under an instancer if given."""
        facts = self._facts(shown, real or shown, parent or shown)
        if not any(facts.visible.values()):
            return
        record = self._record(shown, facts.name, world, visible_camera=facts.visible["camera"])
        if record.unknown == NOT_FINITE:
            self._left_out(facts.name, NOT_FINITE)
            return
        try:
            light = light_from_record(record, self.model)
        except RadError as error:  # an IES text that is none
            plain = {**record.properties, "ies_text": None}
            record = replace(record, unknown=str(error), properties=plain)
            light = light_from_record(record, self.model)
        if light is None:
            return
        light = replace(light, reaches=tuple(ray for ray in RAYS if facts.visible[ray]))
        if not facts.visible["diffuse"]:
            message = "does not light diffuse surfaces (ray visibility)"
            self.findings.append(Finding("hidden-light", "warning", facts.name, message))
        if record.unknown:
            self.unsupported.append(Unsupported("light", facts.name, record.unknown))
            self.unknown_lights.append(light)
            return
        self.lights.append(light)
        for note in light.notes:
            self.findings.append(Finding(note, "warning", facts.name, NOTES[note]))

    def _record(self, bl_object: Any, name: str, world: Floats, **seen: bool) -> LightRecord:
        record = light_record(bl_object, name, world, unit_scale_m=self.unit_scale_m, **seen)
        self.records.append(record)
        return record

    def _record_hidden(self) -> None:
        """Add the records of the scene's lights that renders do not have."""
        names = {record.name for record in self.records}
        for bl_object in self._scene.original.objects:
            name = self._name(bl_object)
            if bl_object.type == "LIGHT" and name not in names:
                self._record(bl_object, name, matrix(bl_object.matrix_world), shown=False)

    def _left_out(self, name: str, why: str) -> None:
        self.findings.append(Finding("not-finite", "warning", name, f"left out: {why}"))


def _adaptive(shown: Any, scene: Any) -> bool:
    """Return whether Cycles dices the object itself, so that its triangles are not these."""
    last = next((m for m in reversed(shown.modifiers) if m.show_render), None)
    if last is None or last.type != "SUBSURF":
        return False
    if bpy.app.version >= (5, 0):
        return bool(last.use_adaptive_subdivision)
    experimental = scene.cycles.feature_set == "EXPERIMENTAL"
    return experimental and bool(shown.cycles.use_adaptive_subdivision)


def _culled(shown: Any, scene: Any) -> bool:
    """Return whether Cycles may leave the object out by its place in the view."""
    if not scene.render.use_simplify:
        return False
    by_camera = scene.cycles.use_camera_cull and shown.cycles.use_camera_cull
    return bool(by_camera or (scene.cycles.use_distance_cull and shown.cycles.use_distance_cull))


def _hair_bounds(shown: Any) -> Bounds | None:
    """Return a box around the object's particle hair with its children, None without hair."""
    points = [np.zeros((0, 3))]
    for system in shown.particle_systems:
        hair = system.settings
        if hair.type == "HAIR" and hair.render_type == "PATH":
            margin = hair.child_radius + hair.kink_amplitude + hair.hair_length / 2
            for particle in system.particles:
                keys = gathered(particle.hair_keys, "co", np.float32, 3)
                points += [keys - margin, keys + margin]
    every = np.concatenate(points)
    return (every.min(axis=0), every.max(axis=0)) if len(every) else None
