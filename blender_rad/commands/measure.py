# SPDX-License-Identifier: GPL-3.0-or-later
"""``measure``: lux meters, grids of them, and luminance meters."""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..errors import Finding, RadError
from . import _values as values
from ._base import Outcome, aligned, option
from ._scene import MeterCommand

if TYPE_CHECKING:
    from ..arrays import Floats
    from ..meters import Grid, LuxMeter, Readings

    Point = tuple[float, ...]
    Points = tuple[Point, ...]

UP = (0.0, 0.0, 1.0)
MANY = 1_000_000  # shares of lights in a document
LEFT_OUT = "too many to list by meter and light; the grid has averages"
SHOWN = 12  # lights in a table
PLAN = 12, 24  # columns and rows of a grid that is shown as a table


def _points(help: str) -> Any:
    return option(values.vector(3), help, several=True)


@dataclass(frozen=True, kw_only=True)
class MeasureOptions(MeterCommand, verb="measure"):
    """Read lux meters, grids of them, or luminance meters, with the share of each light.

    Without a place, all meters that the file marks are read: empties whose names begin with
    "Meter", and objects with a custom property "meter". They look along their local +Z. The exit
    code is 1 where a target of the grid is missed.
    """

    at: Points = _points("where a meter is, in metres")
    normal: Points = _points("where it looks (default: up)")
    meter: tuple[str, ...] = option(
        values.text, "an object as a meter: its origin and local +Z", metavar="OBJECT", several=True
    )
    grid: str | None = option(
        values.text, "a mesh whose local XY rectangle is covered with meters", metavar="OBJECT"
    )
    plane: tuple[float, float, float, float, float] | None = option(
        values.vector(5), "a rectangle of meters that look up", metavar="X0,Y0,Z,X1,Y1"
    )
    spacing: float | None = option(values.number(0), "between meters of a grid", metavar="M")
    margin: float = option(
        values.number(0, closed=True),
        "from a grid's edges, such as walls",
        default=0.0,
        metavar="M",
    )
    maintenance_factor: float = option(
        values.number(0), "what ageing leaves of the light", default=1.0, metavar="F"
    )
    target_average: float | None = option(
        values.number(0), "least average illuminance of the grid", metavar="LX"
    )
    target_uniformity: float | None = option(
        values.number(0, 1), "least U0 (minimum over average) of the grid", metavar="U0"
    )
    quantity: Literal["irradiance", "radiance"] = option(
        values.choice("irradiance", "radiance"),
        "irradiance: lux meters; radiance: luminance meters",
        default="irradiance",
    )
    from_: Points = _points("where a luminance meter is")
    towards: Points = _points("a point that it looks at")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("at", "meter", "grid", "plane", "from_")
        self.require("normal", "at")
        for name in ("margin", "target_average", "target_uniformity"):
            self.require(name, "spacing")
        if (self.spacing is None) != (self.grid is None and self.plane is None):
            raise RadError("grids need both", "--spacing", "expected --grid or --plane with it")
        if (self.quantity == "radiance") != bool(self.from_):
            expected = "expected --quantity radiance --from X,Y,Z --towards X,Y,Z"
            raise RadError("a luminance meter needs a place", "--quantity", expected)
        for first, second, where in (
            (self.at, self.normal or self.at, "--at and --normal"),
            (self.from_, self.towards, "--from and --towards"),
        ):
            if len(first) != len(second):
                expected = "expected as many of one as of the other"
                raise RadError("these go in pairs", where, expected)
        if (0.0, 0.0, 0.0) in self.normal:
            raise RadError("looks nowhere", "--normal", "expected a vector that is not 0")
        if any(a == b for a, b in zip(self.from_, self.towards, strict=True)):
            raise RadError("looks nowhere", "--towards", "expected another point than --from")

    def run(self) -> Outcome:
        from ..bpy_io.read import read_scene

        bl_scene, meter = self.lux_meter()
        model = "physical" if self.model == "cycles" else "cycles"
        other = read_scene(bl_scene, model=model, maps=meter.scene.world.maps)
        alike = pickle.dumps(other.lights) == pickle.dumps(meter.scene.lights)
        twin = meter if alike else meter.in_model_of(other)
        document: dict[str, Any] = {
            "meters": [],
            "grid": None,
            "efficacy_lm_W": self.efficacy,
            "model": self.model,
            "maintenance_factor": self.maintenance_factor,
            "findings": self.scene_findings(meter),
        }
        if self.quantity == "irradiance":
            self._lux(bl_scene, meter, twin, document)
        for pair in zip(self.from_, self.towards, strict=True):
            self._luminance(meter, twin, *pair, document)
        if len(self.from_) == 1:
            document |= document["meters"][0]
        grid, meters = document["grid"], document["meters"]
        lines = _grid_lines(grid, meters) if grid else _meter_lines(meters)
        missed = bool(grid) and not grid["targets"].get("pass", True)
        return Outcome(document, "\n".join([*lines, *map(str, document["findings"])]), int(missed))

    def _luminance(
        self, meter: LuxMeter, twin: LuxMeter, place: Point, target: Point, document: dict[str, Any]
    ) -> None:
        """Read a luminance meter into the document."""
        import numpy as np

        start, end = np.array(place), np.array(target)
        weights, key = self.maintenance_factor * meter.weights, "luminance_cd_m2"
        seen = meter.look(start, end)
        theirs = seen if twin is meter else twin.look(start, end)
        document["findings"] += seen.findings()
        row = {
            "position_m": place,
            "direction": (end - start) / np.linalg.norm(end - start),
            "radiance_W_m2_sr": self.maintenance_factor * seen.radiance,
            key: float(seen.radiance @ weights),
            "standard_error_cd_m2": seen.standard_error(weights),
            "other_model_luminance_cd_m2": float(theirs.radiance @ weights),
            "lights": named(seen.lights, (x @ weights for x in seen.lights.values()), key),
        }
        document["meters"].append(row)

    def _lux(
        self, bl_scene: Any, meter: LuxMeter, twin: LuxMeter, document: dict[str, Any]
    ) -> None:
        """Read the lux meters into the document."""
        from ..progress import bar

        scale, factor = meter.scene.unit_scale_m, self.maintenance_factor
        grid, names, points, normals = self._places(bl_scene, scale)
        with bar("measure") as progress:
            own = other = meter.read(points, normals, progress).times(factor)
        if twin is not meter:
            with bar("measure, other model") as progress:
                other = twin.read(points, normals, progress).times(factor)
        document["findings"] += own.findings()
        many = own.lights.size > MANY
        if many:
            document["findings"].append(Finding("shares-left-out", "info", "", LEFT_OUT))
        document["meters"] = [
            {
                **({"name": names[k]} if names else {}),
                "position_m": point,
                "normal": normals[k],
                "irradiance_W_m2": own.irradiance[k],
                "illuminance_lx": own.illuminance[k],
                "standard_error_lx": own.standard_error[k],
                "other_model_illuminance_lx": other.illuminance[k],
                "lights": [] if many else named(meter.names, own.lights[k], "illuminance_lx"),
            }
            for k, point in enumerate(points)
        ]
        if grid:
            document["grid"] = self._figures(grid, own, meter.names)

    def _places(
        self, bl_scene: Any, scale: float
    ) -> tuple[Grid | None, tuple[str, ...], Floats, Floats]:
        """Return the grid, names, positions (n, 3) [m] and unit normals (n, 3), as far as given."""
        import numpy as np

        from ..bpy_io.meters import marked_meters, meter_places, rectangle
        from ..meters import grid

        if self.spacing is not None:
            if self.plane:
                (x0, x1), (y0, y1) = sorted(self.plane[::3]), sorted(self.plane[1::3])
                edges = [(x0, y0, self.plane[2]), (x1 - x0, 0, 0), (0, y1 - y0, 0)]
                corner, u, v, axis = np.array([*edges, UP])
            else:
                edges, axis = rectangle(bl_scene, str(self.grid))
                corner, u, v = scale * edges
            cells = grid(corner, u, v, self.spacing, self.margin)
            return cells, (), cells.points, np.broadcast_to(axis, cells.points.shape)
        if self.at:
            normals = np.array(self.normal or (UP,) * len(self.at))
            return None, (), np.array(self.at), normals / np.linalg.norm(normals, axis=1)[:, None]
        names = self.meter or tuple(marked_meters(bl_scene))
        if not names:
            expected = "expected --at, --meter, --grid or --plane, or an empty named Meter"
            raise RadError("no meter", str(self.file), expected)
        points, normals = meter_places(bl_scene, names)
        return None, names, scale * points, normals

    def _figures(self, grid: Grid, own: Readings, names: list[str]) -> dict[str, Any]:
        """Return what a lighting designer asks of a grid."""
        lux = own.illuminance
        average, low, high = lux.mean(), lux.min(), lux.max()
        figures: dict[str, Any] = {
            "average_lx": average,
            "minimum_lx": low,
            "maximum_lx": high,
            "uniformity_U0": low / average if average else None,
            "uniformity_Ud": low / high if high else None,
            "rows": grid.rows,
            "columns": grid.columns,
            "spacing_m": self.spacing,
            "margin_m": self.margin,
            "lights": named(names, own.lights.mean(axis=0), "average_lx"),
        }
        asked = {"average_lx": self.target_average, "uniformity_U0": self.target_uniformity}
        targets: dict[str, Any] = {k: least for k, least in asked.items() if least is not None}
        if targets:
            targets["pass"] = all((figures[k] or 0.0) >= v for k, v in targets.items())
        return figures | {"targets": targets}


