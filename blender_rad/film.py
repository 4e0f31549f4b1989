# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that the estimator makes: passes, their errors, and what had to be left out."""

from dataclasses import dataclass, field

import numpy as np

from .arrays import Bools, Floats, Ints, Singles
from .errors import Finding
from .scene import Unsupported

Image = Floats

REST = "(rest)"  # layer of the lights that matter too little for one of their own
STUDENT_18 = 2.101 / 1.960  # 97.5 % quantile of Student's t, 18 degrees of freedom, over normal's


@dataclass(frozen=True)
class Film:
    """Passes of one view, (h, w) or (h, w, 3); row 0 is the top, pixels outside the border are 0.

    `variance` is the unbiased one of the mean of `radiance`; where a single sample tells nothing,
    the square of the value. Pixels are independent: over a pool it adds up.
    """

    radiance: Image  # [W/(m² sr)], premultiplied with `alpha`
    variance: Image
    alpha: Image
    lights: dict[str, Singles]  # by name; with `seen` they add up to `radiance`
    noise: dict[str, Singles]  # draws of theirs: half of what halves of samples differ
    seen: Image  # emission that the camera sees directly: of surfaces and the background
    irradiance: Image  # [W/m²] on the shading normal
    depth: Image  # [m] along the view axis, inf for background
    normal: Image  # in world axes
    samples: Ints  # of the camera, a pixel
    inside: Bools  # the border
    excluded: Bools  # out of the comparison
    excluded_by: dict[Unsupported, int]  # pixels for each cause
    findings: tuple[Finding, ...] = ()
    shown: dict[str, Singles] = field(default_factory=dict)  # of `seen`, by light

    @property
    def standard_error(self) -> Image:
        """Standard error of `radiance`, (h, w, 3) [W/(m² sr)], for ±1.96 of it to cover 95 %.

        A few samples that all see the same thing tell too little of a pixel's own spread, so it is
        taken for no smaller than its neighbours': of 3×3 pixels as they are, and of 5×5, with
        weights that fall outwards and are worth 18, had they as many samples.
        """
        near = neighbourhood_mean(self.variance, self.inside)
        samples = np.maximum(self.samples, 1)[..., None]
        one = neighbourhood_mean(self.variance * samples, self.inside)
        wide = neighbourhood_mean(one, self.inside) / samples
        largest = np.maximum(np.maximum(self.variance, near), wide)
        return STUDENT_18 * np.sqrt(np.where(self.inside[..., None], largest, 0.0))

    @property
    def relative_standard_error(self) -> float:
        """Return sqrt(mean[σ² / (L² + 0.01·mean(L)²)]), the square root of the expected relMSE.

        L is taken for no brighter than the pixels around: what noise has lifted would belittle σ.
        """
        mean = np.mean(self.radiance[self.inside], axis=0)
        lifted = lift(self.radiance.mean(axis=-1), self.inside)[..., None]
        signal = (self.radiance / lifted) ** 2 + 0.01 * mean**2
        ratio = np.divide(self.variance, signal, out=np.zeros_like(self.variance), where=signal > 0)
        return float(np.sqrt(np.mean(ratio[self.inside])))


def lift(values: Image, inside: Bools) -> Image:
    """Return by how much `values` (h, w) exceed the mean of the pixels around, at least 1."""
    near = neighbourhood_mean(values, inside, own=False)
    above = (values > near) & (near > 0.0)
    return np.divide(values, near, out=np.ones_like(values), where=above)


def neighbourhood_mean(values: Image, inside: Bools, *, own: bool = True) -> Image:
    """Return `values` (h, w, ...) averaged over the 3×3 pixels around each, of those `inside`.

    With `own` False a pixel itself does not count, unless it has no neighbours.
    """
    kept = inside.reshape(*inside.shape, *[1] * (values.ndim - 2))
    number = _neighbourhood_sum(kept.astype(float), own=own)
    total = _neighbourhood_sum(np.where(kept, values, 0.0), own=own)
    return np.where(number > 0.0, total / np.maximum(number, 1.0), values)


def _neighbourhood_sum(values: Image, *, own: bool) -> Image:
    padded = np.pad(values, [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)])
    beside = padded[:-2] + padded[2:]
    column = beside + padded[1:-1]
    middle = column if own else beside
    return column[:, :-2] + column[:, 2:] + middle[:, 1:-1]
