# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as plain arrays: what `bpy_io` makes, the estimator reads, and tests build by hand.

Positions are in Blender units ("bu") along the world axes; `Scene.unit_scale_m` turns them into
metres where something is reported. Colours are scene-linear triples of the file's working space.
Nothing here knows of Blender; everything can be pickled.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from .arrays import Bools, Floats, Indices, Singles
from .errors import Finding
from .lights import Light, LightRecord, Model, SkyMap
from .textures import Expression
from .working_space import REC709, luminance_weights

RGB = tuple[float, float, float]
BLACK: RGB = (0.0, 0.0, 0.0)
CLAY_ALBEDO = 0.8


@dataclass(frozen=True)
class Unsupported:
    """Something that the estimator cannot do: recorded, excluded, counted. Never guessed."""

    kind: Literal["material", "object", "light", "world", "camera"]
    name: str
    feature: str


@dataclass(frozen=True, eq=False)
class Closure:
    """A shader node that is more than Lambert."""

    kind: str  # Blender's name of the node, registered in `bsdfs`
    weight: Expression  # factor of the mixes before it
    inputs: Mapping[str, Expression]  # by the name of the socket
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])  # by Blender's names
    normal: Expression | None = None  # what its inputs of these names say, None if not linked
    tangent: Expression | None = None


@dataclass(frozen=True)
class Material:
    """A surface: Lambert reflection, other closures, and emission from both faces.

    A ``…_texture`` is what to add to the colour of that name where it varies.
    """

    name: str
    albedo: RGB = BLACK  # Lambert reflectance, f_r = albedo/π [1/sr]
    emission: RGB = BLACK  # radiance [W/(m² sr)], from both faces
    opaque: bool = True  # False where a shadow ray may pass in a way that is not known
    transmittance: RGB = BLACK  # share of the light that passes straight through
    emission_known: bool = True  # False: points that its emission may reach are excluded
    unsupported: tuple[Unsupported, ...] = ()  # camera hits on it are excluded
    albedo_texture: Expression | None = None
    emission_texture: Expression | None = None
    transmittance_texture: Expression | None = None
    closures: tuple[Closure, ...] = ()  # what else reflects or lets light through
    normal: Expression | None = None  # in place of the mesh's shading normal, of any length
    holdout: RGB = BLACK  # share of the view that is neither light nor alpha
    holdout_texture: Expression | None = None
    held_out: bool = False  # that is all that is seen of it, and of what it does not let pass
    glass: bool = False  # light passes it bent: not as direct light
    measured: bool = False  # known only where the camera looks first, by `Scene.measured`

    @property
    def emits(self) -> bool:
        return self.emission_texture is not None or any(self.emission)

    @property
    def passes(self) -> bool:
        """Whether light may pass it straight."""
        return self.transmittance_texture is not None or any(self.transmittance)


@dataclass(frozen=True)
class Mesh:
    """Triangles in object space; shared by all instances that show it."""

    name: str
    vertices: Singles  # (n, 3) [bu]
    triangles: Indices  # (m, 3) vertices, counter-clockwise seen from the front
    normals: Singles | None  # (m, 3, 3) unit, by corner; None when all is flat
    smooth: Bools  # (m,) where Cycles' shadow terminator offset acts
    slots: Indices  # (m,) material slot of each triangle
    # UV maps, colours, and what else there is, (m, 3, k) at the corners. ``textures.UV`` is the map
    # that renders take, ``textures.GENERATED`` stands where that is not the place in the space:
    attributes: dict[str, Singles] = field(default_factory=dict)
    # Centre and half size (3,) of Generated coordinates, None if not known:
    texture_space: tuple[Floats, Floats] | None = None


@dataclass(frozen=True)
class Instance:
    """A mesh placed in the world."""

    name: str  # of the object that it comes from
    mesh: int  # index into `Scene.meshes`
    world_from_object: Floats  # (4, 4)
    materials: tuple[int, ...]  # index into `Scene.materials` for each slot of the mesh
    visible_camera: bool = True
    visible_shadow: bool = True
    visible_diffuse: bool = True  # the kinds of lobes that its emission lights
    visible_glossy: bool = True
    visible_transmission: bool = True
    terminator_geometry_offset: float = 0.0  # Cycles' settings of the shadow terminator
    terminator_shading_offset: float = 0.0
    normals_in_world: bool = True  # made unit there before interpolation (single users), or after
    proxy: bool = False  # it only bounds something that cannot be read (hair, volume)


