# SPDX-License-Identifier: GPL-3.0-or-later
"""What verbs share that read a scene, that make a picture of it, or read lux meters in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..errors import Finding
from . import _values as values
from ._base import Command, option

if TYPE_CHECKING:
    from ..meters import LuxMeter
    from ..scene import Scene

NAMED = f"{', '.join(values.EFFICACIES_LM_W)}, or a number"


@dataclass(frozen=True, kw_only=True)
class SceneCommand(Command):
    """A verb about one file."""

    file: Path = option(
        values.scene_file, "a .blend, .glb or .gltf file", metavar="SCENE", positional=True
    )
    frame: int | None = option(
        values.integer(-values.FRAME_LIMIT, values.FRAME_LIMIT),
        "frame (default: the file's current one)",
    )
    camera: str | None = option(values.text, "camera object (default: the scene's)")
    scene: str | None = option(values.text, "scene (default: the file's active one)")
    view_layer: str | None = option(values.text, "view layer (default: the scene's first)")
    efficacy: float = option(
        values.efficacy,
        f"lm per W of lights without a spectrum: {NAMED}",
        default="photopic",
    )

    def open(self, file: Path, frame: int | None, *, need_camera: bool) -> Any:
        """Open `file` as the options say and return its bpy.types.Scene."""
        from ..bpy_io.open import open_scene

        own = {name: getattr(self, name) for name in ("camera", "scene", "view_layer")}
        return open_scene(file, frame=frame, need_camera=need_camera, **own)


@dataclass(frozen=True, kw_only=True)
class ModelCommand(SceneCommand):
    """A verb that gives lights a meaning."""

    model: Literal["cycles", "physical"] = option(
        values.choice("cycles", "physical"),
        "what lights mean: what Cycles makes of them, or what their units say",
        default="cycles",
    )

    def read(
        self, frame: int | None, *, need_camera: bool = False, **options: Any
    ) -> tuple[Any, Scene]:
        """Open the file and return its bpy.types.Scene, and what we read from it."""
        from ..bpy_io.read import read_scene

        bl_scene = self.open(self.file, frame, need_camera=need_camera)
        return bl_scene, read_scene(bl_scene, model=self.model, **options)


@dataclass(frozen=True, kw_only=True)
class EngineCommand(ModelCommand):
    """A verb that works out the light of a scene."""

    threads: int | None = option(values.integer(1), "processors to use (default: all)")


@dataclass(frozen=True, kw_only=True)
class PictureCommand(EngineCommand):
    """A verb that makes a picture of a scene."""

    resolution: tuple[int, int] | None = option(values.resolution, "pixels (default: the file's)")
    shading: Literal["full", "clay"] = option(
        values.choice("full", "clay"),
        "materials as they are, or all of them Lambert",
        default="full",
    )
    time_limit: float | None = option(
        values.number(0), "take no more samples after S seconds", metavar="S"
    )

    def read(
        self, frame: int | None, *, need_camera: bool = True, **options: Any
    ) -> tuple[Any, Scene]:
        own = {"shading": self.shading, "resolution": self.resolution, "ask": True}
        return super().read(frame, need_camera=need_camera, **own, **options)


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
