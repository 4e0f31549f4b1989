# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot be followed is named by the reader, and its pixels are left out.

Each case adds one thing to a stage of which everything is supported, and returns the name of the
block that is to be blamed.
"""

from collections.abc import Callable
from typing import Any

import bpy
import pytest

from blender_rad.bpy_io.read import read_scene
from blender_rad.rendering import Settings, render

from .agreement import lamp, stage
from .reading import add, geometry_nodes, material, node, put, shows, with_nodes, world

pytestmark = pytest.mark.feature("named, left out", area="Not supported", holds="left out")
MADE = "Strange"
Build = Callable[[Any, Any], str]  # from the box and the lamp of a stage to the block's name


def surface(kind: Any, **inputs: Any) -> Build:
    def build(box: Any, _: Any) -> str:
        box.data.materials[0] = material(MADE, kind, **inputs)
        return MADE

    return build


def noisy(tree: Any) -> Any:
    return node(tree, "BsdfDiffuse", node(tree, "TexNoise"))


def glowing_noise(tree: Any) -> Any:
    return node(tree, "MixShader", node(tree, "TexNoise"), noisy(tree), node(tree, "Emission"))


def output(socket: str, kind: str) -> Build:
    """Something on another socket of a material's output."""

    def build(box: Any, _: Any) -> str:
        made = box.data.materials[0] = material(MADE, "BsdfDiffuse")
        made.displacement_method = 'BOTH'
        shows(made.node_tree, node(made.node_tree, kind), socket)
        return MADE

    return build


def on_box(**properties: Any) -> Build:
    return lambda box, _: put(box, **properties).name


def particle_hair(box: Any, _: Any) -> str:
    bpy.context.view_layer.objects.active = box
    hair = box.modifiers.new("Hair", 'PARTICLE_SYSTEM').particle_system.settings
    put(hair, type='HAIR', count=20, hair_length=0.5)
    return "Box"


def strands(*_: Any) -> str:
    data = bpy.data.hair_curves.new("Strands")
    data.add_curves([2])
    data.points[1].position = (0, -0.5, 1)
    return add("Strands", data, location=(0, -1, 0.5)).name


def of_nodes(kind: str, **inputs: Any) -> Build:
    def build(*_: Any) -> str:
        host = add("Made", bpy.data.meshes.new("Made"), location=(0, -0.5, 0.6), scale=(0.4,) * 3)
        geometry_nodes(host, f"GeometryNode{kind}", **inputs)
        return "Made"

    return build


def diced(box: Any, _: Any) -> str:
    modifier = box.modifiers.new("Subdivision", 'SUBSURF')
    if hasattr(modifier, "use_adaptive_subdivision"):
        modifier.use_adaptive_subdivision = True
    else:
        bpy.context.scene.cycles.feature_set = 'EXPERIMENTAL'
        box.cycles.use_adaptive_subdivision = True
    return "Box"


def culled(box: Any, _: Any) -> str:
    scene = bpy.context.scene
    scene.render.use_simplify = scene.cycles.use_camera_cull = box.cycles.use_camera_cull = True
    return "Box"


def light_nodes(kind: str) -> Build:
    """A lamp whose strength is of a node that is not known."""

    def build(_: Any, light: Any) -> str:
        tree = with_nodes(light.data)
        strength = tree.nodes["Emission"].inputs["Strength"]
        tree.links.new(node(tree, kind).outputs[0], strength)
        return light.name

    return build


def velvet(box: Any, light: Any) -> str:
    """Velvet under a world that lights diffuse surfaces alone."""
    box.data.materials[0] = material(MADE, "BsdfSheen", distribution='ASHIKHMIN')
    world(Strength=1.0).cycles_visibility.glossy = False
    return MADE


def world_volume(*_: Any) -> str:
    tree = with_nodes(world())
    shows(tree, node(tree, "VolumeScatter"), "Volume")
    return "World"


def world_without_shadows(*_: Any) -> str:
    world(Strength=1.0).cycles.use_shadows = False
    return "World"


