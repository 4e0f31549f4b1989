# SPDX-License-Identifier: GPL-3.0-or-later
"""``render``: the direct light of a scene as radiance, with its error, in an EXR file."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import Finding, unknown_name
from . import _values as values
from ._base import Outcome, option
from ._scene import PictureCommand

if TYPE_CHECKING:
    from ..film import Film

DEFAULT_ERROR = 0.01


@dataclass(frozen=True, kw_only=True)
class RenderOptions(PictureCommand, verb="render"):
    """Render the direct light as radiance in W/(m² sr), with its error, into an EXR file."""

    output: Path = option(
        values.output_file(".exr"), "the file to write", metavar="OUT.exr", required=True
    )
    error: float | None = option(
        values.number(0), f"target relative standard error (default: {DEFAULT_ERROR})"
    )
    samples: int | None = option(values.integer(1), "fixed samples a pixel")
    passes: tuple[str, ...] | None = option(
        values.names(),
        "layers with commas, or all (default: all but those by light)",
        metavar="LIST",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("error", "samples")

    def run(self) -> Outcome:
        from ..checking import light_rows
        from ..direct import DirectLight
        from ..exr import film_channels, film_header, write_exr
        from ..progress import bar
        from ..rendering import Settings, render
        from ..report.document import coverage

        clock = [time.perf_counter()]
        _, scene = self.read(self.frame)
        clock.append(time.perf_counter())
        light = DirectLight(scene)
        clock.append(time.perf_counter())
        settings = Settings(
            samples=self.samples,
            error=self.error or DEFAULT_ERROR,
            per_light=any(n == "all" or n.startswith("Light.") for n in self.passes or ()),
            threads=self.threads,
            time_limit=self.time_limit,
        )
        with bar("render") as progress:
            film = render(scene, settings, light=light, progress=progress)
        clock.append(time.perf_counter())
        findings = list(film.findings)
        if not light_rows(scene):
            black = "no light in the scene: the picture is black"
            findings.append(Finding("nothing-emits", "warning", "", black))
        channels = film_channels(film, scene, self.efficacy, self._layers(film))
        write_exr(self.output, channels, film_header(film, scene, self.efficacy))
        clock.append(time.perf_counter())
        read, built, rendered, written = (b - a for a, b in itertools.pairwise(clock))
        document: dict[str, Any] = {
            "output": self.output,
            "samples_per_pixel": float(film.samples[film.inside].mean()),
            "relative_standard_error": film.relative_standard_error,
            "coverage": coverage(film),
            "findings": findings,
            "efficacy_lm_W": self.efficacy,
            "model": self.model,
            "seconds": {"read": read, "build": built, "render": rendered, "write": written},
        }
        error = 100 * document["relative_standard_error"]
        fraction = 100 * document["coverage"]["supported_pixel_fraction"]
        lines = [
            f"{self.output}: {document['samples_per_pixel']:.1f} samples a pixel",
            f"relative standard error {error:.2g} %, {fraction:.1f} % of the picture supported",
        ]
        return Outcome(document, "\n".join([*lines, *map(str, findings)]))

    def _layers(self, film: Film) -> tuple[str, ...]:
        """Return the layers asked for, after checking that there are such."""
        from ..exr import PASSES

        lights = [f"Light.{name}" for name in film.lights]
        if self.passes is None:
            return PASSES
        if "all" in self.passes:
            return (*PASSES, *lights)
        for name in self.passes:
            if name not in (*PASSES, *lights):
                raise unknown_name("layer", name, "--passes", ["all", *PASSES, *lights])
        return self.passes
