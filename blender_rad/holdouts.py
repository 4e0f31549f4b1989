# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that cut a hole into the picture: no light, and no alpha."""

import numpy as np

from .arrays import Floats
from .scene import Scene
from .shading import Shading
from .surfaces import Geometry, Surface
from .transparency import Transmission


class Holdouts:
    """What surfaces take from alpha, if any `exist` that do."""

    def __init__(self, scene: Scene, geometry: Geometry, transmission: Transmission) -> None:
        materials, self._transmission = scene.materials, transmission
        self._whole = np.array([m.held_out for m in materials], dtype=bool)
        self._share = Shading(scene, geometry, "holdout")
        self.exist = any(m.held_out or any(m.holdout) or m.holdout_texture for m in materials)

    def at(self, surface: Surface) -> Floats:
        """Return the share (n, 3): of what is held out whole, all that it does not let pass."""
        share = self._share.at(surface)
        whole = self._whole.take(surface.material)
        if whole.any():
            share[whole] = 1.0 - self._transmission.at(surface)[whole]
        return share
