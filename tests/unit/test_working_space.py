# SPDX-License-Identifier: GPL-3.0-or-later
"""Working spaces against colour-science and a published matrix."""

from __future__ import annotations

import numpy as np
import pytest

from blender_rad.working_space import (
    ACESCG,
    REC709,
    WORKING_SPACES,
    luminance_weights,
    rec709_from_working,
)


@pytest.mark.filterwarnings("ignore:.*related API features are not available")
@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("Linear Rec.709", "ITU-R BT.709"),
        ("Linear Rec.2020", "ITU-R BT.2020"),
        ("ACEScg", "ACEScg"),
    ],
)
def test_luminance_weights_follow_from_the_chromaticities(name: str, published: str) -> None:
    import colour

    space = colour.RGB_COLOURSPACES[published]
    corners = [*space.primaries.reshape(-1), *space.whitepoint]
    np.testing.assert_allclose(WORKING_SPACES[name], corners, atol=1e-5)
    xyz = colour.normalised_primary_matrix(space.primaries, space.whitepoint)
    np.testing.assert_allclose(luminance_weights(WORKING_SPACES[name]), xyz[1], atol=2e-6)


def test_working_space_is_turned_into_rec709() -> None:
    # The published matrix from ACEScg to linear sRGB (Bradford), to its printed digits.
    expected = [
        [1.70505, -0.62179, -0.08326],
        [-0.13026, 1.14080, -0.01055],
        [-0.02400, -0.12897, 1.15297],
    ]
    np.testing.assert_allclose(rec709_from_working(ACESCG), expected, atol=2e-5)
    np.testing.assert_allclose(rec709_from_working(REC709), np.eye(3), atol=1e-12)
