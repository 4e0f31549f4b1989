# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds by direction: a floor and a box under them, ours against Cycles, all pixels compared."""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.sky import measure_sky

from .agreement import FINE, PICTURE, agrees, both_sides, cases
from .agreement import stage as floor_and_box
from .reading import node, put, shows, with_nodes, world

CONTRAST = 1e5
NEW_SKY = bpy.app.version >= (5, 0)
MODELS = ('SINGLE_SCATTERING', 'MULTIPLE_SCATTERING') if NEW_SKY else ('NISHITA',)
OLD = {"sun_direction": (0.3, -0.5, 0.6)}


def stage(strength: float) -> tuple[Any, Any]:
    """Floor, leaning box, camera; the world's node tree and the colour of its background."""
    floor_and_box(rotation_euler=(0.3, 0.2, 0.4))
    tree = with_nodes(world(Strength=strength))
    return tree, tree.nodes["Background"].inputs["Color"]


def picture(size: tuple[int, int], texel: tuple[int, int]) -> Any:
    """A float image of soft colours with one texel, from the lower left, of great contrast."""
    width, height = size
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    x, y = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
    pixels = np.stack([0.2 + 0.1 * np.sin(6 * x), 0.1 + 0.2 * y, 0.3 * (1 - y), y * 0 + 1], axis=-1)
    pixels[texel[1], texel[0], :3] = 0.2 * CONTRAST, 0.15 * CONTRAST, 0.1 * CONTRAST
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    return image


def image_sky(
    turn: tuple[float, float, float] = (0, 0, 0), strength: float = 1.0, ball: bool = False
) -> Any:
    tree, colour = stage(strength)
    mapping = node(tree, "Mapping", Rotation=turn)
    tree.links.new(node(tree, "TexCoord").outputs["Generated"], mapping.inputs[0])
    texture = node(tree, "TexEnvironment", mapping)
    texture.image = picture((64, 64), (30, 52)) if ball else picture((128, 64), (90, 45))
    texture.projection = 'MIRROR_BALL' if ball else 'EQUIRECTANGULAR'
    tree.links.new(texture.outputs[0], colour)
    return tree


def sky(model: str, **properties: Any) -> None:
    tree, colour = stage(0.1)
    chosen = {"sun_elevation": 0.5, "sun_rotation": 2.6, **properties}
    tree.links.new(node(tree, "TexSky", sky_type=model, **chosen).outputs[0], colour)


def mixed() -> None:
    """Half an image, half a sky with its sun."""
    tree = image_sky((0.2, 0.1, 0.7))
    model = node(tree, "TexSky", sky_type=MODELS[-1], sun_elevation=0.7)
    second = node(tree, "Background", model, Strength=0.05)
    shows(tree, node(tree, "MixShader", 0.5, tree.nodes["Background"], second))


def unseen() -> None:
    """A sky that lights and that the camera does not see."""
    sky('PREETHAM', **OLD)
    bpy.context.scene.world.cycles_visibility.camera = False


def panorama() -> None:
    """A sky and nothing around it, seen through a fisheye."""
    sky('PREETHAM', **OLD)
    fisheye = {"panorama_type": 'FISHEYE_EQUIDISTANT', "fisheye_fov": 2.0}
    put(bpy.context.scene.camera, type='PANO', **fisheye)


TURN = (0.4, -0.3, 2.0)
CASES: dict[str, Callable[[], Any]] = {
    "image": image_sky,
    "image-turned": partial(image_sky, TURN, 3.0),
    "mirror-ball": partial(image_sky, ball=True),
    "mixed": mixed,
    **{f"sky-{model.lower()}": partial(sky, model) for model in MODELS},
    "sky-hosek": partial(sky, 'HOSEK_WILKIE', **OLD),
    "panorama": panorama,
    "no-camera-rays": unseen,
    "sky-preetham": partial(sky, 'PREETHAM', **OLD),
}


QUICK = ("sky-nishita", "sky-single_scattering")


@pytest.mark.feature(PICTURE)
@pytest.mark.parametrize("name", cases(CASES, QUICK))
def test_world_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    agrees(both_sides(**({} if name in QUICK else FINE)))


def spotted() -> None:
    tree = image_sky((0.2, 0.1, 0.7))
    colour = tree.nodes["Background"].inputs["Color"]
    up = node(tree, "SeparateXYZ", node(tree, "NewGeometry").outputs["Position"])
    mix = node(tree, "Mix", up.outputs["Z"], data_type='RGBA')
    tree.links.new(colour.links[0].from_socket, mix.inputs[6])
    mix.inputs[7].default_value = (0.3, 0.6, 0.9, 1.0)
    tree.links.new(mix.outputs[2], colour)


@pytest.mark.parametrize("name", ["image", "image-turned", "mirror-ball", "spotted"])
def test_a_known_tree_is_what_cycles_shows(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("blender_rad.bpy_io.sky.WIDTH", 256)
    {**CASES, "spotted": spotted}[name]()
    scene = bpy.context.scene
    (known,), (seen,) = read_scene(scene).world.maps, measure_sky(scene.world, (1, 0.0))
    np.testing.assert_allclose(known.map_from_world, seen.map_from_world, atol=1e-6)
    off = np.abs(known.radiance / seen.radiance - 1.0)
    assert np.quantile(off, 0.99) < 1e-3
    assert known.radiance.sum() == pytest.approx(seen.radiance.sum(), rel=1e-4)


def test_texels_of_a_turned_image_are_those_of_the_map() -> None:
    image_sky(TURN, strength=3.0)
    (found,) = read_scene(bpy.context.scene).world.maps
    pixels = np.empty(128 * 64 * 4, dtype=np.float32)
    bpy.data.images["Sky"].pixels.foreach_get(pixels)
    texels = pixels.reshape(64, 128, 4)[::-1, :, :3]
    off = np.abs(found.radiance / (3.0 * texels) - 1.0)
    assert np.quantile(off, 0.99) < 1e-4  # but where the bright one reaches over its edge
    assert found.radiance.sum() == pytest.approx(3.0 * texels.sum(), rel=1e-4)
    np.testing.assert_allclose(found.map_from_world @ found.map_from_world.T, np.eye(3), atol=1e-6)
