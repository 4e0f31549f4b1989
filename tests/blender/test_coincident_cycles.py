# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Cycles lets coincident faces shade each other, and that just this is left out."""

import numpy as np
import pytest

from blender_rad.coincidence import coincident_faces, left_out
from blender_rad.direct import DirectLight

from .agreement import both_sides, lamp, look_at
from .reading import SQUARE, add, empty_scene, polygons

OFF = 0.05  # relative, of a pixel


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("at", [0.0, 10.0])
@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4])
def test_what_cycles_confuses_is_left_out(gap: float, at: float, hidden: bool) -> None:
    """A floor with a patch on it that the camera does not see, or close below it."""
    empty_scene()
    turned = {"rotation_euler": (0.1, 0.2, 0.3)}
    add("Floor", polygons("Floor", *SQUARE), scale=(4, 4, 1), location=(at, at, 0), **turned)
    patch = polygons("Patch", *SQUARE)
    place = (at, at, gap if hidden else -gap)
    add("Patch", patch, scale=(1, 0.6, 1), location=place, visible_camera=not hidden, **turned)
    look_at((at, at, 0), (at + 0.5, at - 5, 4), lens=80)
    lamp('POINT', (at + 0.3, at + 0.4, 3), (at, at, 0), shadow_soft_size=0.1)
    sides = both_sides((36, 24), ours=128, samples=32)
    ours, theirs = sides.film.radiance.mean(axis=-1), sides.seeds[..., :3].mean(axis=(0, 3))
    wrong = np.abs(theirs - ours) > OFF * ours.max()
    masks = coincident_faces(DirectLight(sides.scene))
    excluded = left_out(sides.film, masks).excluded
    assert not (wrong & ~excluded).any()
    assert excluded.any() == (gap < 1e-5)
    if gap == 0.0:
        assert wrong[excluded].mean() > 0.7


def test_what_cycles_gives_a_doubled_wall_is_chance() -> None:
    """Turned by a milliradian, which changes no more than a hundredth of its light."""
    sums = []
    for turn in (0.0, 1e-3):
        empty_scene()
        wall = polygons("Wall", *SQUARE)
        for name in ("Wall", "Again"):
            placed = {"location": (0.3, 0.2, 0.1), "rotation_euler": (1.2 + turn, turn, 0.4)}
            add(name, wall, scale=(3, 2, 1), **placed)
        look_at((0.3, 0.2, 0.1), (1, -6, 3), lens=60)
        lamp('POINT', (1, -2, 3), shadow_soft_size=0.1)
        sides = both_sides((24, 16), ours=32, seeds=2, samples=32)
        sums.append((sides.film.radiance.sum(), sides.seeds[..., :3].sum()))
    ours, theirs = np.divide(*sums)
    assert abs(ours - 1.0) < 0.01
    assert abs(theirs - 1.0) > 0.1