def stereo(*_: Any) -> str:
    bpy.context.scene.render.use_multiview = True
    return "Camera"


def custom_camera(*_: Any) -> str:
    bpy.context.scene.camera.data.type = 'CUSTOM'
    return "Camera"


def lamp_as_camera(_: Any, light: Any) -> str:
    bpy.context.scene.camera = light
    return light.name


PRINCIPLED = "BsdfPrincipled"
CASES: dict[str, Build] = {
    "Toon BSDF": surface("BsdfToon"),
    "Hair BSDF": surface("BsdfHair"),
    "Principled Hair BSDF": surface("BsdfHairPrincipled"),
    "Ray Portal BSDF": surface("BsdfRayPortal"),
    "Subsurface Scattering": surface("SubsurfaceScattering"),
    "Principled BSDF with subsurface": surface(PRINCIPLED, Subsurface_Weight=0.5),
    "Principled BSDF with a thin film": surface(PRINCIPLED, Thin_Film_Thickness=400.0),
    "Noise in a surface's colour": surface(noisy),
    "Noise in an emission": surface(glowing_noise),
    "Bevel in a colour": surface(lambda tree: node(tree, "BsdfDiffuse", node(tree, "Bevel"))),
    "Displacement": output("Displacement", "Displacement"),
    "Volume of a material": output("Volume", "VolumePrincipled"),
    "Shadow catcher": on_box(is_shadow_catcher=True),
    "Particle hair": particle_hair,
    "Hair curves": strands,
    "Point cloud": of_nodes("Points", Count=1, Radius=0.4),
    "Volume object": of_nodes("VolumeCube", Density=1.0),
    "Adaptive subdivision": diced,
    "Camera culling": culled,
    "Noise in a light": light_nodes("TexNoise"),
    "Light Path in a light": light_nodes("LightPath"),
    "Velvet in light for some rays": velvet,
    "World volume": world_volume,
    "World without shadows": world_without_shadows,
    "Stereoscopy": stereo,
    "Lamp as camera": lamp_as_camera,
}
if bpy.app.version >= (5, 0):
    CASES["Custom camera"] = custom_camera
else:  # before Blender 5 the switch does nothing
    del CASES["World without shadows"]


@pytest.mark.parametrize("name", CASES)
def test_it_is_named_and_left_out(name: str) -> None:
    box = stage()
    light = lamp('POINT', (-1, -1.2, 2.5), shadow_soft_size=0)
    size = {"resolution": (16, 12)}
    assert not read_scene(bpy.context.scene, **size).unsupported
    blamed = CASES[name](box, light)
    scene = read_scene(bpy.context.scene, **size)
    film = render(scene, Settings(samples=2, threads=1))
    causes = {cause for cause in scene.unsupported if cause.name == blamed}
    assert causes
    assert sum(film.excluded_by.get(cause, 0) for cause in causes) > 0
    assert film.excluded.any()


@pytest.mark.parametrize(
    "change",
    [
        lambda box: put(box, visible_shadow=False),
        lambda box: put(box, visible_diffuse=False),
        lambda box: put(bpy.data.lights["Area"], use_shadow=False),
    ],
    ids=["shadows of an object", "other rays of an object", "shadows of a large light"],
)
def test_what_is_there_for_some_rays_alone(change: Callable[[Any], None]) -> None:
    """Cycles samples large lights by surfaces too, and by how much depends on it alone."""
    box = stage()
    lamp('AREA', (-0.5, -0.5, 2.2), size=2.0)
    change(box)
    film = render(
        read_scene(bpy.context.scene, resolution=(16, 12)), Settings(samples=8, threads=1)
    )
    assert {cause.name for cause in film.excluded_by} == {"Box"}
    assert 0.05 < film.excluded.mean() < 0.5


@pytest.mark.feature("named, both at rest", area="Not supported", holds="left out")
def test_motion_blur() -> None:
    stage()
    bpy.context.scene.render.use_motion_blur = True
    found = read_scene(bpy.context.scene).findings
    assert [finding.code for finding in found] == ["motion-blur"]
