# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray casting: Embree through embreex, with instances, and nothing else.

embreex casts batches of rays without the GIL but has no instances. Embree's own C interface, which
lies in the library that embreex ships, has them; so meshes and instances are built through it
(`_embree`, by ctypes) and rays are cast by embreex. A hit reports mesh and triangle but not the
instance, which is then asked for in packets of 16, and only where a mesh has several.

Rays are float32. A hit point is therefore never taken from a distance: it is computed in float64
from the triangle and its barycentric coordinates.
"""

from __future__ import annotations

import ctypes
import functools
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arrays import Bools, Floats, Indices, Ints, Singles
from .scene import Instance, Mesh

# Embree 4's constants, from its public headers.
_TRIANGLE, _INSTANCE = 0, 121  # RTCGeometryType
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1  # RTCBufferType
_UINT3, _FLOAT3, _FLOAT3X4_ROW = 0x5003, 0x9003, 0x9134  # RTCFormat
_ROBUST = 4  # RTC_SCENE_FLAG_ROBUST: watertight at edges
_PADDING_VERTICES = 2  # Embree reads 16 bytes at the last vertex of 12
_LANES = 16
_FLOATS, _VECTORS, _NUMBERS = ("f4", _LANES), ("f4", (3, _LANES)), ("i4", _LANES)
_RAY_HIT = np.dtype(  # RTCRayHit16
    [("org", *_VECTORS), ("tnear", *_FLOATS), ("dir", *_VECTORS)]
    + [(name, *_FLOATS) for name in ("time", "tfar")]
    + [(name, *_NUMBERS) for name in ("mask", "id", "flags")]
    + [("Ng", *_VECTORS), ("u", *_FLOATS), ("v", *_FLOATS)]
    + [(name, *_NUMBERS) for name in ("primID", "geomID", "instID", "instPrimID")]
)

_DEVICE_FIELDS_BYTES = 8  # embreex's EmbreeDevice: a handle
_SCENE_FIELDS_BYTES = 24  # embreex's EmbreeScene: a handle, a flag, a device
_FAR = 1e37


class Hits(NamedTuple):
    """What rays (n,) hit first; -1 and inf where they hit nothing."""

    instance: Ints  # index into the instances that the caster was built from
    triangle: Ints  # index into the triangles of the instance's mesh
    u: Floats  # barycentric weights of the triangle's second and third corner
    v: Floats
    distance: Floats  # in units of the direction's length

    def take(self, rows: Ints) -> Hits:
        """Return the hits of the rays `rows` (k,) alone."""
        return Hits._make(part.take(rows) for part in self)


@functools.cache
def _embree() -> ctypes.CDLL:
    """Return Embree's C interface: the few functions that embreex leaves out."""
    lib = _library()
    pointer, uint, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "rtcNewScene": (pointer, [pointer]),
        "rtcSetSceneFlags": (None, [pointer, uint]),
        "rtcCommitScene": (None, [pointer]),
        "rtcReleaseScene": (None, [pointer]),
        "rtcNewGeometry": (pointer, [pointer, uint]),
        "rtcCommitGeometry": (None, [pointer]),
        "rtcReleaseGeometry": (None, [pointer]),
        "rtcAttachGeometryByID": (None, [pointer, pointer, uint]),
        "rtcSetNewGeometryBuffer": (pointer, [pointer, uint, uint, uint, size, size]),
        "rtcSetGeometryInstancedScene": (None, [pointer, pointer]),
        "rtcSetGeometryTransform": (None, [pointer, uint, uint, pointer]),
        "rtcIntersect16": (None, [pointer, pointer, pointer, pointer]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


def _library() -> ctypes.CDLL:
    """Return the Embree that embreex's own calls end up in.

    On Linux that is the program's, where it has one (Blender): its symbols come first. Objects of
    one library in the hands of another hang.
    """
    program = ctypes.CDLL(None) if sys.platform == "linux" else None
    if program is not None and hasattr(program, "rtcCommitScene"):
        return program
    import embreex

    package = Path(embreex.__file__).parent
    folders = (package.parent / "embreex.libs", package / ".dylibs", package)
    patterns = ("libembree4*", "embree4*.dll")
    found = [path for f in folders for pattern in patterns for path in sorted(f.glob(pattern))]
    if not found:
        raise ImportError(f"no Embree library beside {package}; reinstall embreex")
    return ctypes.CDLL(str(found[0]))


def embree_version() -> str:
    """Return Embree's version, such as '4.4.0'."""
    return repr(_device()).rsplit(" ", 1)[-1]


@functools.cache
def _device() -> Any:
    """Return embreex's device, one for all scenes: some 1 100 of them end a program."""
    from embreex.rtcore import EmbreeDevice

    return _known(EmbreeDevice, _DEVICE_FIELDS_BYTES)()


class Caster:
    """Casts rays against the `chosen` ones of a scene's instances.

    A mesh with a single user becomes triangles in world space in the top-level scene, as Cycles'
    static BVH has it; a shared mesh becomes one Embree scene and an Embree instance for each user.
    Geometry numbers: an instance's own index for the former and for Embree instances, and the mesh
    index after all of these for the triangles inside a shared mesh.
    """

    def __init__(
        self, meshes: Sequence[Mesh], instances: Sequence[Instance], chosen: Sequence[int]
    ) -> None:
        from embreex.rtcore_scene import EmbreeScene

        self._scene = _known(EmbreeScene, _SCENE_FIELDS_BYTES)(_device(), robust=True)
        self._handle = _handle(self._scene)
        self._own: list[int] = []  # scenes of shared meshes, to be released
        self.count = len(chosen)
        users = Counter(instances[index].mesh for index in chosen)
        shared = {
            mesh: self._shared_scene(meshes[mesh], len(instances) + mesh)
            for mesh, count in users.items()
            if count > 1
        }
        for index in chosen:
            instance = instances[index]
            if instance.mesh in shared:
                self._attach_instance(shared[instance.mesh], instance.world_from_object, index)
            else:
                mesh = meshes[instance.mesh]
                world = transform_points(instance.world_from_object, mesh.vertices)
                self._attach_triangles(self._handle, world, mesh.triangles, index)
        _embree().rtcCommitScene(self._handle)
        self._scene.is_committed = 1
        self._first_shared = len(instances)

    def _attach_triangles(
        self, scene: int, vertices: NDArray[Any], triangles: Indices, number: int
    ) -> None:
        rtc = _embree()
        geometry = rtc.rtcNewGeometry(_handle(_device()), _TRIANGLE)
        padded = np.pad(vertices.astype(np.float32), ((0, _PADDING_VERTICES), (0, 0)))
        corners = np.ascontiguousarray(triangles, dtype=np.uint32)
        buffers = (_VERTEX_BUFFER, _FLOAT3, padded), (_INDEX_BUFFER, _UINT3, corners)
        for buffer, form, values in buffers:
            room = rtc.rtcSetNewGeometryBuffer(geometry, buffer, 0, form, 12, len(values))
            ctypes.memmove(room, values.ctypes.data, values.nbytes)
        self._attach(scene, geometry, number)

    def _attach_instance(self, mesh_scene: int, world_from_object: Floats, number: int) -> None:
        rtc = _embree()
        geometry = rtc.rtcNewGeometry(_handle(_device()), _INSTANCE)
        rtc.rtcSetGeometryInstancedScene(geometry, mesh_scene)
        rows = np.ascontiguousarray(world_from_object[:3], dtype=np.float32)
        rtc.rtcSetGeometryTransform(geometry, 0, _FLOAT3X4_ROW, rows.ctypes.data)
        self._attach(self._handle, geometry, number)

    @staticmethod
    def _attach(scene: int, geometry: int, number: int) -> None:
        rtc = _embree()
        rtc.rtcCommitGeometry(geometry)
        rtc.rtcAttachGeometryByID(scene, geometry, number)
        rtc.rtcReleaseGeometry(geometry)

    def _shared_scene(self, mesh: Mesh, number: int) -> int:
        rtc = _embree()
        scene: int = rtc.rtcNewScene(_handle(_device()))
        self._own.append(scene)
        rtc.rtcSetSceneFlags(scene, _ROBUST)
        self._attach_triangles(scene, mesh.vertices, mesh.triangles, number)
        rtc.rtcCommitScene(scene)
        return scene

    def __del__(self) -> None:
        for scene in getattr(self, "_own", ()):
            _embree().rtcReleaseScene(scene)

    def occluded(self, origins: Floats, directions: Floats, distances: Floats) -> Bools:
        """Return (n,) whether anything lies within `distances` (n,) along the rays."""
        if not self.count or not len(origins):
            return np.zeros(len(origins), dtype=bool)
        answer = self._scene.run(
            origins.astype(np.float32),
            directions.astype(np.float32),
            dists=np.minimum(distances, _FAR).astype(np.float32),
            query="OCCLUDED",
        )
        return np.asarray(answer == 0)

    def intersect(self, origins: Floats, directions: Floats) -> Hits:
        """Return the nearest hits of rays from `origins` (n, 3) along `directions` (n, 3)."""
        n = len(origins)
        if not self.count or not n:
            nothing = np.full(n, -1)
            return Hits(nothing, nothing, np.zeros(n), np.zeros(n), np.full(n, np.inf))
        origins32, directions32 = origins.astype(np.float32), directions.astype(np.float32)
        hits = _hits(self._scene.run(origins32, directions32, output=True))
        shared = np.flatnonzero(hits.instance >= self._first_shared)
        if len(shared):
            again = self._intersect_packets(origins32[shared], directions32[shared])
            for mine, theirs in zip(hits, again, strict=True):
                mine[shared] = theirs
        return hits

    def _intersect_packets(self, origins: Singles, directions: Singles) -> Hits:
        """Cast rays 16 at a time: slower than embreex, but it tells the instance."""
        n, packets = len(origins), -(-len(origins) // _LANES)
        rays = _aligned_zeros(packets, _RAY_HIT)
        for field, values in (("org", origins), ("dir", directions)):
            lanes = np.resize(values, (packets, _LANES, 3))
            rays[field] = lanes.swapaxes(1, 2)
        rays["tfar"] = _FAR
        for field in ("mask", "primID", "geomID", "instID", "instPrimID"):
            rays[field] = -1
        valid = _aligned_zeros(_LANES, np.dtype(np.int32))
        valid[:] = -1
        cast, lane_flags = _embree().rtcIntersect16, valid.ctypes.data
        start, step = rays.ctypes.data, rays.strides[0]
        for address in range(start, start + packets * step, step):
            cast(lane_flags, self._handle, address, None)
        own = rays["instID"]
        rays["geomID"] = np.where(own < 0, rays["geomID"], own)
        names = ("geomID", "primID", "u", "v", "tfar")
        return _hits({name: rays[name].reshape(-1)[:n] for name in names})


def _hits(found: Mapping[str, NDArray[Any]]) -> Hits:
    """Return hits by Embree's names of their fields."""
    return Hits(
        found["geomID"].astype(np.int64),
        found["primID"].astype(np.int64),
        found["u"].astype(np.float64),
        found["v"].astype(np.float64),
        np.where(found["geomID"] >= 0, found["tfar"], np.inf).astype(np.float64),
    )


def transform_points(matrix: Floats, points: NDArray[Any]) -> Floats:
    """Return `points` (n, 3) moved by the affine `matrix` (4, 4)."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _known(wrapper: type[Any], fields_bytes: int) -> type[Any]:
    """Return embreex's `wrapper`, whose first field is to be read; ImportError if it is another."""
    if wrapper.__basicsize__ != object.__basicsize__ + fields_bytes:
        raise ImportError(f"this embreex lays out its {wrapper.__name__} in a way not known here")
    return wrapper


def _handle(wrapper: Any) -> int:
    """Return the C handle that an embreex scene or device wraps: its first field."""
    return ctypes.c_void_p.from_address(id(wrapper) + object.__basicsize__).value or 0


def _aligned_zeros(count: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return zeros that start at a multiple of 64 bytes, as packets must."""
    raw = np.zeros(count * kind.itemsize + 64, dtype=np.uint8)
    skip = -raw.ctypes.data % 64
    return raw[skip : skip + count * kind.itemsize].view(kind)
