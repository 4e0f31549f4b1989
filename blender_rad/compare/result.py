# SPDX-License-Identifier: GPL-3.0-or-later
"""What the judge says, in the shapes of `report.json`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from ..errors import Finding
from ..strict_json import plain

Verdict = Literal["agree", "differ", "undecided"]

MIN_ENERGY = 0.01  # lights with less of it are reported, not judged
MIN_SUPPORTED = 0.5  # of the lit pixels: with less there is no verdict


@dataclass(frozen=True)
class LightInfo:
    """A row of the light table: object name, type (POINT, SPOT, AREA, SUN, WORLD, MESH), count."""

    name: str
    type: str
    count: int = 1


@dataclass(frozen=True)
class PixelCounts:
    """How many pixels fall into each class; no verdict rests on them."""

    compared: int
    agree: int
    differ: int
    undecided: int
    excluded: int


@dataclass(frozen=True)
class LightResult(LightInfo):
    """One light in the witness; `undecided` too below 1 % of the energy, where it is not judged.

    Attributes
    ----------
    group : shared by lights that cannot be told apart, else None; their factor is the group's.
    energy_fraction : share of the sum of our lights' absolute energies in the compared pixels.
    scale_in_witness : the factor on our light that best explains the witness (1 = agrees), with its
        standard error; nan for a light that puts nothing into the compared pixels.
    diagnosis : code of the named cause.
    """

    group: str | None = None
    energy_fraction: float = 0.0
    scale_in_witness: float = math.nan
    standard_error: float = math.nan
    verdict: Verdict = "undecided"
    diagnosis: str | None = None


@dataclass(frozen=True)
class Comparison:
    """A witness's verdict on our film.

    Attributes
    ----------
    needed_factor : how many times the samples would probably decide; None when decided, or when no
        number of samples can.
    least_factor : how many times they must be at least, whatever the luck; 0 when decided.
    held_up_by : what holds the verdict up, in words, and `held_up_error` its standard error
        relative to its tolerance.
    our_noise_share : part of the variance of what is undecided that is ours; the rest is the
        witness's. Tells whose samples to buy.
    """

    verdict: Verdict
    pixels: PixelCounts
    metrics: dict[str, float]
    lights: tuple[LightResult, ...]
    findings: tuple[Finding, ...]
    needed_factor: float | None = None
    our_noise_share: float = 0.0
    least_factor: float = 0.0
    held_up_by: str = ""
    held_up_error: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return `verdict`, `pixels`, `metrics`, `lights` and `findings`; null where not finite."""
        names = ("verdict", "pixels", "metrics", "lights", "findings")
        return plain({name: getattr(self, name) for name in names})
