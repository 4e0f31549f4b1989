# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds by direction: a floor and a box under them, ours against Cycles, all pixels compared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

from blender_rad.bpy_io.read import read_scene  # noqa: E402
from blender_rad.bpy_io.sky import measure_sky  # noqa: E402

from .agreement import both_sides, look_at  # noqa: E402
from .reading import CUBE, SQUARE, add, empty_scene, polygons  # noqa: E402
from .test_features_cycles import agrees  # noqa: E402

SIZE = (48, 32)
CONTRAST = 1e5
NEW_SKY = bpy.app.version >= (5, 0)


def stage() -> Any:
    """Floor, leaning box, camera and an empty world; its node tree is returned."""
    scene = empty_scene()
    add("Floor", polygons("Floor", *SQUARE), scale=(3, 3, 1))
    box = polygons("Box", *CUBE)
    add("Box", box, location=(0.4, 0.2, 0.5), scale=(0.4,) * 3, rotation_euler=(0.3, 0.2, 0.4))
    look_at((0, 0, 0.6), (0.5, -6, 3), lens=40)
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    return scene.world.node_tree


def node(tree: Any, kind: str, into: Any = None, **properties: Any) -> Any:
    """A new node, its first output linked to the socket `into`."""
    made = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in properties.items():
        setattr(made, name, value)
    if into:
        tree.links.new(made.outputs[0], into)
    return made


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
    turn: tuple[float, float, float] = (0, 0, 0), strength: float = 1.0, **properties: Any
) -> Callable[[], None]:
    def build() -> None:
        tree = stage()
        background = tree.nodes["Background"]
        background.inputs["Strength"].default_value = strength
        ball = properties.get("projection") == 'MIRROR_BALL'
        image = picture((64, 64), (30, 52)) if ball else picture((128, 64), (90, 45))
        texture = node(tree, "TexEnvironment", background.inputs["Color"], image=image)
        for name, value in properties.items():
            setattr(texture, name, value)
        mapping = node(tree, "Mapping", texture.inputs["Vector"])
        mapping.inputs["Rotation"].default_value = turn
        node(tree, "TexCoord")
        tree.links.new(tree.nodes["Texture Coordinate"].outputs["Generated"], mapping.inputs[0])

    return build


def sky(model: str, **properties: Any) -> Callable[[], None]:
    def build() -> None:
        tree = stage()
        chosen = {"sun_elevation": 0.5, "sun_rotation": 2.6, **properties}
        background = tree.nodes["Background"]
        background.inputs["Strength"].default_value = 0.1
        node(tree, "TexSky", background.inputs["Color"], sky_type=model, **chosen)

    return build


def mixed() -> None:
    """Half an image, half a sky with its sun."""
    image_sky((0.2, 0.1, 0.7))()
    tree = bpy.context.scene.world.node_tree
    second = node(tree, "Background")
    model = 'MULTIPLE_SCATTERING' if NEW_SKY else 'NISHITA'
    node(tree, "TexSky", second.inputs["Color"], sky_type=model, sun_elevation=0.7)
    second.inputs["Strength"].default_value = 0.05
    mix = node(tree, "MixShader", tree.get_output_node('CYCLES').inputs["Surface"])
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])


def unseen() -> None:
    """A sky that lights and that the camera does not see."""
    sky('PREETHAM', sun_direction=(0.3, -0.5, 0.6))()
    bpy.context.scene.world.cycles_visibility.camera = False


def panorama() -> None:
    """A sky and nothing around it, seen through a fisheye."""
    sky('PREETHAM', sun_direction=(0.3, -0.5, 0.6))()
    camera = bpy.context.scene.camera.data
    camera.type, camera.panorama_type, camera.fisheye_fov = 'PANO', 'FISHEYE_EQUIDISTANT', 2.0


CASES: dict[str, Callable[[], None]] = {
    "image": image_sky(),
    "image-turned": image_sky((0.4, -0.3, 2.0), strength=3.0),
    "mirror-ball": image_sky(projection='MIRROR_BALL'),
    "mixed": mixed,
    **{
        f"sky-{model.lower()}": sky(model)
        for model in (('SINGLE_SCATTERING', 'MULTIPLE_SCATTERING') if NEW_SKY else ('NISHITA',))
    },
    "sky-hosek": sky('HOSEK_WILKIE', sun_direction=(0.3, -0.5, 0.6)),
    "panorama": panorama,
    "no-camera-rays": unseen,
    "sky-preetham": sky('PREETHAM', sun_direction=(0.3, -0.5, 0.6)),
}


QUICK = ("sky-nishita", "sky-single_scattering")


@pytest.mark.feature("picture: tiles 1 %, energy 0.2 %")
@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CASES],
)
def test_world_is_that_of_cycles(name: str) -> None:
    CASES[name]()
    agrees(both_sides(SIZE))


def spotted() -> None:
    """A gradient with noise-free dots on the sphere, and an image mixed in by height."""
    image_sky((0.2, 0.1, 0.7))()
    tree = bpy.context.scene.world.node_tree
    background = tree.nodes["Background"]
    image = background.inputs["Color"].links[0].from_socket
    place = node(tree, "NewGeometry").outputs["Position"]
    up = node(tree, "SeparateXYZ")
    tree.links.new(place, up.inputs[0])
    mix = node(tree, "Mix", data_type='RGBA')
    tree.links.new(up.outputs["Z"], mix.inputs["Factor"])
    tree.links.new(image, mix.inputs[6])
    mix.inputs[7].default_value = (0.3, 0.6, 0.9, 1.0)
    tree.links.new(mix.outputs[2], background.inputs["Color"])


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
    image_sky((0.4, -0.3, 2.0), strength=3.0)()
    (found,) = read_scene(bpy.context.scene).world.maps
    pixels = np.empty(128 * 64 * 4, dtype=np.float32)
    bpy.data.images["Sky"].pixels.foreach_get(pixels)
    texels = pixels.reshape(64, 128, 4)[::-1, :, :3]
    off = np.abs(found.radiance / (3.0 * texels) - 1.0)
    assert np.quantile(off, 0.99) < 1e-4  # but where the bright one reaches over its edge
    assert found.radiance.sum() == pytest.approx(3.0 * texels.sum(), rel=1e-4)
    np.testing.assert_allclose(found.map_from_world @ found.map_from_world.T, np.eye(3), atol=1e-6)
