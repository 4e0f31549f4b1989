# SPDX-License-Identifier: GPL-3.0-or-later
"""``render``: the direct light of a scene as radiance, with its error, in an EXR file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from . import _values as values
from ._base import Outcome, option
from ._scene import PictureCommand

DEFAULT_ERROR = 0.01


@dataclass(frozen=True, kw_only=True)
class RenderOptions(PictureCommand, verb="render"):
    """Render the direct light as radiance in W/(m² sr), with its error, into an EXR file.

    Attributes
    ----------
    error : target relative standard error; None where `samples` is given.
    samples : fixed samples a pixel; None where `error` is the target.
    passes : names of layers, ``all`` for those of every light too; None means all but these.
    time_limit : [s].
    """

    output: Path = option(
        values.output_file(".exr"),
        "the file to write",
        metavar="OUT.exr",
        flags=("-o",),
        required=True,
    )
    error: float | None = option(
        values.number(0),
        f"target relative standard error (default: {DEFAULT_ERROR})",
        metavar="X",
    )
    samples: int | None = option(values.integer(1), "fixed samples a pixel", metavar="N")
    passes: tuple[str, ...] | None = option(
        values.names(),
        "layers with commas, or all (default: all but those by light)",
        metavar="LIST",
    )
    time_limit: float | None = option(values.number(0), "stop after S seconds", metavar="S")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("error", "samples")
        if self.error is None and self.samples is None:
            object.__setattr__(self, "error", DEFAULT_ERROR)

    def run(self) -> Outcome:
        raise NotImplementedError
