# SPDX-License-Identifier: GPL-3.0-or-later
"""Light linking: which instances a light lights, and which of them shadow it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from .arrays import Bools, Ints
from .rays import Caster
from .scene import Linking, Scene

if TYPE_CHECKING:
    from .direct import Visibility
    from .transparency import Transmission


class Blockers(NamedTuple):
    """What hides a light: what stops its rays for certain, and what lets some of it pass."""

    opaque: Caster
    transmission: Transmission


class Links:
    """The linking of a scene's lights by their names; those without it are linked to all."""

    def __init__(self, scene: Scene, visibility: Visibility, transmission: Transmission) -> None:
        self._linking: Mapping[str, Linking] = scene.linking
        self._all = Blockers(visibility.opaque, transmission)
        partly = {name: each for name, each in scene.linking.items() if not each.shadowing.all()}
        alike = {each.shadowing.tobytes(): each.shadowing for each in partly.values()}
        made = {k: _among(scene, visibility, transmission, own) for k, own in alike.items()}
        self._blockers = {name: made[each.shadowing.tobytes()] for name, each in partly.items()}

    def blockers(self, light: str) -> Blockers:
        """Return what hides the light of that name."""
        return self._blockers.get(light, self._all)

    def lights_others(self, light: str) -> bool:
        """Return whether the light is for what is no instance of the scene, such as a meter."""
        linking = self._linking.get(light)
        return linking is None or bool(linking.lit[-1])

    def unlit(self, light: str, instance: Ints) -> Bools | None:
        """Return (n,) whether the light is not for points on the instances; None where it is."""
        linking = self._linking.get(light)
        if linking is None or linking.lit.all():
            return None
        return ~linking.lit.take(instance, mode="clip")


def _among(
    scene: Scene, visibility: Visibility, transmission: Transmission, chosen: Bools
) -> Blockers:
    """Return what of the scene's blockers is chosen."""
    opaque, passing = (
        Caster(scene.meshes, scene.instances, [k for k in every if chosen[k]])
        for every in (visibility.stopping, visibility.letting)
    )
    through = copy.copy(transmission)
    through.caster = passing
    return Blockers(opaque, through)
