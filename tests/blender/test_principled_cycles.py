# SPDX-License-Identifier: GPL-3.0-or-later
"""Principled BSDFs against Cycles: flat tiles at many slants under a sharp sun, one pixel each."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.bsdfs import Inputs, Mixture, lobes
from blender_rad.bsdfs.principled import emitted

from .reading import add, camera, empty_scene, light, node, with_nodes

Array = np.ndarray
KIND, TILES, SIZE = "ShaderNodeBsdfPrincipled", 12, 0.08
SUNS = np.array([[0.3, 0.1, 0.9], [-0.8, 0.3, 0.3], [0.4, 0.2, -0.7]])  # one from behind
PIXEL, DARK = 1e-3, 0.02  # of its value, or of this share of the brightest of the row
ENERGY = 2e-4  # of a row; 3e-3 is asked for
VECTORS = {"Tangent", "Coat Normal"}
RED = (0.8, 0.4, 0.1)
COATED = {"Coat Weight": 0.7, "Coat Roughness": 0.3, "Base Color": RED}
GLASS = {"Transmission Weight": 1.0, "Base Color": RED}
CASES: dict[str, dict[str, Any]] = {
    "default": {},
    "diffuse": {"Base Color": RED, "Specular IOR Level": 0.0},
    "rough diffuse": {"Base Color": RED, "Specular IOR Level": 0.0, "Diffuse Roughness": 0.7},
    "smooth": {"Roughness": 0.1},
    "rough": {"Roughness": 1.0},
    "single scattering": {"Roughness": 0.8, "distribution": 'GGX'},
    "colours above 1": {"Base Color": (1.5, 1.0, 2.0), "Diffuse Roughness": 1.0},
    "specular tint": {"Specular Tint": (1.0, 0.3, 2.0), "Roughness": 0.6},
    "specular level": {"Specular IOR Level": 0.9, "IOR": 1.8},
    "index below 1": {"IOR": 0.8, "Specular IOR Level": 0.9},
    "metal": {"Base Color": RED, "Metallic": 1.0},
    "edge tint": {"Base Color": RED, "Metallic": 0.6, "Specular Tint": (0.2, 0.5, 1.0)},
    "anisotropic": {"Metallic": 0.7, "Anisotropic": 0.7, "Anisotropic Rotation": 0.15}
    | {"Base Color": RED, "Tangent": (1.0, 0.2, 0.1)},
    "coat": COATED,
    "coat tint": COATED | {"Coat Tint": (0.9, 0.4, 0.2), "Coat IOR": 1.8},
    "coat normal": COATED | {"Coat Normal": (0.1, 0.05, 1.0)},
    "sharp coat": COATED | {"Coat Roughness": 0.0},
    "sheen": {"Base Color": RED, "Sheen Weight": 1.0, "Sheen Tint": (1.0, 0.5, 0.2)},
    "sheen on coat": COATED | {"Sheen Weight": 0.7, "Sheen Roughness": 0.25},
    "emission below sheen and coat": COATED
    | {"Sheen Weight": 0.5, "Emission Strength": 0.3, "Emission Color": (1.0, 0.5, 0.2)},
    "alpha": {"Base Color": RED, "Alpha": 0.4},
    "glass": GLASS,
    "half glass": GLASS | {"Transmission Weight": 0.6, "Specular Tint": (0.5, 0.6, 1.0)},
    "single-scattering glass": GLASS | {"IOR": 1.33, "distribution": 'GGX'},
    "black glass": GLASS | {"Base Color": (0.0, 0.0, 0.0)},
    "all": COATED
    | {"Metallic": 0.3, "Sheen Weight": 0.5, "Specular Tint": (1.0, 0.8, 0.6), "Roughness": 0.35}
    | {"Diffuse Roughness": 0.4, "IOR": 1.6, "Transmission Weight": 0.3},
}


def slants() -> Array:
    """Rotations (TILES, 3, 3), of which the last third shows its back."""
    rng = np.random.default_rng(5)
    found = []
    for tilt in np.radians(np.linspace(5.0, 83.0, TILES)):
        turn, spin = 6.283 * rng.random(2)
        back = np.pi * (len(found) % 3 == 2)
        y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
        found.append(about(z, turn) @ about(y, tilt + back) @ about(z, spin))
    return np.array(found)


def about(axis: Array, angle: float) -> Array:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def principled(name: str, case: dict[str, Any]) -> tuple[Any, dict[str, Array]]:
    """A material, and the values of its node's sockets."""
    made = bpy.data.materials.new(name)
    tree = with_nodes(made)
    tree.nodes.clear()
    shader = node(tree, KIND)
    node(tree, "ShaderNodeOutputMaterial", shader)
    values: dict[str, Array] = {}
    for socket in shader.inputs:
        value = case.get(socket.name, socket.default_value)
        if socket.name in VECTORS & set(case):
            fixed = node(tree, "ShaderNodeCombineXYZ", **dict(zip("XYZ", value, strict=True)))
            tree.links.new(fixed.outputs[0], socket)
        elif socket.name in case:
            socket.default_value = (*value, 1.0) if socket.type == 'RGBA' else value
        values[socket.name] = np.atleast_2d(np.array(value, dtype=float).ravel()[:3])
    shader.distribution = case.get("distribution", 'MULTI_GGX')
    return made, values


