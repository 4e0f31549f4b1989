# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as plain arrays: what `bpy_io` makes, the estimator reads, and tests build by hand.

Positions are in Blender units ("bu") along the world axes; `Scene.unit_scale_m` turns them into
metres where something is reported. Colours are scene-linear triples of the file's working space.
Nothing here knows of Blender; everything can be pickled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import Finding
from .lights import Light, LightRecord, Model, SkyMap
from .textures import Expression
from .working_space import REC709, luminance_weights

CLAY_ALBEDO = 0.8


@dataclass(frozen=True)
class Unsupported:
    """Something that the estimator cannot do: recorded, excluded, counted. Never guessed."""

    kind: Literal["material", "object", "light", "world", "camera"]
    name: str
    feature: str


@dataclass(frozen=True, eq=False)
class Closure:
    """A shader node that is more than Lambert.

    Attributes
    ----------
    kind : Blender's name of the node, registered in `bsdfs`.
    weight : factor of the mixes before it.
    inputs : by the name of the socket.
    settings : the node's own properties by Blender's names.
    normal, tangent : what the node's inputs of these names say, None where they are not linked.
    """

    kind: str
    weight: Expression
    inputs: Mapping[str, Expression]
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    normal: Expression | None = None
    tangent: Expression | None = None


@dataclass(frozen=True)
class Material:
    """A surface: Lambert reflection, other closures, and emission from both faces.

    Attributes
    ----------
    albedo, albedo_texture : (3,) Lambert reflectance, f_r = albedo/π [1/sr], and what to add to it
        where it varies.
    emission, emission_texture : (3,) radiance [W/(m² sr)], from both faces, and what varies.
    opaque : False where a shadow ray may pass in a way that is not known.
    transmittance, transmittance_texture : (3,) share of the light that passes straight through, and
        what to add to it where it varies.
    closures : what else reflects or lets light through.
    normal : what the shading normal is in place of the mesh's, of any length.
    holdout, holdout_texture : (3,) share of the view that is neither light nor alpha, and what to
        add to it where it varies.
    held_out : whether that is all that the camera sees of it, and of what it does not let pass.
    glass : whether light passes it bent: not as direct light.
    measured : whether it is known only where the camera looks first, through `Scene.measured`.
    unsupported : what of it the estimator cannot evaluate; camera hits on it are excluded.
    emission_known : False when it emits in a way that is not known: points that it may reach are
        excluded.
    """

    name: str
    albedo: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    opaque: bool = True
    transmittance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_known: bool = True
    unsupported: tuple[Unsupported, ...] = ()
    albedo_texture: Expression | None = None
    emission_texture: Expression | None = None
    transmittance_texture: Expression | None = None
    closures: tuple[Closure, ...] = ()
    normal: Expression | None = None
    holdout: tuple[float, float, float] = (0.0, 0.0, 0.0)
    holdout_texture: Expression | None = None
    held_out: bool = False
    glass: bool = False
    measured: bool = False

    @property
    def emits(self) -> bool:
        return self.emission_texture is not None or any(self.emission)

    @property
    def passes(self) -> bool:
        """Whether light may pass it straight."""
        return self.transmittance_texture is not None or any(self.transmittance)


@dataclass(frozen=True)
class Mesh:
    """Triangles in object space; shared by all instances that show it.

    Attributes
    ----------
    vertices : (n, 3) float32 [bu].
    triangles : (m, 3) int32 vertex indices, counter-clockwise seen from the front.
    normals : (m, 3, 3) float32 unit shading normals by corner, or None when all is flat.
    smooth : (m,) bool, faces shaded smooth (Cycles' shadow terminator offset acts on them alone).
    slots : (m,) int32 material slot of each triangle.
    attributes : by name, (m, 3, k) float32 at the corners: UV maps, colours, and what else there
        is; ``textures.UV`` is the UV map that renders take, and ``textures.GENERATED``, where it is
        not the place in the texture space.
    texture_space : centre and half size (3,) of Generated coordinates, None if not known.
    """

    name: str
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float32] | None
    smooth: NDArray[np.bool_]
    slots: NDArray[np.int32]
    attributes: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    texture_space: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class Instance:
    """A mesh placed in the world.

    Attributes
    ----------
    name : name of the object it comes from.
    mesh : index into `Scene.meshes`.
    world_from_object : (4, 4) float64.
    materials : index into `Scene.materials` for each slot of the mesh.
    visible_camera, visible_shadow : ray visibility.
    visible_diffuse, visible_glossy, visible_transmission : kinds of lobes that its emission lights.
    terminator_geometry_offset, terminator_shading_offset : Cycles' shadow terminator settings.
    normals_in_world : whether Cycles moves the shading normals to the world, and makes them unit
        length there, before it interpolates them (meshes with a single user); else after.
    proxy : True when the mesh only bounds something that cannot be read (hair, volume).
    """

    name: str
    mesh: int
    world_from_object: NDArray[np.float64]
    materials: tuple[int, ...]
    visible_camera: bool = True
    visible_shadow: bool = True
    visible_diffuse: bool = True
    visible_glossy: bool = True
    visible_transmission: bool = True
    terminator_geometry_offset: float = 0.0
    terminator_shading_offset: float = 0.0
    normals_in_world: bool = True
    proxy: bool = False


