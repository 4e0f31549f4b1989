# SPDX-License-Identifier: GPL-3.0-or-later
"""A world's radiance by direction, as its node tree gives it: data of the scene, not light.

Where all nodes are known they are evaluated, in the middle of each texel. Else a copy of the world
alone is shown to a panoramic camera of Cycles, the only one that knows every node, with a ray
through the middle of each pixel. An image stands in the map texel on texel, the
camera turned as its Mapping node turns it; then both are bilinear between the same values. The
discs that Sky Textures have for suns are taken out of the sky and measured apart, close up.
"""

import math
import pickle
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from ..arrays import Singles
from ..lights import SkyMap
from ..lights._environment import WHOLE
from ..textures import Context, Expression
from . import nodes
from .expressions import behind, plain_properties
from .witness import CyclesWitness

Look = Callable[..., Singles]

WIDTH, WIDEST = 2048, 8192  # of a map, in texels
DISC = 256  # texels across a sun
MARGIN = 1.05  # around it
BATCH = 1 << 19  # directions at once
_AS_IT_IS = {"Background", "TexEnvironment", "TexCoord", "Mapping", "Value", "RGB"}
# From the map's axes, x ahead and z up, to those of a Blender camera, which looks along its -z.
_CAMERA_FROM_MAP = Matrix(((0, -1, 0), (0, 0, 1), (-1, 0, 0)))
_BEYOND_DIRECTION = {
    ("ShaderNodeLightPath", ""): "Light Path",
    ("ShaderNodeCameraData", ""): "Camera Data",
    ("ShaderNodeScript", ""): "Script",
    ("ShaderNodeTexCoord", "Camera"): "Camera coordinates",
    ("ShaderNodeTexCoord", "Window"): "Window coordinates",
}


def unmeasurable(bl_world: Any) -> str | None:
    """Return what in the world's nodes cannot be had by looking in all directions."""
    for output, _ in _behind(bl_world):
        for name in ("", output.name):
            if known := _BEYOND_DIRECTION.get((output.node.bl_idname, name)):
                return known
    return None


def measure_sky(bl_world: Any, frame: tuple[int, float]) -> tuple[SkyMap, ...]:
    """Return maps whose sum is the radiance of `bl_world` at a frame and subframe."""
    with _stage(bl_world, frame) as (world, look):
        textures = {o.node.as_pointer(): (o.node, turn) for o, turn in _behind(world)}.values()
        discs = [node for node, _ in textures if _has_disc(node)]
        for sky in discs:
            sky.sun_disc = False
        try:
            return (_whole(look, list(textures)), *(_disc(look, sky) for sky in discs))
        finally:  # node groups are not the copy's own
            for sky in discs:
                sky.sun_disc = True


def measure_file(file: str, name: str, frame: tuple[int, float], space: str, out: str) -> None:
    """Measure a world of a file for another Blender: `out` pickles what each `SkyMap` is of."""
    if bpy.app.version >= (5, 0):
        operators: Any = bpy.ops.wm
        operators.set_working_color_space(working_space=space, convert_colors=False)
    libraries: Any = bpy.data.libraries
    with libraries.load(file) as (_, wanted):
        wanted.worlds = [name]
    maps = measure_sky(wanted.worlds[0], frame)
    parts = [(each.radiance, each.map_from_world, each.half) for each in maps]
    Path(out).write_bytes(pickle.dumps(parts))


def contents(block: Any, frame: float) -> tuple[Any, ...]:
    """Return all that the node tree of an evaluated block computes with, as plain data.

    Pictures count by their names and files; `frame` does where they move.
    """
    tree = block.node_tree
    links = [
        (a.node.name, a.identifier, b.node.name, b.identifier, link.is_muted)
        for link in tree.links
        if (a := link.from_socket) and (b := link.to_socket)
    ]
    return links, [_computes(node, frame) for node in tree.nodes]


