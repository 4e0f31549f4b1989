# SPDX-License-Identifier: GPL-3.0-or-later
"""IES Texture nodes: our light against Cycles' at receivers all about, and light of LDT files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from blender_rad.bpy_io.ies import add_photometric_light
from blender_rad.lights import Light, light_from_record
from blender_rad.photometry import parse_photometry
from tests.unit.test_photometry import ies as file_of

from .reading import add, node, put, with_nodes
from .test_lights_cycles import Stage, assert_same, ours

pytestmark = pytest.mark.feature("irradiance at receivers, 0.3 %", area="IES files")
DATA = Path(__file__).parents[3] / "shared" / "data"
# Off the axes of every type; two are near the seam at -Y, and one is above.
TOWARDS = np.array([(0.1, -1, -1), (-0.1, -1, -2), (1, 0.2, -1.5), (-1, 0.3, -0.7), (0.7, 1, 0.6)])
RECEIVERS = tuple((tuple(1.5 * d), tuple(-d)) for d in TOWARDS)
HALF, TURN = np.arange(0, 181, 15), np.arange(0, 361, 30)
TILTED = Matrix.Rotation(0.3, 4, (1, 2, 3))
SCALED = TILTED @ Matrix.Diagonal((1, 2, 0.7, 1))
SINGLE_PRECISION = 1e-4  # of angles near a table's ends; the cubic makes more of it


def rough(d: np.ndarray) -> np.ndarray:
    """Return a table without symmetry."""
    return (300.0 + 200.0 * np.random.default_rng(3).random(d.shape[:-1])).round(3)


def ies(v: Any = HALF, h: Any = TURN, kind: str = "C", factors: str = "1 1 50") -> str:
    return file_of(rough, kind, (v, h), lamps="1 -1 2", factors=factors, size="0 0 0")


TEXTS = {
    "full": ies(),
    "axial": ies(h=[0]),
    "quarter": ies(h=TURN[:4]),
    "half": ies(h=TURN[:7]),
    "turned-half": ies(h=TURN[3:10]),
    "from-minus-90": ies(h=TURN[:7] - 90),
    "not-closed": ies(h=TURN[:-1]),
    "uneven": ies(h=[0, 20, 90, 200, 300], v=[20, 30, 90, 160]),
    "not-rising": ies(h=[0, 90, 60, 120, 360]),
    "A": ies(HALF - 90, TURN[:7] - 90, "A", factors="0.9 0.8 50"),
    "A-half": ies(HALF[:7], HALF[:7], "A"),
    "B": ies(HALF - 90, HALF - 90, "B"),
    "B-half": ies(HALF[:7], HALF[:7], "B"),
    "commas-and-tilt": ies().replace("NONE", "INCLUDE\n1\n2\n0 90\n1 0.5").replace(" ", ", "),
    "unreadable": ies().replace("TILT=NONE", "TILT = NONE"),
    "too-short": ies()[:-9],
    "one-angle": ies(v=[90]) + "\n",
}
NOTES = dict.fromkeys(["unreadable", "too-short"], ("ies-unreadable",))
NOTES |= dict.fromkeys(
    "full from-minus-90 not-closed uneven not-rising A B commas-and-tilt".split(),
    ("ies-mirrored",),
)
if bpy.app.version < (5, 0):
    NOTES["axial"] = ("ies-seam",)


@pytest.fixture(scope="module")
def stage() -> Stage:
    made = Stage()
    made.samples = 16  # points give no noise
    return made


def light_of(
    stage: Stage, text: str | Path, kind: str = 'POINT', turned: Any = None
) -> tuple[Any, Any]:
    """Show a light whose IES Texture has `text`, or reads that file; return its tree and that."""
    lamp = bpy.data.lights.new("IES", kind)
    lamp.energy, lamp.color = 2.0, (1.0, 0.5, 0.25)
    if kind in {'POINT', 'SPOT'}:
        lamp.shadow_soft_size = 0.0
    tree = with_nodes(lamp)
    if isinstance(text, Path):
        made = node(tree, "TexIES", mode='EXTERNAL', filepath=str(text))
    else:
        made = node(tree, "TexIES", mode='INTERNAL', ies=bpy.data.texts.new("IES"))
        made.ies.from_string(text)
    tree.links.new(made.outputs[0], tree.nodes["Emission"].inputs["Strength"])
    stage.show(lamp, turned or Matrix())
    return tree, made


def read(stage: Stage, model: Any = "cycles") -> Light:
    record = stage.record()
    light = light_from_record(record, model)
    assert light is not None and not record.unknown
    return light


def assert_as_cycles(stage: Stage) -> None:
    assert_same(stage, read(stage), RECEIVERS, SINGLE_PRECISION)


@pytest.mark.parametrize("name", TEXTS)
def test_texts_mean_what_cycles_makes_of_them(stage: Stage, name: str) -> None:
    light_of(stage, TEXTS[name])
    if name == "one-angle":
        assert not read(stage).radiant_flux().any()
        assert not stage.irradiance(*RECEIVERS[0])[0].any()
        return
    assert_as_cycles(stage)
    assert read(stage).notes == NOTES.get(name, ())


@pytest.mark.skipif(not DATA.exists(), reason="needs the real files, which are not ours")
@pytest.mark.parametrize(
    "name",
    [
        "CU__1.IES", "CU__flood_2.1.IES", "LuxCore__ASA_15M_R2.ies", "RenderPipeline__vee.ies",
        "RenderPipeline__trapezoid.ies", "eulumdat-rs__OutdoorRoadway_8988-2022.ies",
        "photompy__type_a_symmetric.ies", "photompy__type_b_full.ies", "no-such-file.ies",
    ],
)  # fmt: skip
def test_real_files(stage: Stage, name: str) -> None:
    light_of(stage, DATA / "ies" / name, turned=Matrix.Rotation(-0.9, 4, 'X'))
    assert_as_cycles(stage)


Turning = Callable[[Any, Any], None]


def vector(kind: str, output: str, mapping: str = "") -> Turning:
    def link(tree: Any, texture: Any) -> None:
        source = node(tree, kind).outputs[output]
        if mapping:
            turn = {"Rotation": (0.5, -0.7, 1.1), "Scale": (1, 2, 0.5)}
            source = node(tree, "Mapping", source, vector_type=mapping, **turn).outputs[0]
        tree.links.new(source, texture.inputs["Vector"])

    return link


def multiplied(tree: Any, texture: Any) -> None:
    texture.inputs["Strength"].default_value = 3.0
    times = node(tree, "Math", 2.5, texture, operation='MULTIPLY')
    tree.links.new(times.outputs[0], tree.nodes["Emission"].inputs["Strength"])


NODES: dict[str, Turning] = {
    "normal": vector("TexCoord", "Normal"),
    "incoming": vector("NewGeometry", "Incoming"),
    "multiplied": multiplied,
    **{f"mapping-{m}": vector("TexCoord", "Normal", m)
       for m in ('POINT', 'TEXTURE', 'VECTOR', 'NORMAL')},
}  # fmt: skip


@pytest.mark.parametrize("name", NODES)
def test_how_the_texture_is_turned(stage: Stage, name: str) -> None:
    NODES[name](*light_of(stage, TEXTS["full"], turned=SCALED))
    bpy.context.view_layer.update()
    assert_as_cycles(stage)


SPOT = {"spot_size": 2.5, "spot_blend": 0.5}
SHAPES: dict[str, tuple[str, dict[str, Any]]] = {
    "soft point": ('POINT', {"shadow_soft_size": 0.3}),
    "sphere": ('POINT', {"shadow_soft_size": 0.3, "use_soft_falloff": False}),
    "spot": ('SPOT', SPOT),
    "soft spot": ('SPOT', {**SPOT, "shadow_soft_size": 0.2}),
    "area": ('AREA', {"size": 0.4}),
    "area with spread": ('AREA', {"size": 0.4, "shape": 'DISK', "spread": 2.0}),
}


@pytest.mark.parametrize("name", SHAPES)
def test_lights_of_every_shape(stage: Stage, name: str) -> None:
    kind, properties = SHAPES[name]
    light_of(stage, TEXTS["full"], kind, TILTED)
    put(stage.light, **properties)
    assert_as_cycles(stage)


UNKNOWN: dict[str, tuple[str, Turning]] = {
    "sun": ('SUN', lambda tree, texture: None),
    "at the object": ('POINT', vector("TexCoord", "Object")),
    "generated": ('POINT', vector("TexCoord", "Generated", "POINT")),
}


@pytest.mark.feature("named, left out", area="Not supported", holds="left out",
                     rows=["IES files turned in other ways, or in suns"])  # fmt: skip
@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_not_known_is_said(stage: Stage, name: str) -> None:
    kind, change = UNKNOWN[name]
    change(*light_of(stage, TEXTS["full"], kind))
    assert "IES Texture" in stage.record().unknown


# Angles, fine enough for a cubic, a line and a turned grid to differ little; where the light leans.
FINE = np.arange(-90, 181, 2)
MADE = {
    "A-half": ((FINE[45:91], FINE[45:91]), (0, 0, 0)),
    "B": ((FINE[:91], FINE[:91]), (0.5, 0, 0)),
    "C-axial": ((FINE[45:], [0]), (0, 0, 0)),
    "C-full": ((FINE[45:], np.arange(0, 361, 5)), (0.76, 0.64, 0)),
}


@pytest.mark.parametrize("name", MADE)
def test_made_lights_shine_as_their_files_say(stage: Stage, name: str) -> None:
    """C0 along +X, C90 along +Y, gamma 0 down, in candela: in Cycles, and in the physical model."""
    stage.clear()
    grid, lean = MADE[name]
    smooth = file_of(lambda d: 1000.0 + 300.0 * (d @ lean - d[..., 2]), name[0], grid)
    light = parse_photometry(smooth.encode(), "a")
    stage.light = add_photometric_light(light)
    stage.parent = add("Parent")
    mine, declared = read(stage), read(stage, "physical")
    assert mine.notes == ()
    for d, receiver in zip(TOWARDS, RECEIVERS, strict=True):
        candela = light.luminous_intensity(d[None])[0]
        expected = candela / (1.5**2 * (d @ d))
        assert ours(declared, *receiver)[0][0] * 683.002 == pytest.approx(expected, rel=2e-3)
        assert stage.irradiance(*receiver)[0][0] * 177.83 == pytest.approx(expected, rel=2e-3)
