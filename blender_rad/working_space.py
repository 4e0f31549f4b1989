# SPDX-License-Identifier: GPL-3.0-or-later
"""Working spaces: what an RGB triple weighs in luminance, and how it is shown in another space.

Chromaticities are (x, y) of red, green, blue and white, one after the other, as in EXR files.
"""

from functools import cache

import numpy as np

from .arrays import Floats

_D65 = (0.3127, 0.3290)
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *_D65)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *_D65)
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
# Blender's names; then those in the header `colorInteropID` of its EXR files.
WORKING_SPACES = {"Linear Rec.709": REC709, "Linear Rec.2020": REC2020, "ACEScg": ACESCG}
INTEROP_IDS = {"lin_rec709_scene": REC709, "lin_rec2020_scene": REC2020, "lin_ap1_scene": ACESCG}
_BRADFORD = np.array(  # cone responses from XYZ
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def xyz_from_rgb(chromaticities: tuple[float, ...]) -> Floats:
    """Return the matrix (3, 3) whose columns are the primaries, adding up to white with Y = 1."""
    x, y = np.reshape(chromaticities, (4, 2)).T
    colours = np.stack([x / y, np.ones(4), (1 - x - y) / y])
    primaries, white = colours[:, :3], colours[:, 3]
    return primaries * np.linalg.solve(primaries, white)


@cache
def luminance_weights(chromaticities: tuple[float, ...]) -> tuple[float, float, float]:
    """Return what red, green and blue weigh in luminance; they add up to 1."""
    red, green, blue = xyz_from_rgb(chromaticities)[1]
    return float(red), float(green), float(blue)


def rec709_from_working(chromaticities: tuple[float, ...]) -> Floats:
    """Return the matrix (3, 3) from the working space to linear Rec.709, white to white.

    Whites are adapted by Bradford's transform.
    """
    source, target = xyz_from_rgb(chromaticities), xyz_from_rgb(REC709)
    ones = np.ones(3)
    cones = np.diag((_BRADFORD @ target @ ones) / (_BRADFORD @ source @ ones))
    adapt = np.linalg.solve(_BRADFORD, cones @ _BRADFORD)
    return np.linalg.solve(target, adapt @ source)
