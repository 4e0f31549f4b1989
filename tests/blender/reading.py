# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the reader's tests, and Cycles' own view of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from blender_rad.bpy_io.quiet import quiet_stdout
from blender_rad.scene import Instance, Mesh

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


def add(name: str, data: Any, **properties: Any) -> Any:
    """Add an object with `data` to the scene."""
    created = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(created)
    for key, value in properties.items():
        setattr(created, key, value)
    return created


def light(kind: str, name: str = "Lamp", **properties: Any) -> Any:
    """Add a light."""
    data = bpy.data.lights.new(name, kind)
    for key, value in properties.items():
        setattr(data, key, value)
    return add(name, data)


def collection(name: str, *objects: tuple[str, Any]) -> Any:
    """Add a collection of new objects, each a name and its data; return it."""
    created = bpy.data.collections.new(name)
    for each in objects:
        created.objects.link(bpy.data.objects.new(*each))
    bpy.context.scene.collection.children.link(created)
    return created


def with_nodes(block: Any) -> Any:
    """Return the node tree of a block, which has one from birth in Blender 5."""
    if block.node_tree is None:
        block.use_nodes = True
    return block.node_tree


def node(tree: Any, kind: str, *sources: Any, **inputs: Any) -> Any:
    """Add a node; the first outputs of nodes, or sockets, go into its first inputs."""
    created = tree.nodes.new(kind)
    for socket, source in zip(created.inputs, sources, strict=False):
        tree.links.new(getattr(source, "outputs", [source])[0], socket)
    for key, value in inputs.items():
        created.inputs[key.replace("_", " ")].default_value = value
    return created


def material(name: str, kind: str, **inputs: Any) -> Any:
    """A material of one closure node."""
    created = bpy.data.materials.new(name)
    tree = with_nodes(created)
    tree.nodes.clear()
    node(tree, "ShaderNodeOutputMaterial", node(tree, kind, **inputs))
    return created


def added(created: Any, other: str, **inputs: Any) -> Any:
    """Add another closure to what a material shows; return the sum."""
    tree, output = created.node_tree, created.node_tree.get_output_node('CYCLES')
    shown = output.inputs[0].links[0].from_socket
    both = node(tree, "ShaderNodeAddShader", shown, node(tree, other, **inputs))
    tree.links.new(both.outputs[0], output.inputs[0])
    return both


def world(name: str = "World", **inputs: Any) -> Any:
    """A world of one Background node for the scene."""
    created = bpy.context.scene.world = bpy.data.worlds.new(name)
    for key, value in inputs.items():
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


def polygons(name: str, vertices: Any, faces: Any) -> Any:
    """A mesh of Lambert: glossy closures would bend Cycles' Normal pass."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material(name, "ShaderNodeBsdfDiffuse"))
    return mesh


def sphere(name: str, segments: int = 12, rings: int = 7) -> Any:
    """A smooth UV sphere of radius 1 without poles' fans of equal angle: coarse on purpose."""
    theta = np.pi * (np.arange(1, rings)) / rings
    phi = 2 * np.pi * np.arange(segments) / segments
    t, p = np.meshgrid(theta, phi, indexing="ij")
    ring = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    south = len(ring) + 1
    faces: list[tuple[int, ...]] = []
    for i in range(segments):
        j = (i + 1) % segments
        last = (rings - 2) * segments
        faces.append((len(ring), i, j))
        faces.append((last + i, south, last + j))
        for k in range(rings - 2):
            a = k * segments
            faces.append((a + i, a + segments + i, a + segments + j, a + j))
    mesh = polygons(name, [*ring.tolist(), (0, 0, 1), (0, 0, -1)], faces)
    mesh.shade_smooth()
    return mesh


def camera(**properties: Any) -> Any:
    data = bpy.data.cameras.new("Camera")
    created = add("Camera", data, location=(0.3, -0.4, 6), rotation_euler=(0.08, 0.05, 0.3))
    for key, value in properties.items():
        setattr(data, key, value)
    bpy.context.scene.camera = created
    return created


def cycles_passes(path: Path) -> dict[str, Array]:
    """Return Cycles' Position, Normal and Depth of the scene at the pixel centres, (h, w, ...)."""
    import OpenEXR

    scene, render = bpy.context.scene, bpy.context.scene.render
    render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.filter_width = 1, 0.01
    scene.cycles.use_denoising = False
    layer = scene.view_layers[0]
    layer.use_pass_position = layer.use_pass_normal = layer.use_pass_z = True
    render_layers(path / "passes.exr")
    channels: dict[str, Array] = {}
    with OpenEXR.File(render.filepath, separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                key = name.replace("Diffuse Color", "DiffCol").replace("Glossy Color", "GlossCol")
                channels[".".join(key.split(".")[-2:])] = channel.pixels.astype(np.float64)
    stack = {n: [channels[f"{n}.{a}"] for a in "XYZ"] for n in ("Position", "Normal")}
    passes = {n: np.stack(c, axis=-1) for n, c in stack.items()}
    for name in {n.split(".")[0] for n in channels if n.startswith(("DiffCol", "GlossCol"))}:
        passes[name] = np.stack([channels[f"{name}.{c}"] for c in "RGB"], axis=-1)
    depth = next(v for k, v in channels.items() if k.startswith("Depth."))
    return {**passes, "Depth": depth}


def render_layers(path: Path) -> None:
    """Render all passes of the scene into one EXR file."""
    render = bpy.context.scene.render
    settings, render.filepath = render.image_settings, str(path)
    if hasattr(settings, "media_type"):
        settings.media_type = 'MULTI_LAYER_IMAGE'
    settings.file_format, settings.color_depth = 'OPEN_EXR_MULTILAYER', '32'
    with quiet_stdout():
        bpy.ops.render.render(write_still=True)


def shading_normals(mesh: Mesh, instance: Instance, points: Array) -> tuple[Array, Array]:
    """Return our shading normals (n, 3) at points on a mesh (n, 3), and the faces' own normals.

    The triangle of a point is the one whose plane and outline it misses least.
    """
    world = instance.world_from_object
    corners = mesh.vertices.astype(np.float64)[mesh.triangles] @ world[:3, :3].T + world[:3, 3]
    a, b, c = np.moveaxis(corners, 1, 0)
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    to = points[:, None, :] - a
    v = np.einsum("nmk,mk->nm", np.cross(to, c - a), across) / area**2
    w = np.einsum("nmk,mk->nm", np.cross(b - a, to), across) / area**2
    off = np.abs(np.einsum("nmk,mk->nm", to, across / area[:, None])) / np.sqrt(area)
    miss = off + np.maximum(0, -np.minimum(np.minimum(v, w), 1 - v - w))
    best = np.argmin(miss, axis=1)
    rows = np.arange(len(points))
    share = np.stack([1 - v - w, v, w], -1)[rows, best]
    turn = np.linalg.inv(world[:3, :3])  # rows on the left are multiplied by the inverse transpose
    facing = across / area[:, None] * np.sign(np.linalg.det(world[:3, :3]))
    if mesh.normals is None:
        return facing[best], facing[best]
    normals = mesh.normals.astype(np.float64)[best]
    if instance.normals_in_world:
        mixed = np.einsum("nk,nkd->nd", share, unit(normals @ turn))
    else:
        mixed = unit(np.einsum("nk,nkd->nd", share, normals)) @ turn
    smooth = mesh.smooth[best][:, None]
    return np.where(smooth, unit(mixed), facing[best]), facing[best]


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