class Linking(NamedTuple):
    """What a light is for, (instances + 1,); the last of each is for what is none (a meter)."""

    lit: Bools
    shadowing: Bools  # what can hide it


@dataclass(frozen=True)
class Aperture:
    """The opening of a thin lens."""

    radius: float  # [bu] of a disc, or of the circle around a polygon of 3 `blades` or more
    focus: float  # [bu] along the view axis, in panoramas from the camera
    blades: int = 0
    rotation: float = 0.0  # [rad] of the polygon
    ratio: float = 1.0  # of its height to its width


@dataclass(frozen=True)
class Camera:
    """A camera that looks along its local -Z.

    A picture position (x, y) in pixels, x right and y up from the lower left corner of the full
    frame, maps linearly to the plane z = -1 (perspective), to ray origins on z = 0 (orthographic)
    or to the place (u, v) in a panorama: ``x_plane = plane[0] + x / width * (plane[1] -
    plane[0])`` and likewise with plane[2:4] for y.

    `lens` is of panoramas: least and greatest longitude and latitude [rad], of a cylinder least and
    greatest longitude [rad] and height over radius; of fisheyes what its curve needs (nothing,
    focal length, or coefficients), field of view [rad] and the sensor's width and height, or 2, 2.
    """

    name: str
    kind: str  # perspective, orthographic, or Blender's name of a panorama in small letters
    world_from_camera: Floats  # (4, 4) without scale
    # Left, right, bottom, top of the full frame: tangents for perspective, [bu] for orthographic, 0
    # to 1 in panoramas. Sensor fit, shift and pixel aspect are already in it:
    plane: tuple[float, float, float, float]
    clip: tuple[float, float]  # near and far [bu] along the view axis, in panoramas along the ray
    unsupported: tuple[Unsupported, ...] = ()
    lens: tuple[float, ...] = ()
    aperture: Aperture | None = None  # None where all is sharp


@dataclass(frozen=True)
class World:
    """A background: uniform, or the sum of maps by direction."""

    radiance: RGB = BLACK  # [W/(m² sr)] from everywhere
    maps: tuple[SkyMap, ...] = ()  # what is not uniform of it
    visible_camera: bool = True
    visible_diffuse: bool = True
    visible_glossy: bool = True
    visible_transmission: bool = True
    known: bool = True  # False: what it may reach is excluded
    unsupported: tuple[Unsupported, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Everything that direct light depends on."""

    file: str = ""
    sha256: str = ""
    frame: int = 0
    meshes: tuple[Mesh, ...] = ()
    instances: tuple[Instance, ...] = ()
    materials: tuple[Material, ...] = ()
    lights: tuple[Light, ...] = ()  # native; the estimator adds mesh emitters and the world
    world: World = field(default_factory=World)
    camera: Camera | None = None
    resolution: tuple[int, int] = (1, 1)  # width and height of the full frame in pixels
    # x0, y0, x1, y1 from the lower left, the part that is rendered; outside it pixels are 0:
    border: tuple[int, int, int, int] | None = None
    film_transparent: bool = False  # alpha is 0 where the world shows
    unit_scale_m: float = 1.0
    model: Model = "cycles"
    shading: Literal["full", "clay"] = "full"
    working_space: str = "Linear Rec.709"
    chromaticities: tuple[float, ...] = REC709
    luminance_weights: tuple[float, float, float] = luminance_weights(REC709)
    blender_version: tuple[int, int, int] = (0, 0, 0)
    transparent_max_bounces: int = 8  # surfaces that light passes straight, as Cycles counts them
    # (slots, k height, k width, 3) of what Blender's nodes give at the middle of each k-th of a
    # pixel, row 0 at the top; None where no material needs it:
    measured: Singles | None = None
    unknown_lights: tuple[Light, ...] = ()  # in their place and shape; what they reach is excluded
    light_records: tuple[LightRecord, ...] = ()  # all light objects, also those that emit nothing
    linking: Mapping[str, Linking] = field(default_factory=dict[str, Linking])  # by light
    unsupported: tuple[Unsupported, ...] = ()
    findings: tuple[Finding, ...] = ()
