# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: coarse at once, then ever finer, on a thread that knows no Blender."""

from __future__ import annotations

import copy
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from . import live

if TYPE_CHECKING:
    from ..blender_rad.direct import DirectLight
    from ..blender_rad.film import Film
    from ..blender_rad.scene import Camera, Scene

COARSE = (8, 3)  # pixels of the screen a pixel of the first pictures
BETWEEN_PICTURES_S = 0.25

log = logging.getLogger(__name__)


class Viewport:
    """One region's picture, made by a thread and taken by whoever draws."""

    def __init__(self, redraw: Callable[[], None]) -> None:
        self.film: Film | None = None  # the newest
        self.error = 0.0  # its relative standard error
        self.scene: Scene | None = None
        self.refining = False  # whether there are better ones to come
        # Of which film, drawn how, and the texture itself:
        self.texture: tuple[object, object, Any] = (None, None, None)
        self._redraw = redraw
        self._light: DirectLight | None = None
        self._seen: object = None
        self._cancel, self._thread = threading.Event(), threading.Thread()

    def read(self, depsgraph: Any) -> None:
        """Take the scene as it is now."""
        scene = live.scene_of(depsgraph, depsgraph.scene.radiometric.shading)
        if scene is not self.scene:
            self.stop()
            self.scene, self._light, self._seen = scene, None, None

    def look(self, camera: Camera, size: tuple[int, int], error: float) -> None:
        """Begin to render this view, unless it is the one that is rendered already."""
        seen = (camera.world_from_camera.tobytes(), camera.plane, camera.clip, camera.aperture)
        seen = (*seen, size, error)
        if self.scene is None or seen == self._seen:
            return
        self.stop()
        self._seen, self._cancel, self.refining = seen, threading.Event(), True
        view = replace(self.scene, camera=camera, resolution=size, border=None)
        self._thread = threading.Thread(target=self._work, args=(view, error), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._cancel.set()
        if self._thread.is_alive():
            self._thread.join()

    def _work(self, view: Scene, error: float) -> None:
        from ..blender_rad.rendering import CancelledError

        try:
            self._refine(view, error, self._cancel)
        except CancelledError:
            return
        except Exception:  # of a thread, which nobody else would see
            log.exception("the viewport cannot be rendered")
        self.refining = False
        self._redraw()

    def _refine(self, view: Scene, error: float, cancel: threading.Event) -> None:
        from ..blender_rad.direct import DirectLight
        from ..blender_rad.rendering import Settings, render

        if self._light is None:
            self._light = DirectLight(view)
        due = 0.0

        def arrived(develop: Callable[[], Film]) -> None:
            nonlocal due
            if time.monotonic() > due:
                self._show(develop())
                due = time.monotonic() + BETWEEN_PICTURES_S

        coarse = Settings(samples=2, per_light=False)
        fine = replace(coarse, samples=None, error=error)
        for step, settings in (*((step, coarse) for step in COARSE), (1, fine)):
            width, height = (-(-side // step) for side in view.resolution)
            light = copy.copy(self._light)
            light.scene = replace(view, resolution=(width, height))
            self._show(render(light.scene, settings, light=light, cancel=cancel, arrived=arrived))

    def _show(self, film: Film) -> None:
        self.film, self.error = film, film.relative_standard_error
        self._redraw()


def region_camera(view: Any, window: Any, bl_camera: Any = None) -> Camera:
    """Return the camera of a 3D view, with the lens of the camera that it looks through if any.

    Parameters
    ----------
    view : (4, 4) view from world.
    window : (4, 4) clip space from view, as OpenGL has it: with the last row (0, 0, -1, 0) in
        perspective, x_clip = (w₀₀ x + w₀₂ z)/(-z), so that -1 and 1 lie at (∓1 + w₀₂)/w₀₀ on the
        plane z = -1; the near and far planes are where z_clip = ∓1.
    """
    import numpy as np

    from ..blender_rad.bpy_io.cameras import lens_of
    from ..blender_rad.scene import Camera

    w = np.array(window, dtype=np.float64)
    if w[3, 3] == 0.0:
        kind, middle = "perspective", w[:2, 2]
        clip = (w[2, 3] / (w[2, 2] - 1.0), w[2, 3] / (w[2, 2] + 1.0))
    else:
        kind, middle = "orthographic", -w[:2, 3]
        clip = ((w[2, 3] + 1.0) / w[2, 2], (w[2, 3] - 1.0) / w[2, 2])
    ends = [(side + middle[k]) / w[k, k] for k in (0, 1) for side in (-1.0, 1.0)]
    plane = (float(ends[0]), float(ends[1]), float(ends[2]), float(ends[3]))
    world = np.linalg.inv(np.array(view, dtype=np.float64))
    aperture = lens_of(bl_camera.data, world) if bl_camera else None
    ends = (float(clip[0]), float(clip[1]))
    return Camera("viewport", kind, world, plane, ends, aperture=aperture)
