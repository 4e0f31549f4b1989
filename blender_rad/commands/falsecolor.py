# SPDX-License-Identifier: GPL-3.0-or-later
"""``falsecolor``: illuminance or luminance of a rendered picture, in colours with a legend."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from . import _values as values
from ._base import Command, Outcome, option
from ._scene import NAMED

isolines = values.Value(
    "X,Y,…|auto",
    "auto, or numbers above 0 with commas between them",
    lambda value: (
        value if value == "auto" else tuple(sorted(set(map(values.number(0), values.split(value)))))
    ),
)


@dataclass(frozen=True, kw_only=True)
class FalsecolorOptions(Command, verb="falsecolor"):
    """Draw illuminance or luminance of an EXR, of ours or of Cycles, in colours with a legend."""

    file: Path = option(values.exr_input, "a rendered EXR", metavar="IN.exr", positional=True)
    output: Path = option(
        values.output_file(".png", ".pdf"),
        "the file to write",
        metavar="OUT.png|OUT.pdf",
        required=True,
    )
    quantity: Literal["illuminance", "luminance"] = option(
        values.choice("illuminance", "luminance"), "what is drawn", default="illuminance"
    )
    scale: Literal["log", "linear"] = option(
        values.choice("log", "linear"), "of the legend", default="log"
    )
    min: float | None = option(values.number(), "lower end of the legend (default: a round one)")
    max: float | None = option(values.number(), "upper end of the legend (default: a round one)")
    isolines: tuple[float, ...] | Literal["auto"] = option(
        isolines, "labelled lines at these values, or auto", default=()
    )
    exposure: float = option(values.number(0), "film exposure of the render", default=1.0)
    efficacy: float | None = option(
        values.efficacy, f"lm per W: {NAMED} (default: the file's, or photopic)"
    )
    view_layer: str | None = option(
        values.text, "view layer in the file (default: the first with the passes)"
    )

    def run(self) -> Outcome:
        from ..photometry import falsecolor

        light = falsecolor.read_map(
            self.file,
            self.quantity,
            efficacy_lm_W=self.efficacy,
            exposure=self.exposure,
            view_layer=self.view_layer,
        )
        low, high = limits = falsecolor.value_range(light.values, self.scale, self.min, self.max)
        lines = None if self.isolines == "auto" else self.isolines
        document = {
            "output": self.output,
            "quantity": self.quantity,
            "unit": light.unit,
            "range": limits,
            "scale": self.scale,
            "isolines": falsecolor.write_map(light, self.output, self.scale, limits, lines),
            "percentiles": light.percentiles,
            "no_data_fraction": light.no_data_fraction,
            "efficacy_lm_W": light.efficacy_lm_W,
            "exposure": self.exposure,
            "findings": light.findings,
        }
        text = [f"{self.output}: {self.quantity}, {low:g} to {high:g} {light.unit}"]
        text += map(str, light.findings)
        return Outcome(document, "\n".join(text))
