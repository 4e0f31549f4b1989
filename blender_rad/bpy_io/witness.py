# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles as an unbiased witness of direct light."""

import re
import tempfile
from collections.abc import Callable, Collection, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np

from ..arrays import Singles
from ..errors import RadError
from ..exr import read_planes
from .clay import make_clay
from .materials import Shading
from .quiet import interrupt_later, quiet_stdout, told

WitnessSettings = Literal["reference", "file"]
Progress = Callable[[float], None]
Pictures = Singles

_SAMPLE = re.compile(r"Sample (\d+)/(\d+)")


def _each(form: str, names: str, value: Any) -> dict[str, Any]:
    return {form.format(name): value for name in names.split()}


# What makes the picture one view of the scene at rest in float32, whoever's sampling it has.
_ALWAYS: dict[str, Any] = {
    "render.engine": "CYCLES",
    "render.use_persistent_data": True,  # see `CyclesWitness.render`
    **_each("render.use_{}", "compositing sequencer motion_blur multiview freestyle stamp", False),
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
    "cycles.use_sample_subset": True,  # see `CyclesWitness._channels`
    "cycles.use_animated_seed": False,
}

# What makes it direct light without bias. The box filter is one pixel wide whatever its setting;
# the file's transparent bounces and light tree stay: neither biases direct light. Blue noise: the
# classic pattern draws from 256 fixed tables, an error that all seeds share (at 64 samples a pixel
# and 8 seeds z² of a frame was 3.1 where 1.4 is due; blue noise kept to it). Pixel jitter is from
# Blender 5.
_REFERENCE: dict[str, Any] = {
    **_each("cycles.{}_bounces", "max diffuse glossy transmission volume", 0),
    **_each("cycles.use_{}", "fast_gi denoising adaptive_sampling guiding pixel_jitter", False),
    **_each("cycles.use_{}_cull", "camera distance", False),
    **_each("cycles.sample_clamp_{}", "direct indirect", 0.0),
    **_each("cycles.{}", "light_sampling_threshold time_limit", 0.0),
    "cycles.auto_scrambling_distance": False,
    "cycles.film_exposure": 1.0,
    "cycles.pixel_filter_type": "BOX",
    "cycles.sampling_pattern": "BLUE_NOISE",
    "cycles.scrambling_distance": 1.0,
    "cycles.texture_limit_render": "OFF",
}

# Those of them that change the light, by what they are called, in the order to take them back in:
# what acts on samples first, what acts on the whole picture last.
BIASING = {
    "clamp-direct": ("cycles.sample_clamp_direct",),
    "clamp-indirect": ("cycles.sample_clamp_indirect",),
    "fast-gi": ("cycles.use_fast_gi",),
    "bounces": tuple(setting for setting in _REFERENCE if setting.endswith("_bounces")),
    "denoising": ("cycles.use_denoising",),
    "adaptive-sampling": ("cycles.use_adaptive_sampling",),
    "texture-limit": ("cycles.texture_limit_render",),
    "culling": ("cycles.use_camera_cull", "cycles.use_distance_cull"),
    "pixel-filter": ("cycles.pixel_filter_type",),
    "film-exposure": ("cycles.film_exposure",),
}


