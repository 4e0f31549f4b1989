# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report is made of."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Bools
from ..film import Image
from ..working_space import REC709


@dataclass(frozen=True)
class ReportData:
    """A finished comparison: the document of `report.json` and the pictures behind it.

    Pictures are (h, w, 3) or (h, w), row 0 at the top.
    """

    document: Mapping[str, Any]
    ours: Image  # scene-linear radiance [W/(m² sr)]
    witness: Image
    excluded: Bools  # pixels out of the comparison
    inside: Bools  # the render border
    variance_ours: Image
    variance_witness: Image | None  # None where it is not known
    luminance_weights: tuple[float, float, float]  # of the working space
    efficacy_lm_W: float  # noqa: N815 - the unit's own spelling
    chromaticities: tuple[float, ...] = REC709
    witness_name: str = "Cycles"

    def luminance(self, radiance: Image) -> Image:
        """Return luminance [cd/m²], (h, w), of `radiance` (h, w, 3); what is not finite is 0."""
        values = self.efficacy_lm_W * (radiance @ np.asarray(self.luminance_weights))
        return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)

    @functools.cached_property
    def compared(self) -> Bools:
        """Pixels that take part: inside, not excluded, finite on both sides; (h, w)."""
        finite = np.isfinite(self.ours).all(axis=2) & np.isfinite(self.witness).all(axis=2)
        return self.inside & ~self.excluded & finite
