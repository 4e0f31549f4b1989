# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the reader's tests, and Cycles' own view of them."""

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from blender_rad.bpy_io.quiet import quiet_stdout

Array = NDArray[np.float64]
SQUARE = ([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)])
CUBE = (
    [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
)


def empty_scene() -> Any:
    with quiet_stdout():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return bpy.context.scene


def put(block: Any, **properties: Any) -> Any:
    """Set properties of a block, or of its data where that has them; return it."""
    data = getattr(block, "data", None)
    for key, value in properties.items():
        setattr(data if hasattr(data, key) else block, key, value)
    return block


def add(name: str, data: Any = None, **properties: Any) -> Any:
    created = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(created)
    return put(created, **properties)


def light(kind: str, name: str = "Lamp", **properties: Any) -> Any:
    return add(name, bpy.data.lights.new(name, kind), **properties)


def camera(**properties: Any) -> Any:
    """Add a camera, the scene's."""
    place = {"location": (0.3, -0.4, 6), "rotation_euler": (0.08, 0.05, 0.3)}
    created = add("Camera", bpy.data.cameras.new("Camera"), **{**place, **properties})
    bpy.context.scene.camera = created
    return created


def aimed(placed: Any, location: Any, towards: Any) -> Any:
    """Put a light or camera at a location, looking at another, z up."""
    placed.location = location
    aim = Vector(towards) - Vector(location)
    placed.rotation_euler = aim.to_track_quat('-Z', 'Y').to_euler()
    return placed


def gathered(name: str, *members: Any, shown: bool = False) -> Any:
    """Move objects of the scene into a new collection, which is shown by itself, or not."""
    created, top = bpy.data.collections.new(name), bpy.context.scene.collection
    for member in members:
        top.objects.unlink(member)
        created.objects.link(member)
    if shown:
        top.children.link(created)
    return created


def instanced(places: Iterable[Any], *members: Any) -> list[Any]:
    """Show objects of the scene at places instead of at their own; return the empties there."""
    source = gathered("Source", *members)
    shown = {"instance_type": 'COLLECTION', "instance_collection": source}
    return [add(f"Host {k}", location=place, **shown) for k, place in enumerate(places)]


def with_nodes(block: Any) -> Any:
    """Return the node tree of a block, which has one from birth in Blender 5."""
    if block.node_tree is None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            block.use_nodes = True
    return block.node_tree


def node(tree: Any, kind: str, *sources: Any, **values: Any) -> Any:
    """Add a node, of shaders where its kind says no more.

    Into its first inputs go numbers, sockets, or first outputs of nodes; values are those of
    inputs, or of its settings where it has no such input.
    """
    created = tree.nodes.new(kind if "Node" in kind else f"ShaderNode{kind}")
    for key, value in values.items():
        socket = created.inputs.get(key.replace("_", " "))
        if socket is None:
            setattr(created, key, value)
        else:
            colour = socket.type == 'RGBA' and len(value) == 3
            socket.default_value = (*value, 1.0) if colour else value
    for socket, source in zip(created.inputs, sources, strict=False):
        if isinstance(source, (int, float)):
            socket.default_value = source
        else:
            tree.links.new(getattr(source, "outputs", [source])[0], socket)
    return created


def shows(tree: Any, source: Any, socket: str = "Surface") -> None:
    tree.links.new(source.outputs[0], tree.get_output_node('CYCLES').inputs[socket])


def material(name: str, kind: str | Callable[[Any], Any], **values: Any) -> Any:
    """A material of one closure node, or of what a function of its tree returns."""
    created = bpy.data.materials.new(name)
    tree = with_nodes(created)
    tree.nodes.clear()
    node(tree, "OutputMaterial")
    shows(tree, kind(tree) if callable(kind) else node(tree, kind, **values))
    return created


def added(created: Any, other: str, **values: Any) -> Any:
    """Add another closure to what a material shows; return the sum."""
    tree = created.node_tree
    shown = tree.get_output_node('CYCLES').inputs[0].links[0].from_socket
    both = node(tree, "AddShader", shown, node(tree, other, **values))
    shows(tree, both)
    return both


def world(name: str = "World", **values: Any) -> Any:
    """A world of one Background node for the scene."""
    created = bpy.context.scene.world = bpy.data.worlds.new(name)
    for key, value in values.items():
        with_nodes(created).nodes["Background"].inputs[key].default_value = value
    return created


def geometry_nodes(host: Any, kind: str, **inputs: Any) -> Any:
    """Replace what a mesh object shows by what a node gives; return the node and its tree."""
    tree = bpy.data.node_groups.new(kind, 'GeometryNodeTree')
    for direction in ('INPUT', 'OUTPUT'):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type='NodeSocketGeometry')
    made = node(tree, kind, **inputs)
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(next(s for s in made.outputs if s.type == 'GEOMETRY'), output.inputs[0])
    host.modifiers.new(kind, 'NODES').node_group = tree
    return tree, made


def polygons(name: str, vertices: Any, faces: Any, shown: Any = None) -> Any:
    """A mesh of a material, or of Lambert: glossy closures would bend Cycles' Normal pass."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(shown or material(name, "BsdfDiffuse"))
    return mesh


def sphere(name: str, segments: int = 12, rings: int = 7) -> Any:
    """A smooth UV sphere of radius 1, coarse on purpose."""
    return rounded(name, "uvsphere", u_segments=segments, v_segments=rings)


def rounded(name: str, kind: str, **options: Any) -> Any:
    """A smooth mesh of radius 1 that bmesh can make, of Lambert."""
    import bmesh  # which bpy brings

    built, mesh = bmesh.new(), polygons(name, [], [])
    getattr(bmesh.ops, f"create_{kind}")(built, radius=1.0, **options)
    built.to_mesh(mesh)
    built.free()
    mesh.shade_smooth()
    return mesh


def channels(path: Path) -> dict[str, Array]:
    """Return the channels (h, w) of a file by the end of their names: view layers do not count."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            name.partition("ViewLayer.")[2] or name: np.array(channel.pixels, dtype=float)
            for part in file.parts
            for name, channel in part.channels.items()
        }


def cycles_passes(path: Path) -> dict[str, Array]:
    """Return Cycles' passes of the scene at the pixel centres by name, (h, w, ...)."""
    scene, render = bpy.context.scene, bpy.context.scene.render
    render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.filter_width = 1, 0.01
    scene.cycles.use_denoising = False
    layer = scene.view_layers[0]
    layer.use_pass_position = layer.use_pass_normal = layer.use_pass_z = True
    render_layers(path / "passes.exr")
    found = channels(render.filepath)
    for name in ("Position", "Normal"):
        found[name] = np.stack([found[f"{name}.{axis}"] for axis in "XYZ"], axis=-1)
    return {**found, "Depth": found["Depth.Z"]}


def render_layers(path: Path) -> None:
    """Render all passes of the scene into one EXR file."""
    render = bpy.context.scene.render
    settings, render.filepath = render.image_settings, str(path)
    if hasattr(settings, "media_type"):
        settings.media_type = 'MULTI_LAYER_IMAGE'
    settings.file_format, settings.color_depth = 'OPEN_EXR_MULTILAYER', '32'
    with quiet_stdout():
        bpy.ops.render.render(write_still=True)
