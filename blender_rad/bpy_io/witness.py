# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles as an unbiased witness of direct light."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import RadError
from .clay import make_clay
from .interrupt import interrupt_later
from .materials import Shading
from .quiet import quiet_stdout

WitnessSettings = Literal["reference", "file"]
Progress = Callable[[float], None]

_SAMPLE = re.compile(r"Sample (\d+)/(\d+)")

# What makes the picture one view of the scene at rest in float32, whoever's sampling it has.
_ALWAYS: dict[str, Any] = {
    "render.engine": "CYCLES",
    "render.use_persistent_data": True,  # see `CyclesWitness.render`
    "render.use_compositing": False,
    "render.use_sequencer": False,
    "render.use_motion_blur": False,
    "render.use_multiview": False,
    "render.use_freestyle": False,
    "render.use_stamp": False,
    "render.use_crop_to_border": False,
    "render.image_settings.media_type": "IMAGE",  # from Blender 5
    "render.image_settings.file_format": "OPEN_EXR",
    "render.image_settings.color_mode": "RGBA",
    "render.image_settings.color_depth": "32",
    "render.image_settings.exr_codec": "NONE",
    "render.image_settings.color_management": "FOLLOW_SCENE",
    "cycles.device": "CPU",
    "cycles.use_auto_tile": False,  # tiles go through files
    "cycles.use_layer_samples": "IGNORE",
    "cycles.use_sample_subset": False,
    "cycles.sample_offset": 0,
    "cycles.use_animated_seed": False,
}

# What makes it direct light without bias. The box filter is one pixel wide whatever its setting;
# the file's transparent bounces and light tree stay: neither biases direct light. Blue noise: the
# classic pattern draws from 256 fixed tables, an error that all seeds share (at 64 samples a pixel
# and 8 seeds z² of a frame was 3.1 where 1.4 is due; blue noise kept to it).
_REFERENCE: dict[str, Any] = {
    "cycles.max_bounces": 0,
    "cycles.diffuse_bounces": 0,
    "cycles.glossy_bounces": 0,
    "cycles.transmission_bounces": 0,
    "cycles.volume_bounces": 0,
    "cycles.use_fast_gi": False,
    "cycles.sample_clamp_direct": 0.0,
    "cycles.sample_clamp_indirect": 0.0,
    "cycles.use_denoising": False,
    "cycles.use_adaptive_sampling": False,
    "cycles.use_guiding": False,
    "cycles.film_exposure": 1.0,
    "cycles.pixel_filter_type": "BOX",
    "cycles.use_pixel_jitter": False,  # from Blender 5
    "cycles.sampling_pattern": "BLUE_NOISE",
    "cycles.auto_scrambling_distance": False,
    "cycles.scrambling_distance": 1.0,
    "cycles.light_sampling_threshold": 0.0,
    "cycles.time_limit": 0.0,
    "cycles.use_camera_cull": False,
    "cycles.use_distance_cull": False,
    "cycles.texture_limit_render": "OFF",
}


