# SPDX-License-Identifier: GPL-3.0-or-later
"""White Principled BSDFs in a white furnace: what they send back of light from everywhere."""

import numpy as np
import pytest

from blender_rad.bsdfs import Inputs, Mixture, lobes

KIND = "ShaderNodeBsdfPrincipled"
POINTS = 4096  # on a lattice, through the lobes' own sampling
GOLDEN = 0.6180339887498949
LOST = 0.015  # at most, where every bounce is given back
WHITE = dict.fromkeys(("Base Color", "Alpha", "Specular Tint", "Coat Tint", "Sheen Tint"), 1.0)
INDICES = {"IOR": 1.5, "Coat IOR": 1.5, "Specular IOR Level": 0.5}
DEFAULTS = WHITE | INDICES | {"Roughness": 0.5, "Coat Roughness": 0.03, "Sheen Roughness": 0.5}
NOTHING = dict.fromkeys(("Metallic", "Anisotropic", "Anisotropic Rotation"), 0.0)
NOTHING |= dict.fromkeys(("Transmission Weight", "Coat Weight", "Sheen Weight"), 0.0)
NOTHING["Diffuse Roughness"] = 0.0
COAT = {"Coat Weight": 1.0, "Coat Roughness": 0.5}
CASES: dict[str, dict[str, float]] = {
    "rough metal": {"Metallic": 1.0, "Roughness": 1.0},
    "strong gloss": {"IOR": 2.0, "Specular IOR Level": 1.0, "Roughness": 0.4},
    "sheen": {"Sheen Weight": 1.0},
    "all": COAT | dict.fromkeys(("Metallic", "Sheen Weight", "Diffuse Roughness"), 0.4),
}


def white(case: dict[str, float], cosine: float, n: int = POINTS) -> Inputs:
    normal = np.tile([0.0, 0.0, 1.0], (n, 1))
    values = {name: np.full((1, 3), x) for name, x in {**NOTHING, **DEFAULTS, **case}.items()}
    return Inputs(
        values={**values, "Coat Normal": normal},
        settings={"distribution": 'MULTI_GGX'},
        weight=np.ones((n, 3)),
        normal=normal,
        geometric=normal,
        wo=np.tile([np.sqrt(1.0 - cosine**2), 0.0, cosine], (n, 1)),
    )


def albedo(case: dict[str, float], cosine: float) -> float:
    mixture = Mixture.of(lobes(KIND, white(case, cosine)))
    place = np.arange(POINTS)
    wi = mixture.sample(np.stack([(place + 0.5) / POINTS, place * GOLDEN % 1.0], axis=1))
    value, density = mixture.evaluate(wi)
    return float(np.mean(value[:, 0] / np.where(density > 0.0, density, np.inf)))


@pytest.mark.parametrize("cosine", (1.0, 0.2))
@pytest.mark.parametrize("case", CASES)
def test_nothing_is_won_and_little_lost(case, cosine):
    assert -LOST < albedo(CASES[case], cosine) - 1.0 < 1e-3
