# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a viewport's picture: radiance as the scene's colours, or a quantity with its legend."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

import bpy

from ..blender_rad.quantities import QUANTITIES

if TYPE_CHECKING:
    from ..blender_rad.film import Film
    from .viewport import Viewport

VIEWPORTS: WeakValueDictionary[int, Viewport] = WeakValueDictionary()  # by region
LEGEND = (20, 16, 240, 90)  # margin, width, height, and what the labels take [points]
TICKS = 5


def texture(pixels: Any) -> Any:
    """Return a texture of `pixels` (h, w, 4), row 0 at the top."""
    import gpu
    import numpy as np

    types: Any = gpu.types
    height, width = pixels.shape[:2]
    data = types.Buffer(
        'FLOAT', pixels.size, np.ascontiguousarray(pixels[::-1], np.float32).ravel()
    )
    return types.GPUTexture((width, height), format='RGBA16F', data=data)


def draw_radiance(engine: Any, viewport: Viewport, bl_scene: Any, size: tuple[int, int]) -> None:
    """Draw what the engine sees, in scene-linear colours."""
    import gpu
    import numpy as np
    from gpu_extras.presets import draw_texture_2d

    film = viewport.film
    if film is None:
        return

    def pixels() -> Any:
        rgba = np.empty((*film.alpha.shape, 4), dtype=np.float32)
        rgba[..., :3], rgba[..., 3] = film.radiance, film.alpha
        return rgba

    picture, _ = _kept(viewport, None, lambda: (pixels(), None))
    gpu.state.blend_set('ALPHA_PREMULT')
    engine.bind_display_space_shader(bl_scene)
    draw_texture_2d(picture, (0, 0), *size)
    engine.unbind_display_space_shader()
    gpu.state.blend_set('NONE')


def draw_quantity() -> None:
    """Draw false colours and their legend over the 3D view that Blender is drawing."""
    context: Any = bpy.context
    own = context.scene.radiometric
    viewport = VIEWPORTS.get(context.region.as_pointer())
    film = viewport and viewport.film
    shading = context.space_data.shading.type
    if own.view == 'radiance' or shading != 'RENDERED' or not (viewport and film):
        return
    import gpu
    import matplotlib as mpl
    import numpy as np
    from gpu_extras.presets import draw_texture_2d
    from matplotlib.colors import LogNorm, Normalize

    from ..blender_rad.errors import RadError
    from ..blender_rad.photometry.falsecolor import COLOURS, value_range

    def pixels() -> tuple[Any, Any]:
        values = quantity(film, own.view, viewport.scene, own.efficacy)
        limits = value_range(values, own.scale, own.low or None, own.high or None)
        norm = {'log': LogNorm, 'linear': Normalize}[own.scale](*limits, clip=True)
        colours = mpl.colormaps[COLOURS].with_extremes(bad="0.25")
        lit = np.ma.masked_invalid(np.maximum(values, limits[0]))
        ramp = texture(colours(np.linspace(1.0, 0.0, 256))[:, None])
        return colours(norm(lit)), (limits, ramp)

    try:
        key = (own.view, own.scale, own.efficacy, own.low, own.high)
        picture, (limits, ramp) = _kept(viewport, key, pixels)
    except RadError:  # the ends of the legend have crossed
        return
    gpu.state.blend_set('NONE')
    draw_texture_2d(picture, (0, 0), context.region.width, context.region.height)
    _draw_legend(ramp, own.scale, limits, QUANTITIES[own.view].unit)


def _kept(
    viewport: Viewport, key: object, pixels: Callable[[], tuple[Any, Any]]
) -> tuple[Any, Any]:
    """Return the newest picture's texture and legend, made anew only where there is a newer one."""
    film, drawn, _ = viewport.texture
    if film is not viewport.film or drawn != key:
        image, limits = pixels()
        viewport.texture = (viewport.film, key, (texture(image), limits))
    return viewport.texture[2]


def quantity(film: Film, name: str, scene: Any, efficacy_lm_W: float) -> Any:
    """Return illuminance [lx] or luminance [cd/m²] (h, w), nan where there is no surface for it."""
    import numpy as np

    weights = efficacy_lm_W * np.array(scene.luminance_weights)
    if name == 'luminance':
        return film.radiance @ weights
    return np.where(np.isinf(film.depth), np.nan, film.irradiance @ weights)


def _draw_legend(ramp: Any, scale: str, limits: tuple[float, float], unit: str) -> None:
    import blf
    import numpy as np
    from gpu_extras.presets import draw_texture_2d

    context: Any = bpy.context
    scaled = (round(side * context.preferences.system.ui_scale) for side in LEGEND)
    margin, wide, tall, labels = scaled
    left = context.region.width - margin - wide - labels
    draw_texture_2d(ramp, (left, margin), wide, tall)
    spaced = np.geomspace if scale == 'log' else np.linspace
    blf.size(0, wide * 0.75)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    with shadows():
        for number, value in enumerate(spaced(*limits, TICKS)):
            last = f" {unit}" if number == TICKS - 1 else ""
            height = margin + number / (TICKS - 1) * tall - 0.25 * wide
            blf.position(0, left + 1.4 * wide, height, 0)
            blf.draw(0, f"{float(f'{value:.3g}'):g}{last}")


@contextmanager
def shadows() -> Generator[None]:
    """Have letters throw a shadow, a hard one: a soft one takes 25 copies of each letter."""
    import blf

    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 0, 0.0, 0.0, 0.0, 0.9)
    blf.shadow_offset(0, 1, -1)
    yield
    blf.disable(0, blf.SHADOW)


def disabled() -> None:
    VIEWPORTS.clear()


OVERLAYS = (draw_quantity,)
