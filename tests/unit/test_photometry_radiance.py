# SPDX-License-Identifier: GPL-3.0-or-later
"""IES files against Radiance's reading of them: ies2rad, and rtrace far away."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from blender_rad.photometry import read_photometry

pytestmark = pytest.mark.slow
pyradiance = pytest.importorskip("pyradiance", reason="needs the extra `witnesses`")

FILES = sorted((Path(__file__).parents[3] / "shared" / "data" / "ies").glob("*.[iI][eE][sS]"))
# Its types A and B are not LM-63's; a standing cylinder has no near field in it; and a file that
# is refused.
LEFT_OUT = {"CU__flood_2.1", "photompy__type_a_symmetric", "photompy__type_b_full"}
LEFT_OUT |= {"photompy__type_b_symmetric", "RenderPipeline__bollard", "luxera__tilt_file_variant"}
FAR = 1000.0  # [m]
EFFICACY, WEIGHTS = 179.0, (0.265, 0.670, 0.065)  # Radiance's own


def radiance(*command: str, folder: Path, stdin: str = "") -> bytes:
    """Return what one of Radiance's programs prints; WHITE lamps lose nothing with age."""
    home = Path(pyradiance.__file__).parent
    settings = {**os.environ, "RAYPATH": f".:{home / 'lib'}"}
    program = str(home / "bin" / command[0])
    return subprocess.run(
        [program, *command[1:]],
        cwd=folder,
        env=settings,
        input=stdin.encode(),
        capture_output=True,
        check=True,
    ).stdout


@pytest.mark.parametrize(
    "path", [f for f in FILES if f.stem not in LEFT_OUT] or [None], ids=lambda f: f and f.name
)
def test_intensities_are_those_of_radiance(
    path: Path | None, tmp_path: Path, rng: np.random.Generator
) -> None:
    if path is None:
        pytest.skip("needs the real files, which are not ours")
    light = read_photometry(path)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    radiance("ies2rad", "-dm", "-t", "WHITE", "-o", "lamp", str(path), folder=tmp_path)
    (tmp_path / "lamp.oct").write_bytes(radiance("oconv", "lamp.rad", folder=tmp_path))
    rays = "\n".join(" ".join(map(str, (*(FAR * d), *-d))) for d in directions)
    exact = ("-ab", "0", "-dj", "0", "-ds", "0", "-dt", "0")
    text = radiance("rtrace", "-h", "-I", *exact, "lamp.oct", folder=tmp_path, stdin=rays)
    irradiance = np.array(text.split(), dtype=float).reshape(-1, 3) @ WEIGHTS
    theirs = EFFICACY * irradiance * FAR**2
    ours = light.luminous_intensity(directions) * (1e3 if light.radiometric else 1.0)  # mW/sr
    assert np.abs(theirs - ours).mean() < 1e-3 * ours.mean()
