# SPDX-License-Identifier: GPL-3.0-or-later
"""What the judge says, in the shapes of `report.json`."""

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

    `scale_in_witness` is the factor on our light that best explains the witness (1 = agrees); nan
    for a light that puts nothing into the compared pixels.
    """

    group: str | None = None  # of lights that can't be told apart; their factor is the group's
    energy_fraction: float = 0.0  # of our lights' absolute energies in the compared pixels
    scale_in_witness: float = math.nan
    standard_error: float = math.nan  # of that
    verdict: Verdict = "undecided"
    diagnosis: str | None = None  # code of the named cause


@dataclass(frozen=True)
class Comparison:
    """A witness's verdict on our film; where undecided, what would help.

    That is `needed_factor`, how many times the samples would probably decide (None where no number
    can), `least_factor`, how many times they must be whatever the luck, and `our_noise_share`, the
    part of the variance that is ours; the rest is the witness's. What holds the verdict up has the
    standard error `held_up_error` relative to its tolerance.
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
