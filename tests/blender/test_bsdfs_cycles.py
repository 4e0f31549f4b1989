# SPDX-License-Identifier: GPL-3.0-or-later
"""Closure by closure, what its lobes send from a direction to the viewer is what Cycles shows."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest

from .agreement import both_sides, lamp, look_at, square
from .facets import Closure, shot
from .reading import empty_scene, material, world

POINTWISE, PRINCIPLED_POINTWISE = 2e-3, 1e-3
ENERGY = 3e-4  # tables of lost energy are good to 2e-4, both sides'
QUADS = 24
LIGHTS = [(-0.9, 0.3, 0.35), (0.5, 0.2, -0.8), (0.3, 0.3, -0.9)]  # of the eye at (0, 0, 1)
COLOUR, TANGENT = (0.8, 0.5, 0.2), (1.0, 0.3, 0.2)
# In single precision 1 − cos² of isotropic faces is off by up to 4 % at roughness 0.05 in Cycles,
# and the stretched ones' own formula is not: so it is asked at a stretch of next to nothing.
SHAPES = [(0.05, 0.001, 0.0), (0.3, 0.0, 0.0), (1.0, 0.0, 0.0), (0.4, 0.6, 0.1), (0.4, -0.5, 0.2)]
GLOSSY = ('GGX', 'MULTI_GGX', 'BECKMANN', 'ASHIKHMIN_SHIRLEY')
METALS = {
    'F82': {"Base Color": COLOUR, "Edge Tint": (0.3, 0.6, 0.9)},
    'PHYSICAL_CONDUCTOR': {"IOR": (0.2, 0.9, 1.5), "Extinction": (3.9, 2.4, 1.8)},
}


def closures() -> Iterator[tuple[str, Closure]]:
    for kind in GLOSSY:
        name, settings = kind.replace("_", " "), {"distribution": kind}
        for rough, bend, turn in SHAPES:
            values = {"Roughness": rough, "Anisotropy": bend, "Rotation": turn}
            values |= {"Tangent": TANGENT} if bend else {}
            around = settings, rough**2
            if kind != 'ASHIKHMIN_SHIRLEY' or rough > 0.05:  # which has no such formula
                both = {**values, "Color": COLOUR}
                yield f"Glossy {name}", Closure("ShaderNodeBsdfAnisotropic", both, *around)
            for fresnel, face in METALS.items() if bend >= 0.0 and kind in GLOSSY[:3] else ():
                around = {**settings, "fresnel_type": fresnel}, rough**2
                both = {**values, **face}
                yield f"Metallic {name}", Closure("ShaderNodeBsdfMetallic", both, *around)
        for rough, ior in product((0.3, 1.0), (1.45, 2.2)):
            values = {"Color": COLOUR, "Roughness": rough, "IOR": ior}
            around = settings, rough**2
            if kind in GLOSSY[:3]:
                yield f"Glass {name}", Closure("ShaderNodeBsdfGlass", values, *around)
            if kind in {'GGX', 'BECKMANN'}:
                yield f"Refraction {name}", Closure("ShaderNodeBsdfRefraction", values, *around)
    for rough in (0.0, 0.3, 1.0):
        values = {"Color": COLOUR, "Roughness": rough}
        yield "Diffuse", Closure("ShaderNodeBsdfDiffuse", values)
        values = {"Color": COLOUR, "Roughness": max(rough, 0.5)}
        for kind in ('MICROFIBER', 'ASHIKHMIN'):
            made = Closure("ShaderNodeBsdfSheen", values, {"distribution": kind})
            yield f"Sheen {kind}", made


COATED = {"Coat Weight": 0.7, "Coat Roughness": 0.3, "Base Color": COLOUR}
GLASS = {"Transmission Weight": 1.0, "Base Color": COLOUR}
PRINCIPLED: dict[str, dict[str, Any]] = {
    "default": {},
    "diffuse": {"Base Color": COLOUR, "Specular IOR Level": 0.0},
    "rough diffuse": {"Base Color": COLOUR, "Specular IOR Level": 0.0, "Diffuse Roughness": 0.7},
    "smooth": {"Roughness": 0.1},
    "rough": {"Roughness": 1.0},
    "single scattering": {"Roughness": 0.8, "distribution": 'GGX'},
    "colours above 1": {"Base Color": (1.5, 1.0, 2.0), "Diffuse Roughness": 1.0},
    "specular tint": {"Specular Tint": (1.0, 0.3, 2.0), "Roughness": 0.6},
    "specular level": {"Specular IOR Level": 0.9, "IOR": 1.8},
    "index below 1": {"IOR": 0.8, "Specular IOR Level": 0.9},
    "metal": {"Base Color": COLOUR, "Metallic": 1.0},
    "edge tint": {"Base Color": COLOUR, "Metallic": 0.6, "Specular Tint": (0.2, 0.5, 1.0)},
    "anisotropic": {"Metallic": 0.7, "Anisotropic": 0.7, "Anisotropic Rotation": 0.15}
    | {"Base Color": COLOUR, "Tangent": (1.0, 0.2, 0.1)},
    "coat": COATED,
    "coat tint": COATED | {"Coat Tint": (0.9, 0.4, 0.2), "Coat IOR": 1.8},
    "coat normal": COATED | {"Coat Normal": (0.1, 0.05, 1.0)},
    "sharp coat": COATED | {"Coat Roughness": 0.0},
    "sheen": {"Base Color": COLOUR, "Sheen Weight": 1.0, "Sheen Tint": (1.0, 0.5, 0.2)},
    "sheen on coat": COATED | {"Sheen Weight": 0.7, "Sheen Roughness": 0.25},
    "emission below sheen and coat": COATED
    | {"Sheen Weight": 0.5, "Emission Strength": 0.3, "Emission Color": (1.0, 0.5, 0.2)},
    "alpha": {"Base Color": COLOUR, "Alpha": 0.4},
    "glass": GLASS,
    "half glass": GLASS | {"Transmission Weight": 0.6, "Specular Tint": (0.5, 0.6, 1.0)},
    "single-scattering glass": GLASS | {"IOR": 1.33, "distribution": 'GGX'},
    "black glass": GLASS | {"Base Color": (0.0, 0.0, 0.0)},
    "all": COATED
    | {"Metallic": 0.3, "Sheen Weight": 0.5, "Specular Tint": (1.0, 0.8, 0.6), "Roughness": 0.35}
    | {"Diffuse Roughness": 0.4, "IOR": 1.6, "Transmission Weight": 0.3},
}


def principled(values: dict[str, Any]) -> Closure:
    settings = {"distribution": values.get("distribution", 'MULTI_GGX')}
    given = {name: value for name, value in values.items() if name != "distribution"}
    return Closure("ShaderNodeBsdfPrincipled", given, settings)


CLOSURES = [*closures(), *((name, principled(values)) for name, values in PRINCIPLED.items())]
Pairs = dict[str, list[tuple[np.ndarray, np.ndarray, Closure]]]


@pytest.fixture(scope="module")
def sides() -> Pairs:
    """Return by name, by closure, our values (lights × quads, 3) and Cycles'."""
    rng = np.random.default_rng(5)
    shown: list[list[np.ndarray]] = [[] for _ in CLOSURES]
    for direction in LIGHTS:
        wi = np.array(direction) / np.linalg.norm(direction)
        frames = [closure.frames(wi, QUADS, rng) for _, closure in CLOSURES]
        picture = shot([closure for _, closure in CLOSURES], frames, wi)
        for pairs, (_, closure), quads, row in zip(shown, CLOSURES, frames, picture, strict=True):
            pairs.append(np.stack([closure.ours(quads[:, :, 2], wi), row]))
    found: Pairs = {name: [] for name, _ in CLOSURES}
    for pairs, (name, closure) in zip(shown, CLOSURES, strict=True):
        found[name].append((*np.concatenate(pairs, axis=1), closure))
    return found


