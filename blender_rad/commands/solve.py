# SPDX-License-Identifier: GPL-3.0-or-later
"""``solve``: the powers with which meters read what is wanted."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import Finding, RadError, unknown_name
from . import _values as values
from ._base import Outcome, aligned, option
from ._scene import MeterCommand

OFF = 0.01  # of a target: a miss that is worth a finding


def _target(value: Any) -> tuple[str, float]:
    name, _, lux = value.rpartition("=") if isinstance(value, str) else (value[0], "", value[1])
    if not name:
        raise ValueError("METER=LX, such as Desk=500")
    return values.text(name), values.number(0, closed=True)(lux)


@dataclass(frozen=True, kw_only=True)
class SolveOptions(MeterCommand, verb="solve"):
    """Find the powers of lights with which meters read their targets, and save them in a copy.

    They are least-squares, not negative, and of equally good answers the one that changes the
    lights least. Light is direct light, as `measure` reads it.
    """

    target: tuple[tuple[str, float], ...] = option(
        _target,
        "a meter object and what it shall read",
        metavar="METER=LX",
        several=True,
        required=True,
    )
    lights: tuple[str, ...] | None = option(
        values.names(), "lights that may change, with commas (default: all)"
    )
    output: Path | None = option(
        values.output_file(".blend"),
        "write a copy with these powers",
        metavar="OUT.blend",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.target:
            raise RadError("nothing to solve for", "--target", "expected METER=LX")
        if self.output and self.output.resolve() == self.file.resolve():
            raise RadError("this is the input", str(self.output), "expected another file")

    def run(self) -> Outcome:
        import numpy as np

        from ..bpy_io.meters import meter_places
        from ..solving import factors

        bl_scene, meter = self.lux_meter()
        chosen = self._chosen(meter.names)
        names, wanted = zip(*self.target, strict=True)
        points, normals = meter_places(bl_scene, names)
        own = meter.read(points * meter.scene.unit_scale_m, normals)
        found = np.ones(len(meter.names))
        found[chosen] = 0.0
        found[chosen] = factors(own.lights[:, chosen], np.array(wanted) - own.lights @ found)
        lux = own.lights @ found
        findings = [*self.scene_findings(meter), *own.findings()]
        miss = np.abs(lux - wanted)
        if (miss > OFF * np.array(wanted)).any():
            message = f"no powers reach all targets: the best miss one by {miss.max():.3g} lx"
            findings.append(Finding("target-out-of-reach", "warning", "", message))
        scales = {meter.names[k]: float(found[k]) for k in chosen}
        powers = self._set(bl_scene, meter.scene, scales, findings)
        document: dict[str, Any] = {
            "lights": [
                {"name": name, "factor": factor, "blender_energy": powers.get(name)}
                for name, factor in scales.items()
            ],
            "meters": [
                {"name": name, "target_lx": target, "illuminance_lx": float(value)}
                for name, target, value in zip(names, wanted, lux, strict=True)
            ],
            "residual_lx": float(np.sqrt(np.mean(miss**2))),
            "output": self.output,
            "efficacy_lm_W": self.efficacy,
            "model": self.model,
            "findings": findings,
        }
        return Outcome(document, _text(document))

    def _chosen(self, names: list[str]) -> list[int]:
        for name in self.lights or ():
            if name not in names:
                raise unknown_name("light", name, "--lights", names)
        return [k for k, name in enumerate(names) if self.lights is None or name in self.lights]

    def _set(
        self, bl_scene: Any, before: Any, scales: dict[str, float], findings: list[Finding]
    ) -> dict[str, float]:
        """Return the new powers by name, and save them where that is asked for."""
        from ..bpy_io.open import open_scene
        from ..bpy_io.powers import check_powers, save_copy, scale_power
        from ..bpy_io.read import read_scene

        if self.output:
            bl_scene = open_scene(self.file, scene=self.scene, load_ui=True)
            before = read_scene(bl_scene, model=self.model)
        powers: dict[str, float] = {}
        for name, factor in scales.items():
            try:
                powers[name] = scale_power(bl_scene, name, factor)
            except RadError as error:
                if self.output:
                    raise
                findings.append(Finding("power-not-set", "warning", name, str(error)))
        if self.output:
            check_powers(bl_scene, before, scales)
            save_copy(self.output)
        return powers


def _text(document: dict[str, Any]) -> str:
    """Return tables for people."""
    lights = [["light", "factor", "energy or strength"]]
    for light in document["lights"]:
        power = light["blender_energy"]
        new = "" if power is None else f"{power:.6g}"
        lights.append([light["name"], f"{light['factor']:.5g}", new])
    meters = [["meter", "lx", "wanted"]]
    for meter in document["meters"]:
        read, wanted = f"{meter['illuminance_lx']:.5g}", f"{meter['target_lx']:.5g}"
        meters.append([meter["name"], read, wanted])
    lines = [*aligned(lights), *aligned(meters), f"residual {document['residual_lx']:.3g} lx"]
    return "\n".join([*lines, *map(str, document["findings"])])