class Linking(NamedTuple):
    """What a light is for, by instance; the last of each is for what is none (a meter).

    Attributes
    ----------
    lit, shadowing : (instances + 1,) bool, what it lights, and what can hide it.
    """

    lit: NDArray[np.bool_]
    shadowing: NDArray[np.bool_]


@dataclass(frozen=True)
class Aperture:
    """The opening of a thin lens.

    Attributes
    ----------
    radius : [bu] of a disc, or of the circle around a polygon of 3 `blades` or more.
    focus : distance [bu] at which the picture is sharp, along the view axis or, in panoramas, from
        the camera.
    rotation : of the polygon [rad].
    ratio : of its height to its width.
    """

    radius: float
    focus: float
    blades: int = 0
    rotation: float = 0.0
    ratio: float = 1.0


@dataclass(frozen=True)
class Camera:
    """A camera that looks along its local -Z.

    A picture position (x, y) in pixels, x right and y up from the lower left corner of the full
    frame, maps linearly to the plane z = -1 (perspective), to ray origins on z = 0 (orthographic)
    or to the place (u, v) in a panorama: ``x_plane = plane[0] + x / width * (plane[1] -
    plane[0])`` and likewise with plane[2:4] for y.

    Attributes
    ----------
    kind : perspective, orthographic, or Blender's name of a panorama in small letters.
    world_from_camera : (4, 4) float64 without scale.
    plane : (left, right, bottom, top) of the full frame: tangents for perspective, [bu] for
        orthographic, 0 to 1 in panoramas. Sensor fit, shift and pixel aspect are already in it.
    clip : (near, far) [bu] along the view axis, in panoramas along the ray.
    lens : of panoramas: least and greatest longitude and latitude [rad], of a cylinder least and
        greatest longitude [rad] and height over radius; of fisheyes what its curve needs (nothing,
        focal length, or coefficients), field of view [rad] and the sensor's width and height, or
        2, 2.
    aperture : None where all is sharp.
    """

    name: str
    kind: str
    world_from_camera: NDArray[np.float64]
    plane: tuple[float, float, float, float]
    clip: tuple[float, float]
    unsupported: tuple[Unsupported, ...] = ()
    lens: tuple[float, ...] = ()
    aperture: Aperture | None = None


@dataclass(frozen=True)
class World:
    """A background: uniform, or the sum of maps by direction.

    Attributes
    ----------
    radiance : (3,) [W/(m² sr)] from everywhere.
    maps : what is not uniform of it.
    visible_camera, visible_diffuse, visible_glossy, visible_transmission : what it is seen by.
    known : False when it is not readable: what it may reach is excluded.
    """

    radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    maps: tuple[SkyMap, ...] = ()
    visible_camera: bool = True
    visible_diffuse: bool = True
    visible_glossy: bool = True
    visible_transmission: bool = True
    known: bool = True
    unsupported: tuple[Unsupported, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Everything that direct light depends on.

    Attributes
    ----------
    lights : native lights; the estimator adds the mesh emitters and the world.
    unknown_lights : light objects whose emission is not known, in their place and shape; what
        they may reach is excluded.
    light_records : all light objects as Blender has them, also those that emit nothing.
    linking : of the lights of these names; all others light everything.
    resolution : (width, height) of the full frame in pixels.
    border : (x0, y0, x1, y1) in pixels from the lower left, the part that is rendered; outside it
        pixels are 0.
    film_transparent : alpha is 0 where the world shows.
    luminance_weights : of the working space.
    transparent_max_bounces : surfaces that light passes straight through, as Cycles counts them.
    measured : (slots, k height, k width, 3) what Blender's nodes give at the middle of each k-th of
        a pixel, row 0 at the top; None where no material needs it.
    """

    file: str
    sha256: str
    frame: int
    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    world: World
    camera: Camera | None
    resolution: tuple[int, int]
    border: tuple[int, int, int, int] | None = None
    film_transparent: bool = False
    unit_scale_m: float = 1.0
    model: Model = "cycles"
    shading: Literal["full", "clay"] = "full"
    working_space: str = "Linear Rec.709"
    chromaticities: tuple[float, ...] = REC709
    luminance_weights: tuple[float, float, float] = luminance_weights(REC709)
    blender_version: tuple[int, int, int] = (0, 0, 0)
    transparent_max_bounces: int = 8
    measured: NDArray[np.float32] | None = None
    unknown_lights: tuple[Light, ...] = ()
    light_records: tuple[LightRecord, ...] = ()
    linking: Mapping[str, Linking] = field(default_factory=dict[str, Linking])
    unsupported: tuple[Unsupported, ...] = ()
    findings: tuple[Finding, ...] = ()
