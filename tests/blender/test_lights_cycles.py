# SPDX-License-Identifier: GPL-3.0-or-later
"""Every light, as Cycles shows it: irradiance on small white receivers, against ours.

A receiver is a Lambert plane of albedo 1, seen by an orthographic camera 1 cm above it that covers
1 mm, without bounces: the picture is E/π at one point, 64 times.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from blender_rad.bpy_io.lights import light_record
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.lights import Light, LightRecord, light_from_record
from blender_rad.lights.mesh import MeshLight
from blender_rad.lights.world import WorldLight

from .reading import SQUARE as PLANE
from .reading import add, camera, empty_scene, material, polygons, world

pytestmark = pytest.mark.feature("irradiance at receivers, 0.3 %")
SINGLE_PRECISION = 1e-5  # Cycles' arithmetic; up to 4e-6 was seen where there is no noise
SIGMAS = 3.0
TOLERANCE = 0.003  # pixels of one render repel each other's errors: their spread overstates them
PIXELS = 8
OUR_SAMPLES = 256  # a side of the stratified square

FLOOR, TILTED = ((0, 0, 0), (0, 0, 1)), ((0.4, -0.3, 0.2), (0.3, 0.5, 1))
CUT = ((0.3, 0.2, 0.1), (1, 0.2, 0.12))
ABOVE = Matrix.Translation((0, 0, 2))
SLANTED = ABOVE @ Matrix.Rotation(0.3, 4, 'X') @ Matrix.Rotation(-0.2, 4, 'Y')


def scaled(x: float, y: float, z: float) -> Matrix:
    return SLANTED @ Matrix.Diagonal((x, y, z, 1))


def sheared(x: float, y: float, z: float) -> Matrix:
    return ABOVE @ Matrix.Diagonal((x, y, z, 1)) @ Matrix.Rotation(0.5, 4, (1, 2, 3))


@dataclass(frozen=True)
class Case:
    kind: str
    properties: Mapping[str, Any] = field(default_factory=dict)
    matrix: Matrix = field(default_factory=lambda: SLANTED)
    receivers: tuple[Any, ...] = (FLOOR, TILTED, CUT)
    systematic: float = SINGLE_PRECISION


def case(kind: str, **properties: Any) -> Case:
    known = {k: properties.pop(k) for k in ("matrix", "receivers", "systematic") if k in properties}
    return Case(kind, {"energy": 100.0, **properties}, **known)


SPOT = {"spot_size": math.radians(60), "spot_blend": 0.4}
NARROW = {"spot_size": 0.1, "spot_blend": 0.5, "shadow_soft_size": 0.5}
DELTA_SPOT, BALL = {**SPOT, "shadow_soft_size": 0}, {"use_soft_falloff": False}
SQUARE, DISC, RECTANGLE, ELLIPSE = (
    {"shape": shape} for shape in ('SQUARE', 'DISK', 'RECTANGLE', 'ELLIPSE')
)
ON_AXIS = (FLOOR, ((0.5, 0, 0), (0, 0, 1)), ((0, -0.9, 0.2), (0, 0.3, 1)))
BEAM = (((0, 0, 0), (0, 0, 1)), ((0.3, 0.1, 0), (0.5, 0, 1)), ((0.55, 0, 0), (0, 0, 1)))
BEHIND = (((0.1, 0.2, 4), (0, 0, -1)), FLOOR)
INSIDE = (((0, 0, 1.5), (0, 0, 1)), ((0.2, 0, 1.7), (1, 0, 0)))
SHEARED = {
    "receivers": (FLOOR, TILTED),
    "systematic": 0.003,
}  # Cycles' two samplings differ: 0.07 to 0.2 %

CASES = {
    "point": case('POINT', shadow_soft_size=0),
    "point-not-normalized": case('POINT', shadow_soft_size=0, normalize=False),
    "point-no-scale": case('POINT', shadow_soft_size=0, matrix=scaled(0, 0, 0)),
    "point-soft": case('POINT', shadow_soft_size=0.3),
    "point-soft-not-normalized": case('POINT', shadow_soft_size=0.3, normalize=False),
    "point-soft-scaled": case('POINT', shadow_soft_size=0.3, matrix=scaled(3, 2, 0.5)),
    "point-soft-near": case('POINT', shadow_soft_size=1.0, receivers=INSIDE),
    "sphere": case('POINT', **BALL, shadow_soft_size=0.3),
    "sphere-large": case('POINT', **BALL, shadow_soft_size=1.5),
    "sphere-tiny": case('POINT', **BALL, shadow_soft_size=0.001),
    "sphere-not-normalized": case('POINT', **BALL, shadow_soft_size=0.3, normalize=False),
    "sphere-inside": case('POINT', **BALL, shadow_soft_size=1.0, receivers=INSIDE),
    "exposure": case('POINT', shadow_soft_size=0, exposure=-1.5),
    "colour": case('POINT', shadow_soft_size=0, color=(0.2, 0.5, 1.0)),
    "temperature": case('POINT', shadow_soft_size=0, use_temperature=True, temperature=2700.0),
    "negative": case('POINT', shadow_soft_size=0, energy=-50.0),
    "spot": case('SPOT', **DELTA_SPOT, receivers=ON_AXIS),
    "spot-hard": case('SPOT', spot_size=1.0, spot_blend=0, shadow_soft_size=0, receivers=ON_AXIS),
    "spot-180": case('SPOT', spot_size=math.pi, spot_blend=1, shadow_soft_size=0),
    "spot-elliptic": case('SPOT', **DELTA_SPOT, matrix=scaled(1, 2, 0.5), receivers=ON_AXIS),
    "spot-turned-about": case('SPOT', **DELTA_SPOT, matrix=scaled(1, 1, -1), receivers=BEHIND),
    "spot-sheared": case('SPOT', **DELTA_SPOT, matrix=sheared(1, 2, 1), receivers=ON_AXIS),
    "spot-not-normalized": case(
        'SPOT', **SPOT, shadow_soft_size=0.2, normalize=False, receivers=ON_AXIS
    ),
    "spot-soft": case('SPOT', **SPOT, shadow_soft_size=0.5, receivers=ON_AXIS),
    "spot-soft-near": case('SPOT', **SPOT, shadow_soft_size=1.0, matrix=ABOVE, receivers=INSIDE),
    "spot-sphere": case('SPOT', **SPOT, **BALL, shadow_soft_size=0.5, receivers=ON_AXIS),
    "spot-sphere-narrow": case(
        'SPOT', **BALL, **NARROW, matrix=ABOVE, receivers=(FLOOR, ((0.2, 0, 0), (0, 0.3, 1)))
    ),
    "spot-sphere-elliptic": case(
        'SPOT', **SPOT, **BALL, shadow_soft_size=0.3, matrix=scaled(1, 2, 0.5), receivers=ON_AXIS
    ),
    "area": case('AREA', **SQUARE, size=0.5),
    "area-near": case('AREA', **SQUARE, size=6.0),
    "area-tiny": case('AREA', **SQUARE, size=0.001),
    "area-rectangle": case('AREA', **RECTANGLE, size=0.3, size_y=1.2),
    "area-disc": case('AREA', **DISC, size=0.8, receivers=(FLOOR, TILTED)),
    "area-disc-cut": case('AREA', **DISC, size=3.0, receivers=(CUT,)),
    "area-ellipse": case('AREA', **ELLIPSE, size=0.3, size_y=1.2),
    "area-scaled": case('AREA', **SQUARE, size=0.3, matrix=scaled(2, 3, 0.2)),
    "area-disc-scaled": case('AREA', **DISC, size=0.3, matrix=scaled(2, 3, 0.2)),
    "area-mirrored": case('AREA', **RECTANGLE, size=0.3, size_y=1.0, matrix=scaled(-1, 1, 1)),
    "area-turned-about": case(
        'AREA', **SQUARE, size=0.5, matrix=scaled(1, 1, -1), receivers=BEHIND
    ),
    "area-not-normalized": case('AREA', **ELLIPSE, size=0.3, size_y=1, normalize=False),
    "area-spread": case('AREA', **SQUARE, size=0.5, spread=1.2, receivers=ON_AXIS),
    "area-spread-near": case('AREA', **RECTANGLE, size=2, size_y=3, spread=0.5),
    "area-spread-narrow": case('AREA', **SQUARE, size=1, spread=0.08, matrix=ABOVE, receivers=BEAM),
    "area-spread-nought": case('AREA', **SQUARE, size=1, spread=0, matrix=ABOVE, receivers=BEAM),
    "area-disc-spread": case('AREA', **DISC, size=0.5, spread=0.7, receivers=ON_AXIS),
    "area-disc-spread-nought": case('AREA', **DISC, size=1, spread=0, matrix=ABOVE, receivers=BEAM),
    "area-ellipse-spread": case('AREA', **ELLIPSE, size=1, size_y=2, spread=0.4),
    "area-sheared": case('AREA', **SQUARE, size=0.5, matrix=sheared(1, 2, 3), **SHEARED),
    "area-disc-sheared": case('AREA', **DISC, size=0.5, matrix=sheared(2, 1, 1), **SHEARED),
    "sun": case('SUN', angle=0.0),
    "sun-angle": case('SUN', angle=math.radians(10)),
    "sun-half-sky": case('SUN', angle=math.pi),
    "sun-not-normalized": case('SUN', angle=0.5, normalize=False),
    "sun-delta-not-normalized": case('SUN', angle=0.0, normalize=False),
    "sun-sheared": case('SUN', angle=0.1, matrix=sheared(1, 2, 3)),
    "sun-flat": case('SUN', angle=0.1, matrix=scaled(0, 0, 1)),
}
DARK = {
    "area-flat": case('AREA', matrix=scaled(1, 1, 0)),
    "area-thin": case('AREA', matrix=scaled(0, 1, 1)),
    "spot-nought": case('SPOT', shadow_soft_size=0, matrix=scaled(0, 0, 0)),
    "spot-flat": case('SPOT', shadow_soft_size=0, matrix=scaled(1, 1, 0)),
    "sun-nought": case('SUN', matrix=scaled(1, 1, 0)),
    "portal": case('AREA', is_portal=True),
}


@pytest.fixture(scope="module")
def stage() -> Stage:
    return Stage()


class Stage:
    """An empty scene with a receiver, a camera, and room for one light."""

    def __init__(self) -> None:
        empty_scene()
        self.background = world(Color=(0, 0, 0, 1)).node_tree.nodes["Background"].inputs["Color"]
        self.camera = camera(type='ORTHO', ortho_scale=1e-3, clip_start=1e-4)
        self.receiver = add("Receiver", white(0.05 * np.array(PLANE[0]), "BsdfDiffuse"))
        self.light = self.parent = None
        self.samples = 256
        self.witness = CyclesWitness(bpy.context.scene, resolution=(PIXELS, PIXELS), threads=1)
        self.witness.prepare()

    def show(self, thing: Any, matrix: Matrix) -> None:
        """Make `thing` the only light, under a parent, which keeps shear."""
        self.clear()
        self.parent = add("Parent")
        self.light = add("Light", thing, parent=self.parent, matrix_parent_inverse=matrix)
        bpy.context.view_layer.update()

    def clear(self) -> None:
        self.background.default_value = (0, 0, 0, 1)
        if self.light is not None:
            bpy.data.objects.remove(self.light)
            bpy.data.objects.remove(self.parent)
            self.light = None

    def record(self) -> LightRecord:
        """Return the light as it is read."""
        evaluated = self.light.evaluated_get(bpy.context.evaluated_depsgraph_get())
        matrix = np.array(evaluated.matrix_world)
        return light_record(evaluated, "Light", matrix, unit_scale_m=1.0)

    def irradiance(self, place: Any, normal: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard error (3,) of E at a receiver."""
        turn = Vector(normal).to_track_quat('Z', 'Y').to_matrix().to_4x4()
        self.receiver.matrix_world = Matrix.Translation(place) @ turn
        self.camera.matrix_world = self.receiver.matrix_world @ Matrix.Translation((0, 0, 0.01))
        pixels = self.witness.render(7, self.samples)[..., :3].reshape(-1, 3) * np.pi
        return pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / PIXELS


