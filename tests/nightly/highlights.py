# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.nightly.highlights``: sharp and broad highlights, ours against Cycles.

The place on a ball that mirrors a spot or a glowing panel on GGX, or the small sun of an
environment image on metal, at roughness 0.05, 0.3 and 1, fills the view. Told are how far the
energies of both pictures are apart, with the standard error of that, and relMSE (CONTRACT.md's) of
both at 16 and 64 samples a pixel, against the mean of what both have converged to. A case agrees
if the energies are shown to lie within 0.5 %, and at 64 samples our relMSE is at most 1.5 times
Cycles'. Of few samples more is lost: ours are dealt to two independent sequences, for error bars.
"""

import argparse
from typing import Any

import bpy
import numpy as np

from blender_rad.bpy_io.read import read_scene
from blender_rad.bpy_io.witness import CyclesWitness
from blender_rad.compare.metrics.relative import relmse
from blender_rad.rendering import Settings, render
from tests.blender.agreement import Sides, lamp, look_at
from tests.blender.reading import (
    SQUARE,
    add,
    empty_scene,
    material,
    node,
    polygons,
    sphere,
    with_nodes,
    world,
)
from tests.blender.test_world_cycles import picture

LENSES = {0.05: 2500.0, 0.3: 400.0, 1.0: 200.0}  # [mm] that a highlight of that roughness fills
SIZE = (32, 24)
SEEDS, PICTURES = 8, 4  # of Cycles' energy; that relMSE is the mean over
FEW = (16, 64)  # their samples a pixel
WITHIN, SIGMAS = 0.005, 2.0  # of the energy
NOISIER = 1.5
BALL, RADIUS, LAMP, EYE = np.array([0.1, 0.0, 0.8]), 0.8, (-1.0, -1.2, 2.5), (0.5, -6.0, 3.0)
SKY, TEXEL = np.array([128, 64]), np.array([90, 45])


def build(kind: str, roughness: float) -> Any:
    empty_scene()
    glossy, principled = "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfPrincipled"
    shown, source = material("Shown", glossy, Roughness=roughness), np.array(LAMP)
    if kind == "spot":
        lamp('SPOT', LAMP, (0.1, 0.0, 0.7), shadow_soft_size=0.1, spot_size=1.0)
    elif kind == "panel":
        panel = add("Panel", polygons("Panel", *SQUARE), location=LAMP, scale=(0.1,) * 3)
        panel.rotation_euler = (0.6, -0.5, 0.2)
        panel.data.materials[0] = material("Glow", "ShaderNodeEmission", Strength=100.0)
    else:
        shown = material("Shown", principled, Metallic=1.0, Roughness=roughness)
        tree = with_nodes(world())
        image = node(tree, "ShaderNodeTexEnvironment")
        image.image = picture(tuple(SKY), tuple(TEXEL))
        tree.links.new(image.outputs[0], tree.nodes["Background"].inputs[0])
        azimuth, elevation = (2 * np.pi, np.pi) * ((TEXEL + 0.5) / SKY - 0.5)
        level = np.cos(elevation)
        source = 1e6 * np.array(
            [level * np.cos(azimuth), -level * np.sin(azimuth), np.sin(elevation)]
        )
    for name, mesh, place in (
        ("Floor", polygons("Floor", *SQUARE), {"scale": (3, 3, 1)}),
        ("Ball", sphere("Ball", 32, 20), {"location": BALL, "scale": (RADIUS,) * 3}),
    ):
        add(name, mesh, **place).data.materials[0] = shown
    look_at(mirror(source), EYE, lens=LENSES[roughness])
    return bpy.context.scene


def mirror(source: np.ndarray) -> tuple[float, ...]:
    """Return the place on the ball where the eye sees a source."""
    place = BALL
    for _ in range(20):
        ways = [to / np.linalg.norm(to) for to in (source - place, np.array(EYE) - place)]
        place = BALL + RADIUS * sum(ways) / np.linalg.norm(sum(ways))
    return tuple(place.tolist())


def compare(kind: str, roughness: float, samples: int) -> bool:
    """Print a line about one highlight; return whether it agrees."""
    bl_scene = build(kind, roughness)
    scene = read_scene(bl_scene, resolution=SIZE, ask=True)
    witness = CyclesWitness(bl_scene, resolution=SIZE)
    witness.prepare()
    film = render(scene, Settings(samples=2 * samples, per_light=False))
    seeds = np.stack([witness.render(s + 1, samples) for s in range(SEEDS)])
    off, error = Sides(scene, film, seeds).energy()
    mean = 0.5 * (seeds[..., :3].mean(axis=0, dtype=np.float64) + film.radiance)
    noise = np.zeros((2, len(FEW)))
    for seed in range(SEEDS + 1, SEEDS + 1 + PICTURES):
        for k, few in enumerate(FEW):
            ours = render(scene, Settings(samples=few, per_light=False, seed=seed)).radiance
            theirs = witness.render(seed, few)[..., :3].astype(np.float64)
            noise[:, k] += np.array([relmse(ours, mean), relmse(theirs, mean)]) / PICTURES
    agrees = abs(off) + SIGMAS * error < WITHIN and noise[0, -1] <= NOISIER * noise[1, -1]
    told = "".join(f"{value:10.1e}" for value in noise.T.flat)
    said = "agrees" if agrees else "differs"
    off, error = 100.0 * off, 100.0 * error
    print(f"{kind:12}{roughness:9}{off:11.3f} ± {error:.3f} %{told}  {said}", flush=True)
    return agrees


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--samples", type=int, default=256, help="a pixel and seed of Cycles")
    options = parser.parse_args()
    columns = "".join(f"{name:>10}" for few in FEW for name in (f"ours, {few}", "Cycles"))
    print(f"{'light':12}{'roughness':>9}{'Cycles over ours':>21}{columns}")
    kinds = ("spot", "panel", "environment")
    agree = [compare(kind, r, options.samples) for kind in kinds for r in LENSES]
    return 0 if all(agree) else 1


if __name__ == "__main__":
    raise SystemExit(main())
