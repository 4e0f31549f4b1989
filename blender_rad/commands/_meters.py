# SPDX-License-Identifier: GPL-3.0-or-later
"""What `measure` and `solve` share: a lux meter for the file that they are about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import Finding
from . import _values as values
from ._base import option
from ._scene import EngineCommand

if TYPE_CHECKING:
    from ..meters import LuxMeter


@dataclass(frozen=True, kw_only=True)
class MeterCommand(EngineCommand):
    """A verb that reads lux meters."""

    error: float = option(values.number(0), "target relative standard error", default=0.001)

    def lux_meter(self) -> tuple[Any, LuxMeter]:
        """Open the file; return its bpy.types.Scene and a meter for it."""
        from ..meters import LuxMeter

        bl_scene, scene = self.read(self.frame)
        efficacy, error, threads = self.efficacy, self.error, self.threads
        return bl_scene, LuxMeter(scene, efficacy=efficacy, error=error, threads=threads)

    @staticmethod
    def scene_findings(meter: LuxMeter) -> list[Finding]:
        """Return what is to be known of the meter's scene."""
        message = "no light in the scene: all meters read 0"
        nothing = [] if meter.names else [Finding("nothing-emits", "warning", "", message)]
        return [*meter.scene.findings, *nothing]
