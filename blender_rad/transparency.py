# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that light passes straight through, and what is left of it behind them."""

import numpy as np

from .arrays import Bools, Floats, Ints
from .rays import Caster
from .scene import Scene
from .shading import Shading
from .surfaces import Geometry, Surface

CUTOFF = 1e-5  # what lets less pass than that lets nothing pass in Cycles


def shaded_layers(scene: Scene) -> int:
    """Return how many surfaces behind each other are lit in Cycles; the next one only glows."""
    most = scene.transparent_max_bounces
    return max(most, 1) if scene.blender_version >= (5, 0) else most + 1


class Transmission:
    """What passes the surfaces of a scene; `caster` meets all that may let some light pass."""

    def __init__(self, scene: Scene, geometry: Geometry, caster: Caster) -> None:
        self._geometry, self.caster = geometry, caster
        materials = scene.materials
        self._share = Shading(scene, geometry, "transmittance")
        self._known = np.array([m.opaque for m in materials], dtype=bool)
        self._most = scene.transparent_max_bounces
        self._leaks = scene.blender_version < (5, 0) or self._most == 0
        self.seen_through = any(m.passes for m in materials)

    def at(self, surface: Surface) -> Floats:
        """Return the share (n, 3) of what lies behind that passes the surface."""
        share = self._share.at(surface)
        share[share.sum(axis=1) < 3.0 * CUTOFF] = 0.0
        return share

    def along(
        self, origins: Floats, directions: Floats, reach: Floats, passed: int, found: Bools
    ) -> tuple[Floats, Ints]:
        """Return what of the light comes through, and what leaves that open.

        Parameters
        ----------
        origins, directions, reach : of n rays; directions to what is not infinitely far end on it.
        passed : surfaces that the camera's rays have passed before.
        found : (n,) whether Cycles' BSDF sampling may find the light.

        Returns
        -------
        The share (n, 3), and the instance (n,) that passes an unknown share of it, -1 for none; the
        share is then the most that may come through.

        Notes
        -----
        Cycles counts the surfaces that the camera's ray has passed, and takes one too many for
        opaque. Before Blender 5, and where none may be passed, its BSDF sampling, which with that
        of lights makes up the whole, lets one more pass: there what comes through is not known.
        """
        share, unknown = np.ones((len(origins), 3)), np.full(len(origins), -1)
        rows = np.arange(len(origins))
        for left in range(max(self._most - passed, 0), -1, -1):
            hits = self.caster.intersect(origins, directions)
            met = np.flatnonzero(hits.distance < reach)
            rows, reach = rows.take(met), reach.take(met)
            before, directions = origins.take(met, axis=0), directions.take(met, axis=0)
            surface = self._geometry.surface(hits.take(met), directions)
            passing = self.at(surface)
            known = self._known.take(surface.material)
            leaking = known & found.take(rows) & (left == 0 and self._leaks)
            passing[(left == 0) & ~leaking] = 0.0
            share[rows[known]] *= passing[known]
            open_, doubt = ~known | leaking, rows[~known | leaking]
            unknown[doubt] = np.where(unknown[doubt] < 0, surface.instance[open_], unknown[doubt])
            going = np.flatnonzero(share.take(rows, axis=0).any(axis=1))
            if not len(going):
                break
            origins = surface.point - surface.geometric_normal * surface.epsilon[:, None]
            finite = np.isfinite(reach)[:, None]
            directions = np.where(finite, directions - (origins - before), directions)
            rows, reach = rows.take(going), reach.take(going)
            origins, directions = origins.take(going, axis=0), directions.take(going, axis=0)
        unknown[~share.any(axis=1)] = -1
        return share, unknown
