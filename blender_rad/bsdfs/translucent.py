# SPDX-License-Identifier: GPL-3.0-or-later
"""Translucent BSDF: Lambert's law for the light of the other side, f = 1/π for cosθ_i < 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ._base import BSDFS, Array, Frame, Inputs, Lobe


@dataclass(frozen=True)
class Translucent(Lobe):
    """Lambert's lobe below the surface.

    Attributes
    ----------
    weight : (n, 3) its transmittance.
    frame : z along the normal on the viewer's side.
    """

    transmits: ClassVar[bool] = True
    ray = "diffuse"  # as Cycles has it where it samples lights
    weight: Array
    frame: Frame

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        value = np.maximum(-np.sum(wi * self.frame.z, axis=1), 0.0) / np.pi
        return value[:, None], value

    def sample(self, u: Array) -> Array:
        turn, radius = 2.0 * np.pi * u[:, 1], np.sqrt(u[:, 0])
        local = np.empty((len(u), 3), order="F")
        local[:, 0], local[:, 1] = radius * np.cos(turn), radius * np.sin(turn)
        local[:, 2] = -np.sqrt(1.0 - u[:, 0])
        return self.frame.world(local)

    def at(self, rows: NDArray[np.int64]) -> Translucent:
        return Translucent(self.weight[rows], Frame(*(axis[rows] for axis in self.frame)))

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Translucent]:
        return [cls(np.full((len(wo), 3), 0.8), frame)]


@BSDFS.register("ShaderNodeBsdfTranslucent")
def translucent(inputs: Inputs) -> Sequence[Lobe]:
    """Return the lobe of a Translucent BSDF."""
    return [Translucent(inputs.weight * inputs.colour("Color"), Frame.around(inputs.normal))]