def hold(pairs: list[tuple[np.ndarray, np.ndarray, Closure]], pointwise: float) -> None:
    for ours, theirs, closure in pairs:
        bright = theirs.max(axis=1, keepdims=True)
        assert bright.max() > 1e-3, "the test means something"
        worst = np.max(np.abs(ours - theirs) / np.maximum(bright, 0.01 * bright.max()))
        energy = ours.sum() / theirs.sum() - 1.0
        assert worst < pointwise and abs(energy) < ENERGY, (worst, energy, closure)


@pytest.mark.feature("f cosθ of each pixel, at many angles and roughnesses", area="BSDFs")
@pytest.mark.parametrize("name", dict(closures()))
def test_a_closure_is_that_of_cycles(name: str, sides: Pairs) -> None:
    hold(sides[name], POINTWISE)


@pytest.mark.feature("f cosθ of each pixel, at 24 slants under 3 suns", area="Principled")
@pytest.mark.parametrize("name", PRINCIPLED)
def test_principled(name: str, sides: Pairs) -> None:
    hold(sides[name], PRINCIPLED_POINTWISE)


PANES = {
    "mirror": Closure("ShaderNodeBsdfAnisotropic", {"Roughness": 0.0}, {"distribution": 'GGX'}),
    "clear glass": Closure("ShaderNodeBsdfGlass", {"Roughness": 0.0}),
    "rough glass in a world": Closure("ShaderNodeBsdfGlass", {"Roughness": 1.0}),
}


@pytest.mark.feature("a pane's direct light, by two ways of sampling", area="BSDFs")
@pytest.mark.parametrize("name", PANES)
def test_panes_show_what_emits(name: str) -> None:
    empty_scene()
    square("Pane", material("Pane", PANES[name].shader), scale=(2, 2, 1))
    look_at((0, 0, 0), (0.5, 1, 5), lens=60)
    if "world" in name:
        world(Color=(0.4, 0.6, 1.0, 1.0))
    else:
        place = (0.3, -0.8, 4.0 if name == "mirror" else -4.0)
        lamp('AREA', place, (0, 0, 0), size=1.5, shape='DISK')
    off, error = both_sides((24, 24)).energy()
    assert error < 5e-3, "the test means something"
    assert abs(off) < 1e-3 + 3.0 * error