class CyclesWitness:
    """Cycles' picture of the scene that is open, seed by seed.

    The open scene is the scratch copy: it is changed and never saved.

    Parameters
    ----------
    bl_scene : bpy.types.Scene, opened without scripts. Its first view layer in use renders.
    resolution : (width, height) in pixels; None keeps the file's.
    shading : ``clay`` makes all that reflects Lambert 0.8.
    settings : ``reference`` for unbiased direct light, ``file`` to keep the file's sampling,
        bounces, clamps, denoiser, filter and film.
    threads : number of threads; None leaves it to Blender.

    Attributes
    ----------
    overridden : setting to (the file's value, the value used), for the report.
    kept : setting to (the file's value, the unbiased one), where the file's own are asked for.
    """

    def __init__(
        self,
        bl_scene: Any,
        *,
        resolution: tuple[int, int] | None = None,
        shading: Shading = "full",
        settings: WitnessSettings = "reference",
        threads: int | None = None,
    ) -> None:
        self._bl_scene = bl_scene
        self._resolution, self._shading = resolution, shading
        self._settings, self._threads = settings, threads
        self.overridden: dict[str, tuple[Any, Any]] = {}
        self.kept: dict[str, tuple[Any, Any]] = {}

    def prepare(self) -> None:
        """Make all settings explicit, and the materials clay where that is asked for."""
        wanted = dict(_ALWAYS)
        if self._settings == "reference":
            wanted |= _REFERENCE
        else:
            self.kept = dict(self._differing(_REFERENCE))
        if self._resolution is not None:
            width, height = self._resolution
            wanted |= {"render.resolution_x": width, "render.resolution_y": height}
            wanted |= {"render.resolution_percentage": 100}
        if self._threads is not None:
            wanted |= {"render.threads_mode": "FIXED", "render.threads": self._threads}
        for setting, (before, value) in self._differing(wanted):
            path, name = setting.rsplit(".", 1)
            setattr(self._bl_scene.path_resolve(path), name, value)
            self.overridden[setting] = (before, value)
        self._only_one_layer()
        if self._shading == "clay":
            make_clay()

    def _differing(self, wanted: Mapping[str, Any]) -> Iterator[tuple[str, tuple[Any, Any]]]:
        """Yield the dotted names of settings that are not as wanted, each with both values.

        Those that this Blender does not have are left out.
        """
        for setting, value in wanted.items():
            path, name = setting.rsplit(".", 1)
            owner = self._bl_scene.path_resolve(path)
            if name in owner.bl_rna.properties and getattr(owner, name) != value:
                yield setting, (getattr(owner, name), value)

    def _only_one_layer(self) -> None:
        layers = self._bl_scene.view_layers
        shown = next((layer for layer in layers if layer.use), layers[0])
        for layer in layers:
            if layer.use != (layer == shown):
                self.overridden[f"view_layers[{layer.name!r}].use"] = (layer.use, not layer.use)
                layer.use = not layer.use

    def render(
        self, seed: int, samples: int, progress: Progress | None = None
    ) -> NDArray[np.float32]:
        """Return one picture, (h, w, 4) radiance [W/(m² sr)] and alpha, row 0 at the top.

        Model: persistent data keeps geometry and BVH from one seed to the next; the scene is
        tagged, since Cycles would otherwise repeat the seed before.

        Parameters
        ----------
        seed : of this picture; pictures of different seeds are independent.
        samples : a pixel.
        progress : called with the fraction done, from a thread of Blender's.

        Raises
        ------
        KeyboardInterrupt
            After the picture in work: Cycles cannot be stopped from outside in the background.
        """
        self._bl_scene.cycles.seed, self._bl_scene.cycles.samples = seed, samples
        self._bl_scene.update_tag()
        with tempfile.TemporaryDirectory() as folder, interrupt_later(), _progress(progress):
            file = Path(folder) / "witness.exr"
            with quiet_stdout():
                self._render_to(file)
            return _read(file)

    def _render_to(self, file: Path) -> None:
        try:
            bpy.ops.render.render(scene=self._bl_scene.name)
        except RuntimeError as error:
            said = " ".join(str(error).split()).removeprefix("Error: ")
            where = f"scene {self._bl_scene.name!r}"
            raise RadError("Cycles cannot render", where, f"it says: {said}") from error
        result = next(i for i in bpy.data.images if i.type == 'RENDER_RESULT')
        result.save_render(str(file), scene=self._bl_scene)


def _read(file: Path) -> NDArray[np.float32]:
    import OpenEXR

    with OpenEXR.File(str(file), separate_channels=True) as exr:
        channels = exr.channels()
        return np.stack([channels[name].pixels for name in "RGBA"], axis=-1)


@contextmanager
def _progress(report: Progress | None) -> Generator[None]:
    """Pass on what Cycles says about its samples."""
    if report is None:
        yield
        return

    def listen(said: object, *_: object) -> None:
        if found := _SAMPLE.search(str(said)):
            report(int(found[1]) / int(found[2]))

    handlers = bpy.app.handlers.render_stats
    handlers.append(listen)
    try:
        yield
    finally:
        handlers.remove(listen)
