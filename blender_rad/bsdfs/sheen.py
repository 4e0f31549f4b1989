# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheen BSDF: microfibres, or the velvet of Ashikhmin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._base import BSDFS, Array, Frame, Inputs, Lobe, dot
from ._microfacet import unit
from ._sheen import Sheen


@BSDFS.register("ShaderNodeBsdfSheen")
def sheen(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Sheen BSDF."""
    weight = inputs.weight * np.maximum(inputs.colour("Color"), 0.0)
    rough = inputs.number("Roughness")
    if inputs.settings["distribution"] == 'MICROFIBER':
        return [Sheen.of(weight, inputs.normal, inputs.wo, rough)]
    frame = Frame.around(inputs.normal)
    return [Velvet(weight, frame, frame.local(inputs.wo), np.clip(rough, 0.01, 1.0))]


@dataclass(frozen=True)
class Velvet(Lobe):
    """Faces that stand up, masked as in V-shaped grooves.

        f cosθ_i = D G / (4 cosθ_o)
        D = exp(−cot²θ_m/σ²) / (π σ² sin⁴θ_m)
        G = min(1, 2 m_z o_z/(o·m), 2 m_z i_z/(o·m))

    M. Ashikhmin, S. Premože and P. Shirley, "A Microfacet-based BRDF Generator", 2000.
    It is sampled evenly over the hemisphere, by 1/(2π). Where it samples lights, Cycles takes it
    for glossy, unlike microfibres.

    Attributes
    ----------
    weight : (n, 3).
    frame : z along the normal on the viewer's side.
    wo : (n, 3) towards the viewer, in the frame.
    sigma : (n,) σ.
    """

    weight: Array
    frame: Frame
    wo: Array
    sigma: Array

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        wi, wo = self.frame.local(wi), self.wo
        above = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        m = unit(wi + wo)
        up, seen = m[:, 2], dot(wo, m)
        flat = 1.0 - up * up
        valid = above & (up < 1.0 - 1e-5) & (seen > 1e-5)
        flat, slope = (
            np.where(valid, flat, 1.0),
            2.0 * np.maximum(up / np.maximum(seen, 1e-5), 1e-5),
        )
        shape = np.exp(-(up * up) / (flat * self.sigma**2)) / (np.pi * (self.sigma * flat) ** 2)
        masking = np.minimum(1.0, slope * np.minimum(wo[:, 2], wi[:, 2]))
        value = np.where(valid, 0.25 * shape * masking / np.where(valid, wo[:, 2], 1.0), 0.0)
        return value[:, None], np.where(above, 0.5 / np.pi, 0.0)

    def sample(self, u: Array) -> Array:
        flat, turn = np.sqrt(1.0 - u[:, 0] ** 2), 2.0 * np.pi * u[:, 1]
        local = np.stack([flat * np.cos(turn), flat * np.sin(turn), u[:, 0]]).T
        return self.frame.world(local * ((self.wo[:, 2:] > 0.0) & (local[:, 2:] > 0.0)))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Velvet]:
        n = len(wo)
        return [cls(np.ones((n, 3)), frame, frame.local(wo), np.full(n, s)) for s in (0.3, 1.0)]