def white(corners: Any, shader: str) -> Any:
    """A mesh of one white face."""
    shown = material("White", shader, Color=(1, 1, 1))
    return polygons("White", [tuple(c) for c in corners], [range(len(corners))], shown)


def build(stage: Stage, wanted: Case) -> LightRecord:
    light = bpy.data.lights.new("Light", wanted.kind)
    for name, value in wanted.properties.items():
        setattr(light.cycles if name == "is_portal" else light, name, value)
    stage.show(light, wanted.matrix)
    return stage.record()


def ours(light: Light, place: Any, normal: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return E and its standard error (3,): the closed form, or stratified samples."""
    point = np.array([place], dtype=np.float64)
    n = np.array([Vector(normal).normalized()], dtype=np.float64)
    exact = light.irradiance(point, n)
    if exact is not None and np.isfinite(exact[0]):
        return light.rgb * exact[0], np.zeros(3)
    side = np.arange(OUR_SAMPLES) / OUR_SAMPLES
    u = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    u += np.random.default_rng(3).random(u.shape) / OUR_SAMPLES
    sample = light.sample(np.repeat(point, len(u), 0), np.repeat(n, len(u), 0), u)
    values = sample.weight * np.maximum(sample.wi @ n[0], 0.0)
    strata = values.reshape(OUR_SAMPLES, OUR_SAMPLES // 2, 2)
    error = np.sqrt(np.mean(np.var(strata, axis=2, ddof=1)) / len(u))
    return light.rgb * values.mean(), np.abs(light.rgb) * error


def assert_same(stage: Stage, light: Light, receivers: Any, systematic: float) -> None:
    lit = 0.0
    stage.samples = 256 if light.is_delta else 1024  # sums of more in single precision lose digits
    for place, normal in receivers:
        expected, our_error = ours(light, place, normal)
        measured, its_error = stage.irradiance(place, normal)
        allowed = SIGMAS * np.hypot(our_error, its_error) + systematic * np.abs(expected)
        allowed = np.minimum(allowed, TOLERANCE * np.abs(expected))
        assert np.all(np.abs(measured - expected) <= allowed), (place, expected, measured, allowed)
        lit += float(np.sum(np.abs(expected)))
    assert lit > 0.0


@pytest.mark.parametrize("name", CASES)
def test_light_objects(stage: Stage, name: str) -> None:
    wanted = CASES[name]
    light = light_from_record(build(stage, wanted), "cycles")
    assert light is not None
    assert_same(stage, light, wanted.receivers, wanted.systematic)


@pytest.mark.parametrize("name", DARK)
def test_lights_that_emit_nothing(stage: Stage, name: str) -> None:
    assert light_from_record(build(stage, DARK[name]), "cycles") is None
    assert np.all(stage.irradiance(*FLOOR)[0] == 0.0)


def test_mesh_emitter(stage: Stage) -> None:
    corners = np.array([[-0.5, 0.0, 1.5], [0.6, -0.2, 1.4], [0.1, 0.7, 1.9]])
    for order in (corners, corners[::-1]):
        stage.show(white(order, "Emission"), Matrix())
        light = MeshLight(name="Emitter", rgb=np.ones(3), triangles=corners[None])
        assert_same(stage, light, (FLOOR, TILTED, CUT), 5e-4)  # seen: 0.03 % low in Cycles


def test_world(stage: Stage) -> None:
    stage.clear()
    stage.background.default_value = (0.5, 0.25, 1.0, 1)
    light = WorldLight(name="World", rgb=np.array([0.5, 0.25, 1.0]))
    assert_same(stage, light, (FLOOR, TILTED, CUT), SINGLE_PRECISION)


def test_use_shadow_is_what_makes_a_light_shadowless(stage: Stage) -> None:
    for use_shadow in (True, False):
        record = build(stage, case('POINT', shadow_soft_size=0, use_shadow=use_shadow))
        light = light_from_record(record, "cycles")
        assert light is not None and light.cast_shadow is use_shadow
        blocker = add("Blocker", white(PLANE[0], "BsdfDiffuse"), location=(0, 0, 1))
        seen = stage.irradiance(*FLOOR)[0]
        bpy.data.objects.remove(blocker)
        assert bool(np.all(seen > 0.0)) is not use_shadow