@pytest.fixture(scope="module")
def pictures() -> dict[str, tuple[dict[str, Array], Array]]:
    """By case, the sockets' values, and Cycles' pixels (suns, tiles, 3) of its row."""
    scene = empty_scene()
    corners = np.array([(-SIZE, -SIZE, 0), (SIZE, -SIZE, 0), (SIZE, SIZE, 0), (-SIZE, SIZE, 0)])
    middle = np.stack([np.arange(TILES) + 0.5, np.zeros(TILES), np.zeros(TILES)], axis=1)
    vertices = corners @ np.swapaxes(slants(), 1, 2) + middle[:, None]
    faces = np.arange(4 * TILES).reshape(TILES, 4).tolist()
    values: dict[str, dict[str, Array]] = {}
    for row, (name, case) in enumerate(CASES.items()):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(vertices.reshape(-1, 3).tolist(), [], faces)
        made, values[name] = principled(name, case)
        mesh.materials.append(made)
        add(name, mesh, location=(0, row + 0.5, 0))
    width, height = TILES, len(CASES)
    centre = (width / 2, height / 2, 9)
    camera(type='ORTHO', ortho_scale=max(width, height)).location = centre
    scene.camera.rotation_euler = (0, 0, 0)
    from mathutils import Vector

    sun = light('SUN', energy=1.0, angle=0.0)
    witness = CyclesWitness(scene, resolution=(width, height), threads=1)
    witness.prepare()
    found: list[Array] = []
    for towards in SUNS:
        sun.rotation_euler = Vector(towards).to_track_quat('Z', 'Y').to_euler()
        found.append(witness.render(1, 1)[::-1, :, :3].astype(float))
    rows = np.swapaxes(np.array(found), 0, 1)
    return {name: (own, row) for (name, own), row in zip(values.items(), rows, strict=True)}


def inputs_of(case: dict[str, Any], values: dict[str, Array]) -> Inputs:
    up = slants()[:, :, 2]
    back = up[:, 2] < 0.0
    normal = np.where(back[:, None], -up, up)
    tangent = np.tile(values["Tangent"], (TILES, 1)) if "Tangent" in case else None
    return Inputs(
        values={
            **values,
            "Coat Normal": values["Coat Normal"] if "Coat Normal" in case else normal,
        },
        settings={"distribution": case.get("distribution", 'MULTI_GGX')},
        weight=np.ones((TILES, 3)),
        normal=normal,
        geometric=normal,
        wo=np.tile([0.0, 0.0, 1.0], (TILES, 1)),
        tangent=tangent,
        backfacing=back,
        version=bpy.app.version,
    )


@pytest.mark.feature("tiles at 12 slants, 3 suns: pixel 0.1 %, energy 0.02 %")
@pytest.mark.parametrize("name", CASES)
def test_principled(name: str, pictures: dict[str, tuple[dict[str, Array], Array]]) -> None:
    case, (values, theirs) = CASES[name], pictures[name]
    inputs = inputs_of(case, values)
    mixture = Mixture.of(lobes(KIND, inputs))
    glow = emitted(inputs) * values["Emission Color"] * values["Emission Strength"]
    towards = SUNS / np.linalg.norm(SUNS, axis=1, keepdims=True)
    ours = np.array([mixture.evaluate(np.tile(wi, (TILES, 1)))[0] + glow for wi in towards])
    there = (towards @ inputs.normal.T > 0.0) | ("Transmission Weight" in case)
    ours, theirs = ours[there], theirs[there]
    off = np.abs(ours - theirs) / np.maximum(theirs, DARK * theirs.max())
    assert off.max() < PIXEL
    assert np.abs(ours.sum(axis=0) / theirs.sum(axis=0) - 1.0).max() < ENERGY
