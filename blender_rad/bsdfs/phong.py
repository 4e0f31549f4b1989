# SPDX-License-Identifier: GPL-3.0-or-later
"""The lecture's Phong as printed, and what makes BRDFs of it. R mirrors ω_o, H halves ω_i and ω_o.

As printed, I = I_L k_d (N·L) + I_L k_r (R·V)ⁿ. A lamp's irradiance is E = I_L (N·L), so the BRDF is
f = dL_r/dE = k_d + k_r (R·V)ⁿ/(N·L). Here k_d is Lambert's albedo/π and belongs in
`Material.albedo`, as π k_d: above 1 for k_d > 1/π. The highlight divides by the cosine of one side
alone, hence is not reciprocal. Of a beam at θ_i it reflects k_r/cosθ_i ∫ (R·V)ⁿ cosθ_r dω_r:
2π/(n + 2) k_r at θ_i = 0, and more without bound towards grazing.

Closures of these kinds are for scenes built by hand: Blender has no such node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Self

import numpy as np

from ._base import BSDFS, Array, Frame, Inputs, Lobe, dot


@dataclass(frozen=True)
class Phong(Lobe):
    """The highlight as printed: f cosθ_i = (R·ω_i)ⁿ.

    Attributes
    ----------
    weight : (n, 3) k_r.
    exponent : (n,).
    frame : z along the normal on the viewer's side.
    wo : (n, 3) towards the viewer.
    """

    reciprocal: ClassVar[bool] = False
    conserves: ClassVar[bool] = False
    weight: Array
    exponent: Array
    frame: Frame
    wo: Array

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        """Return them; R is sampled around by p = (n + 1)/(2π) (R·ω_i)ⁿ."""
        above = dot(wi, self.frame.z)
        power = np.maximum(dot(wi, self._mirrored()), 0.0) ** self.exponent
        power = np.where(above > 0.0, power, 0.0)
        return self._scaled(power, above)[:, None], (self.exponent + 1.0) / (2.0 * np.pi) * power

    def _scaled(self, power: Array, cosine: Array) -> Array:
        """Return f cosθ_i of (R·ω_i)ⁿ and cosθ_i, both (n,)."""
        return power

    def sample(self, u: Array) -> Array:
        wi = self._around(self._mirrored(), u)
        wi[dot(wi, self.frame.z) <= 0.0] = 0.0
        return wi

    def _mirrored(self) -> Array:
        return 2.0 * dot(self.wo, self.frame.z)[:, None] * self.frame.z - self.wo

    def _around(self, axis: Array, u: Array) -> Array:
        """Return directions (n, 3) about `axis` by (n + 1)/(2π) cosⁿ: P(cos > c) = 1 − cⁿ⁺¹."""
        cos = np.exp(np.log1p(-u[:, 0]) / (self.exponent + 1.0))
        sin, turn = np.sqrt(np.maximum(1.0 - cos * cos, 0.0)), 2.0 * np.pi * u[:, 1]
        local = np.empty((len(u), 3), order="F")
        local[:, 0], local[:, 1], local[:, 2] = sin * np.cos(turn), sin * np.sin(turn), cos
        return Frame.around(axis).world(local)

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Self]:
        return [cls(np.ones((len(wo), 3)), np.full(len(wo), n), frame, wo) for n in (1.0, 20.0)]


@dataclass(frozen=True)
class ModifiedPhong(Phong):
    """Phong with the cosine that its BRDF lacks: f = (n + 2)/(2π) (R·ω_i)ⁿ.

    Reciprocal, as R·ω_i mirrors either. Its albedo is 1 at θ = 0, where ∫ cosⁿ⁺¹ dω = 2π/(n + 2),
    and less elsewhere.
    E. Lafortune, Y. Willems, "Using the Modified Phong Reflectance Model for Physically Based
    Rendering", Report CW197, KU Leuven, 1994.
    """

    reciprocal: ClassVar[bool] = True
    conserves: ClassVar[bool] = True

    def _scaled(self, power: Array, cosine: Array) -> Array:
        return (self.exponent + 2.0) / (2.0 * np.pi) * power * np.maximum(cosine, 0.0)


@dataclass(frozen=True)
class Blinn(ModifiedPhong):
    """The half vector's highlight (J. Blinn, SIGGRAPH 1977): f = C (N·H)ⁿ.

    C makes the albedo 1 at θ = 0, where N·H = cos(θ_i/2): with c = cos(θ_i/2) and cosθ_i = 2c² − 1,
    ∫ cⁿ cosθ_i dω = 8π ∫ cⁿ⁺¹ (2c² − 1) dc over [√½, 1] = 8π (n + 2^(−n/2))/((n + 2)(n + 4)).
    Elsewhere it is less.
    """

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        """Return them; H is sampled by (n + 1)/(2π) (N·H)ⁿ, and dω_i = 4 (ω_o·H) dω_H."""
        n, above = self.exponent, dot(wi, self.frame.z)
        half = wi + self.wo
        length = np.maximum(np.sqrt(dot(half, half)), 1e-9)
        cosine = np.minimum(np.maximum(dot(half, self.frame.z) / length, 0.0), 1.0)
        power = np.where(above > 0.0, cosine**n, 0.0)
        scale = (n + 2.0) * (n + 4.0) / (8.0 * np.pi * (n + 0.5 ** (0.5 * n)))
        density = (n + 1.0) / (4.0 * np.pi) * power / length  # ω_o·H is half of that length
        return (scale * power * np.maximum(above, 0.0))[:, None], density

    def sample(self, u: Array) -> Array:
        half = self._around(self.frame.z, u)
        wi = 2.0 * dot(half, self.wo)[:, None] * half - self.wo
        wi[dot(wi, self.frame.z) <= 0.0] = 0.0
        return wi


def _lobes(cls: type[Phong], inputs: Inputs) -> Sequence[Lobe]:
    weight, frame = inputs.weight * inputs.colour("Color"), Frame.around(inputs.normal)
    return [cls(weight, inputs.number("Exponent"), frame, inputs.wo)]


for _kind, _class in {"PHONG": Phong, "PHONG_MODIFIED": ModifiedPhong, "BLINN": Blinn}.items():
    BSDFS.register(_kind)(partial(_lobes, _class))
