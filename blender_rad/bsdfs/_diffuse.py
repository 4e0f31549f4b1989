# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse reflection: Lambert's, and rough as Oren and Nayar have it.

Fujii's form of Oren–Nayar (A Tiny Improvement of Oren–Nayar Reflectance Model, 2012), with what
scatters more than once by OpenPBR. With s = o·i − cosθ_o cosθ_i and roughness σ in [0, 1]:

    f = A + B t + C (1 − E(o)) (1 − E(i)),      t = s/max(cosθ_o, cosθ_i) where s > 0, else s
    A = 1/(π + σ (π/2 − 2/3)),  B = σ A,        E(θ) = π A + B G(θ)
    G = sinθ (θ − 2/3 − sinθ cosθ) + 2/3 tanθ (1 − sin³θ)
    C = ρ²/π · Ē/(1 − Ē)/(1 − ρ (1 − Ē)),       Ē = π A + B (2π − 5.6)/3

with the colour ρ in C alone: it is in the weight as well. σ = 0 is Lambert.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._base import Array, Frame, Lobe, dot


def cosine_weighted(u: Array) -> Array:
    """Return directions (n, 3) around z of the density cosθ/π, by column."""
    found = np.empty((len(u), 3), order="F")
    turn, radius = 2.0 * np.pi * u[:, 1], np.sqrt(u[:, 0])
    found[:, 0], found[:, 1] = radius * np.cos(turn), radius * np.sin(turn)
    found[:, 2] = np.sqrt(1.0 - u[:, 0])
    return found


@dataclass(frozen=True)
class Diffuse(Lobe):
    """Rough diffuse reflection.

    Attributes
    ----------
    weight : (n, 3) with the colour.
    frame : z along the normal on the viewer's side.
    wo : (n, 3) towards the viewer.
    roughness : (n,) σ in [0, 1].
    colour : (n, 3) ρ in [0, 1].
    """

    ray = "diffuse"
    weight: Array
    frame: Frame
    wo: Array
    roughness: Array
    colour: Array

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        up, out = (np.maximum(dot(v, self.frame.z), 0.0) for v in (wi, self.wo))
        a = 1.0 / (np.pi + self.roughness * (np.pi / 2.0 - 2.0 / 3.0))
        b = self.roughness * a
        if not b.any():
            return (up / np.pi)[:, None], up / np.pi
        s = dot(wi, self.wo) - up * out
        t = np.where(s > 0.0, s / np.maximum(np.maximum(up, out), 1e-30), s)
        mean = (np.pi * a + b * (2.0 * np.pi - 5.6) / 3.0)[:, None]
        lost = (1.0 - np.pi * a - b * _g(up)) * (1.0 - np.pi * a - b * _g(out))
        rest = lost[:, None] * self.colour**2 / np.pi * mean / np.maximum(1.0 - mean, 1e-9)
        value = (a + b * t)[:, None] + rest / (1.0 - self.colour * (1.0 - mean))
        return value * up[:, None], up / np.pi

    def sample(self, u: Array) -> Array:
        return self.frame.world(cosine_weighted(u))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Diffuse]:
        n = len(wo)
        white = np.ones((n, 3))
        return [cls(white, frame, wo, np.full(n, r), white) for r in (0.0, 0.5, 1.0)]


def _g(cosine: Array) -> Array:
    """Return G at cosθ."""
    c = np.clip(cosine, 1e-6, 1.0)
    s = np.sqrt(1.0 - c * c)
    return s * (np.arccos(c) - 2.0 / 3.0 - s * c) + 2.0 / 3.0 * s / c * (1.0 - s**3)
