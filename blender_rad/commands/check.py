# SPDX-License-Identifier: GPL-3.0-or-later
"""``check``: does the witness's direct light agree with ours, and if not, which light is off?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from . import _values as values
from ._base import Outcome, option
from ._scene import PictureCommand


@dataclass(frozen=True, kw_only=True)
class CheckOptions(PictureCommand, verb="check"):
    """Say whether the direct light agrees with an independent engine, and why not.

    Attributes
    ----------
    report : folder for the report, made if missing; None writes none.
    against : names of the witnesses.
    witness_scene : the file that the witness renders, where it is another one.
    render : pictures to judge in place of a witness, at film exposure `exposure` (None means 1).
    samples : a pixel on our side, and a pixel and seed on the witness's; None buys until decided.
    frames : first and last.
    """

    report: Path | None = option(values.output_folder, "write the report into DIR", metavar="DIR")
    against: tuple[str, ...] = option(
        values.names("cycles", "radiance", "mitsuba"),
        "witnesses, with commas: cycles, radiance, mitsuba (default: cycles)",
        default=("cycles",),
        metavar="LIST",
    )
    witness_scene: Path | None = option(
        values.scene_file, "render the witness from another file", metavar="OTHER.blend"
    )
    render: tuple[Path, ...] = option(
        values.exr_input,
        "judge pictures that exist (direct light only)",
        metavar="FILE.exr",
        several=True,
    )
    exposure: float | None = option(
        values.number(0), "film exposure of the pictures (default: 1)", metavar="X"
    )
    witness_settings: Literal["reference", "file"] = option(
        values.choice("reference", "file"),
        "unbiased settings for the witness, or the file's own (default: reference)",
        default="reference",
        metavar="reference|file",
    )
    tolerance: float = option(
        values.number(0, 1),
        "relative difference that is allowed (default: 0.01)",
        default=0.01,
        metavar="X",
    )
    confidence: float = option(
        values.number(0.5, 1), "of the verdict (default: 0.99)", default=0.99, metavar="X"
    )
    samples: int | None = option(
        values.integer(1), "fixed samples a pixel (default: more until decided)", metavar="N"
    )
    frames: tuple[int, int] | None = option(values.frame_range, "several frames", metavar="A-B")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("frame", "frames")
        self.exclude("witness_scene", "render")
        self.require("exposure", "render")

    def run(self) -> Outcome:
        raise NotImplementedError
