# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures with known truth for the judge: lights with shadows, blue noise, fireflies."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from blender_rad.compare import Comparison, LightInfo, judge
from blender_rad.film import Film

Array = NDArray[np.float64]

H, W = 48, 64
PIXEL_NOISE = 0.06  # one seed of 64 samples: 16×16 tiles of 8 seeds then know their mean to 0.08 %
FLAT = 0.32  # white part of the noise power; tile means then vary by 0.35 of independent pixels


def blue_noise(rng: np.random.Generator, shape: tuple[int, ...], tail: float = 0.0) -> Array:
    """Unit-variance noise whose neighbours push each other away; `tail` of it is fireflies."""
    fy, fx = np.fft.fftfreq(shape[-2])[:, None], np.fft.fftfreq(shape[-1])[None]
    power = FLAT + np.minimum((fx**2 + fy**2) / 0.25**2, 1.0)
    gain = np.sqrt(power / power.mean())[:, : shape[-1] // 2 + 1]
    smooth = np.fft.irfft2(np.fft.rfft2(rng.normal(size=shape)) * gain, s=shape[-2:])
    if tail == 0.0:
        return smooth
    chance = 1e-3
    sparks = rng.random(shape) < chance
    spikes = (sparks - chance) / np.sqrt(chance * (1.0 - chance))
    return np.sqrt(1.0 - tail) * smooth + np.sqrt(tail) * spikes


def layer(x: float, y: float, rgb: tuple[float, float, float], edge: float = -1.0) -> Array:
    """A lamp at height 12 pixels over (x, y), its light cut off left of `edge`."""
    row, column = np.indices((H, W))
    falloff = 12.0**3 / (144.0 + (column - x) ** 2 + (row - y) ** 2) ** 1.5
    return (falloff * (column > edge))[..., None] * np.asarray(rgb)


def room() -> dict[str, Array]:
    """Four lights; the last one holds about 2 % of the energy."""
    return {
        'Key': layer(20.0, 20.0, (1.0, 0.9, 0.8)),
        'Fill': layer(50.0, 35.0, (0.4, 0.5, 0.7), edge=28.0),
        'Sky': np.full((H, W, 3), 1.0) * np.array([0.10, 0.12, 0.16]),
        'Small': layer(12.0, 40.0, (0.045, 0.04, 0.03)),
    }


def scaled(layers: dict[str, Array], factor: float, *names: str) -> dict[str, Array]:
    """The layers, those of `names` (of all, where none is given) times `factor`."""
    return {n: v * (factor if n in (names or layers) else 1.0) for n, v in layers.items()}


def film_of(
    layers: dict[str, Array],
    variance: float | Array = 0.0,
    noise: dict[str, Array] | None = None,
    **changes: object,
) -> Film:
    total = np.sum(list(layers.values()), axis=0)
    flat = np.zeros(total.shape[:2])
    film = Film(
        radiance=total,
        variance=np.broadcast_to(np.asarray(variance, float), total.shape).copy(),
        alpha=flat + 1.0,
        lights={name: value.astype(np.float32) for name, value in layers.items()},
        noise=noise or {name: np.zeros(total.shape, np.float32) for name in layers},
        seen=np.zeros_like(total),
        irradiance=np.zeros_like(total),
        depth=flat + 1.0,
        normal=np.zeros_like(total),
        samples=flat.astype(np.int64) + 64,
        inside=flat == 0,
        excluded=flat != 0,
        excluded_by={},
    )
    return replace(film, **changes)


@dataclass
class Witness:
    """Renders the layers with noise: each light's is its own, in proportion to its radiance."""

    layers: dict[str, Array]
    noise: float = PIXEL_NOISE
    tail: float = 0.0

    def seeds(self, rng: np.random.Generator, count: int = 8) -> Array:
        stack = np.stack(list(self.layers.values()))
        z = blue_noise(rng, (count, *stack.shape[:3]), self.tail)
        return np.einsum('jhwc,sjhw->shwc', stack, 1.0 + self.noise * z)


def judged(
    layers: dict[str, Array],
    shown: dict[str, Array] | None = None,
    noise: float = 0.024,
    count: int = 8,
    *,
    seed: int = 1,
    film: Film | None = None,
    types: dict[str, str] | None = None,
    **options: object,
) -> Comparison:
    """Judge seeds of what a witness shows, the same as ours where nothing else is said.

    The measured total energy of 160×120 pixels is known to 7e-5 with 8 seeds of 64 samples; these
    pictures are 2.5 times smaller each way, so their pixels are that much quieter.
    """
    shown = layers if shown is None else shown
    seeds = Witness(shown, noise).seeds(np.random.default_rng(seed), count)
    rows = [LightInfo(name, (types or {}).get(name, 'POINT'), 1) for name in layers]
    return judge(film or film_of(layers), seeds, lights=rows, **options)