def named(names: Iterable[str], values: Iterable[Any], key: str) -> list[dict[str, Any]]:
    """Return a row for each light, its value under `key`."""
    return [{"name": name, key: float(x)} for name, x in zip(names, values, strict=True)]


def _meter_lines(meters: list[dict[str, Any]]) -> list[str]:
    lux = "illuminance_lx" in meters[0]
    key, unit = ("illuminance_lx", "lx") if lux else ("luminance_cd_m2", "cd/m²")
    lines: list[str] = []
    for row in meters:
        place = ", ".join(f"{x:.3f}" for x in row["position_m"])
        value, other = row[key], row[f"other_model_{key}"]
        error = row["standard_error_" + key.partition("_")[2]]
        lines.append(f"{row.get('name', '')} ({place}) m: {value:.5g} ± {error:.2g} {unit}".strip())
        lines += _share_lines(row["lights"], key, unit)
        if abs(other - value) > 1e-6 * abs(value):
            lines.append(f"  all, in the other model: {other:.5g} {unit}")
    return lines


def _grid_lines(grid: dict[str, Any], meters: list[dict[str, Any]]) -> list[str]:
    columns, rows = grid["columns"], grid["rows"]
    lines = [f"{columns} × {rows} meters, {grid['spacing_m']:g} m apart"]
    if columns <= PLAN[0] and rows <= PLAN[1]:
        lux = [f"{row['illuminance_lx']:.5g}" for row in meters]
        plan = [lux[k * columns : (k + 1) * columns] for k in reversed(range(rows))]
        lines += aligned(plan, left=0)
    average, low, high = (grid[f"{key}_lx"] for key in ("average", "minimum", "maximum"))
    lines += [
        f"E_avg {average:.5g} lx, E_min {low:.5g} lx, E_max {high:.5g} lx",
        f"U0 {grid['uniformity_U0'] or 0.0:.3f}, Ud {grid['uniformity_Ud'] or 0.0:.3f}",
        *_share_lines(grid["lights"], "average_lx", "lx"),
    ]
    verdicts = {True: ["targets: pass"], False: ["targets: FAIL"]}
    return lines + verdicts.get(grid["targets"].get("pass"), [])


def _share_lines(lights: list[dict[str, Any]], key: str, unit: str) -> list[str]:
    """Return a line for each of the lights that give most."""
    most = sorted(lights, key=lambda light: -abs(light[key]))[:SHOWN]
    table = [["", light["name"], f"{light[key]:.5g}", unit] for light in most]
    lines = aligned(table, left=2)
    return lines + [f"  and {len(lights) - SHOWN} more"] * (len(lights) > SHOWN)