@dataclass
class CyclesWitness:
    """Cycles' picture of the scene that is open, seed by seed.

    The open scene is the scratch copy: it is changed and never saved. With settings ``file`` it
    keeps its sampling, bounces, clamps, denoiser, filter and film; ``reference`` is direct light
    without bias. Settings are told as (the file's value, the one used or unbiased) by their path.
    """

    bl_scene: Any  # opened without scripts; its first view layer in use renders
    _: KW_ONLY
    resolution: tuple[int, int] | None = None  # (width, height) in pixels; None is the file's
    shading: Shading = "full"
    settings: WitnessSettings = "reference"
    threads: int | None = None  # None leaves it to Blender
    overridden: dict[str, tuple[Any, Any]] = field(default_factory=dict)  # what `prepare` changed
    kept: dict[str, tuple[Any, Any]] = field(default_factory=dict)  # what is not unbiased

    def prepare(self) -> None:
        """Make all settings explicit, and the materials clay where that is asked for."""
        wanted = dict(_ALWAYS)
        if self.settings == "reference":
            wanted |= _REFERENCE
        else:
            self.kept = dict(self._differing(_REFERENCE))
        if self.resolution is not None:
            for name, value in zip(("x", "y", "percentage"), (*self.resolution, 100), strict=True):
                wanted[f"render.resolution_{name}"] = value
        if self.threads is not None:
            wanted |= {"render.threads_mode": "FIXED", "render.threads": self.threads}
        for setting, (before, value) in self._differing(wanted):
            self._set(setting, value)
            self.overridden[setting] = (before, value)
        layers = self.bl_scene.view_layers
        shown = next((layer for layer in layers if layer.use), layers[0])
        for layer in layers:
            if layer.use != (layer == shown):
                self.overridden[f"view_layers[{layer.name!r}].use"] = (layer.use, not layer.use)
                layer.use = not layer.use
        if self.shading == "clay":
            make_clay()

    def _set(self, setting: str, value: Any) -> None:
        path, name = setting.rsplit(".", 1)
        setattr(self.bl_scene.path_resolve(path), name, value)

    def pictures(self, count: int, samples: int) -> Pictures:
        """Return the radiance (s, h, w, 3) of the seeds 1 to `count`."""
        return np.stack([self.render(seed + 1, samples)[..., :3] for seed in range(count)])

    def taken_back(
        self, pictures: Pictures, samples: int, kept: Collection[str] = ()
    ) -> Iterator[tuple[str, dict[str, Any], Pictures, Pictures]]:
        """Take back the file's settings that change the light, one after the other, for good.

        Yield the code of each, the file's own values, and the same seeds' pictures (s, h, w, 3)
        with and without it. Those whose code is in `kept` stay. `pictures` are of the seeds 1 to s
        with all of them: what each does adds up to what they all do.
        """
        for code, settings in BIASING.items():
            own = {setting: self.kept[setting] for setting in settings if setting in self.kept}
            if not own or code in kept:
                continue
            for setting, (_, unbiased) in own.items():
                self._set(setting, unbiased)
            after = self.pictures(len(pictures), samples)
            yield code, {setting: value for setting, (value, _) in own.items()}, pictures, after
            pictures = after

    def _differing(self, wanted: Mapping[str, Any]) -> Iterator[tuple[str, tuple[Any, Any]]]:
        """Yield settings of this Blender that are not as wanted, each with both values."""
        for setting, value in wanted.items():
            path, name = setting.rsplit(".", 1)
            owner = self.bl_scene.path_resolve(path)
            if name in owner.bl_rna.properties and getattr(owner, name) != value:
                yield setting, (getattr(owner, name), value)

    def render(self, seed: int, samples: int, progress: Progress | None = None) -> Singles:
        """Return one picture, (h, w, 4) radiance [W/(m² sr)] and alpha, row 0 at the top.

        Pictures of different seeds are independent; `samples` are a pixel's. Persistent data keeps
        geometry and BVH from one seed to the next; the scene is tagged, since Cycles would
        otherwise repeat the seed before. `progress` is called with the fraction done, from a
        thread of Blender's. `KeyboardInterrupt` comes after the picture in work: Cycles cannot be
        stopped from outside in the background.
        """
        channels = self._channels(seed, samples, progress)
        picture = np.stack([channels[name] for name in "RGBA"], axis=-1)
        if not picture.any() and not self.bl_scene.render.film_transparent:
            where = f"scene {self.bl_scene.name!r}"
            expected = "expected some alpha at least; is there memory for it?"
            raise RadError("Cycles gave an empty picture", where, expected)
        return picture

    def layers(self) -> dict[str, Singles]:
        """Return all passes of one sample a pixel by name, such as "View layer.Depth.V"."""
        output = self.bl_scene.render.image_settings
        if hasattr(output, "media_type"):  # from Blender 5
            output.media_type = 'MULTI_LAYER_IMAGE'
        output.file_format = 'OPEN_EXR_MULTILAYER'
        return self._channels(0, 1)

    def _channels(
        self, seed: int, samples: int, progress: Progress | None = None
    ) -> dict[str, Singles]:
        """Leave out Cycles' first samples: the very first goes through the pixel's centre."""
        cycles, skipped = self.bl_scene.cycles, samples if samples > 1 else 0
        cycles.seed, cycles.samples = seed, skipped + samples
        cycles.sample_offset, cycles.sample_subset_length = skipped, samples
        self.bl_scene.update_tag()
        with tempfile.TemporaryDirectory() as folder, interrupt_later():
            file = Path(folder) / "witness.exr"
            with quiet_stdout():
                self._render_to(file, progress)
            return read_planes(file)[0]

    def _render_to(self, file: Path, progress: Progress | None) -> None:
        where = f"scene {self.bl_scene.name!r}"
        finished: list[object] = []

        def said(stats: object, *_: object) -> None:
            if progress and (found := _SAMPLE.search(str(stats))):
                progress(int(found[1]) / int(found[2]))

        handlers = bpy.app.handlers
        with (
            _handled(handlers.render_stats, said),
            _handled(handlers.render_complete, lambda *_: finished.append(True)),
        ):
            try:
                bpy.ops.render.render(scene=self.bl_scene.name)
            except RuntimeError as error:
                raise RadError("Cycles cannot render", where, f"it says: {told(error)}") from error
        if not finished:
            raise RadError("Cycles stopped before the picture was done", where, "expected it whole")
        result = next(i for i in bpy.data.images if i.type == 'RENDER_RESULT')
        result.save_render(str(file), scene=self.bl_scene)


@contextmanager
def _handled(handlers: Any, listener: Callable[..., object]) -> Generator[None]:
    handlers.append(listener)
    try:
        yield
    finally:
        handlers.remove(listener)