def _computes(node: Any, frame: float) -> tuple[Any, ...]:
    found = [node.bl_idname, node.name, node.mute, plain_properties(node)]
    found += [plain_properties(socket) for socket in (*node.inputs, *node.outputs)]
    if getattr(node, "texture_mapping", None):
        found.append(plain_properties(node.texture_mapping))
    if ramp := getattr(node, "color_ramp", None):
        found += [plain_properties(ramp), *map(plain_properties, ramp.elements)]
    if hasattr(node, "mapping") and hasattr(node.mapping, "curves"):
        found += [plain_properties(p) for curve in node.mapping.curves for p in curve.points]
    if image := getattr(node, "image", None):
        moves = image.source in {'MOVIE', 'SEQUENCE'}
        found += [image.name, image.filepath, tuple(image.size), moves and frame]
    if getattr(node, "node_tree", None):
        found.append(contents(node, frame))
    return tuple(found)


def _has_disc(node: Any) -> bool:
    """Tell whether it draws a sun: such a Sky Texture takes no coordinates."""
    models = ("PREETHAM", "HOSEK_WILKIE")
    return getattr(node, "sun_disc", False) and node.sky_type not in models


def known_sky(bl_world: Any, radiance: Expression) -> SkyMap:
    """Return the map of what an expression gives by direction."""
    behind = [(output.node, turn) for output, turn in _behind(bl_world)]
    turn, (width, height), finer, image = _grid(behind)
    axes, tall = np.array(turn), height * finer
    texels = np.empty((height, width, 3), dtype=np.float32)
    direct = image and image.interpolation in {'Linear', 'Closest'} and _lookup(radiance)
    azimuth = np.pi * (1.0 - 2.0 * (np.arange(width * finer) + 0.5) / (width * finer))
    rows = max(1, BATCH // (width * finer**2))
    for first in range(0, height, rows):
        last = min(first + rows, height)
        row = np.arange(first * finer, last * finer)
        elevation = 0.5 * np.pi * (1.0 - 2.0 * (row + 0.5) / tall)[:, None]
        level = np.cos(elevation)
        local = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        stacked = np.stack(np.broadcast_arrays(*local), axis=-1, dtype=np.float64)
        wi = stacked.reshape(-1, 3) @ axes
        context = Context(position=wi, normal=-wi, geometric=-wi, incoming=-wi)
        if direct:  # texel on texel
            pixels = direct.settings["pixels"][tall - 1 - row, :, :3].reshape(-1, 3) / 1.0
            context.known[id(direct)] = pixels
        found = radiance.rgb(context, len(wi)).reshape(last - first, finer, width, finer, 3)
        texels[first:last] = found.mean(axis=(1, 3))
    return SkyMap(texels, axes)


def _lookup(found: Expression) -> Expression | None:
    """Return the only environment in an expression, as its pixels are linear."""
    all_of = [found]
    for each in all_of:
        all_of += each.inputs.values()
    images = {id(e): e for e in all_of if e.kind == "ShaderNodeTexEnvironment"}
    (image, *more) = images.values()
    plain = "pixels" in image.settings and image.settings["pixels"].dtype == np.float32
    return image if plain and not more else None


def _whole(look: Look, textures: list[tuple[Any, Matrix | None]]) -> SkyMap:
    turn, size, coarser, _ = _grid(textures)
    return SkyMap(look(turn, WHOLE, size, coarser**2), np.array(turn))


def _grid(textures: list[tuple[Any, Matrix | None]]) -> tuple[Matrix, tuple[int, int], int, Any]:
    """Return axes and size of a map of all directions, as fine as the finest image.

    Also how many texels of that fineness are one of the map's along a side, and the texture whose
    image stands in it texel on texel, if one does.
    """
    images = [(n, turn) for n, turn in textures if getattr(n, "image", None)]
    images.sort(key=lambda image: -int(image[0].image.size[0]))
    node, turn = images[0] if images else (None, None)
    width, height = node.image.size if node else (0, 0)
    turns = [other for _, other in images]
    finer = 1
    if (
        node
        and turn
        and width
        and turns.count(turn) == len(turns)
        and node.projection == 'EQUIRECTANGULAR'
    ):
        kinds = {n.bl_idname.removeprefix("ShaderNode") for n, _ in textures}
        finer = 1 if kinds <= _AS_IT_IS else math.ceil(WIDTH / width) | 1  # odd: texels stay
        size = (finer * width, finer * height)
    else:
        width, turn, node = max(2 * width, 4 * height, WIDTH), Matrix.Identity(3), None
        size = (width, width // 2)
    coarser = math.ceil(size[0] / WIDEST)
    size = (size[0] // coarser, size[1] // coarser)
    return turn, size, coarser, node if finer == coarser == 1 else None


def _disc(look: Look, sky: Any) -> SkyMap:
    """Return the window of a Sky Texture's sun with nothing but the sun in it."""
    up, across = math.sin(sky.sun_elevation), math.cos(sky.sun_elevation)
    sun = Vector((across * math.sin(sky.sun_rotation), across * math.cos(sky.sun_rotation), up))
    axes = sun.to_track_quat('X', 'Z').to_matrix().transposed()
    half = MARGIN * 0.5 * sky.sun_size
    without = look(axes, (half, half), (DISC, DISC))
    sky.sun_disc = True
    disc = look(axes, (half, half), (DISC, DISC)) - without
    sky.sun_disc = False
    return SkyMap(disc, np.array(axes), (half, half))


@contextmanager
def _stage(bl_world: Any, frame: tuple[int, float]) -> Generator[tuple[Any, Look]]:
    """Give a copy of the world, alone in a scene, and what renders it."""
    data: Any = bpy.data
    scene, camera, world = data.scenes.new("Sky"), data.cameras.new("Sky"), bl_world.copy()
    scene.camera = eye = data.objects.new("Sky", camera)
    scene.collection.objects.link(eye)
    scene.world = world
    scene.frame_set(frame[0], subframe=frame[1])
    world.cycles.sampling_method, world.cycles_visibility.camera = 'NONE', True
    camera.type, camera.panorama_type = 'PANO', 'EQUIRECTANGULAR'

    def look(
        axes: Matrix, half: tuple[float, float], size: tuple[int, int], samples: int = 1
    ) -> Singles:
        camera.longitude_min, camera.longitude_max = -half[0], half[0]
        camera.latitude_min, camera.latitude_max = -half[1], half[1]
        eye.matrix_world = (_CAMERA_FROM_MAP @ axes).transposed().to_4x4()
        cycles = CyclesWitness(scene, resolution=size)
        cycles.prepare()
        scene.render.use_persistent_data = False
        if samples == 1:
            scene.cycles.pixel_filter_type, scene.cycles.filter_width = 'GAUSSIAN', 0.01
        return cycles.render(0, samples)[..., :3].copy()

    try:
        yield world, look
    finally:
        data.scenes.remove(scene)
        data.objects.remove(eye)
        data.cameras.remove(camera)
        data.worlds.remove(world)


def _behind(bl_world: Any) -> Iterator[tuple[Any, Matrix | None]]:
    """Yield each output that feeds the surface, with how its node's coordinates are turned."""
    end = bl_world.node_tree.get_output_node("CYCLES")
    for output, groups in behind(end.inputs["Surface"]) if end else ():
        vector = output.node.inputs.get("Vector")
        yield output, _turn(vector, groups) if vector else Matrix.Identity(3)


def _turn(vector: Any, groups: nodes.Groups) -> Matrix | None:
    """Return the rotation from directions to a texture's coordinates, None where it is more."""
    found = nodes.source(vector, groups)
    if found.output is None:
        return Matrix.Identity(3)
    node, groups = found.output.node, found.groups
    if (node.bl_idname, found.output.name) == ("ShaderNodeTexCoord", "Generated"):
        return Matrix.Identity(3)
    if node.bl_idname != "ShaderNodeMapping":
        return None
    before = _turn(node.inputs["Vector"], groups)
    others = [socket for socket in node.inputs if socket.enabled and socket.name != "Vector"]
    ends = {socket.name: nodes.source(socket, groups) for socket in others}
    if before is None or any(end.output for end in ends.values()):
        return None
    values = {name: tuple(end.socket.default_value) for name, end in ends.items()}
    if values["Scale"] != (1, 1, 1) or any(values.get("Location", ())):
        return None
    turn = Euler(values["Rotation"]).to_matrix()
    return (turn.transposed() if node.vector_type == 'TEXTURE' else turn) @ before
