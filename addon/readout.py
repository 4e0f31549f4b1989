# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light truly emits, worked out beside Blender: `draw` only asks what is known by now."""

import pickle
from concurrent.futures import Future
from typing import Any

from . import beside

MOST = 256
_rows: dict[bytes, dict[str, Any] | None] = {}  # None while it is worked out
_last: dict[str, dict[str, Any]] = {}


def known(name: str, key: bytes) -> Any:
    """Return the row of a light as ``lights`` has it, that of before while it is worked out.

    `key` are the pickled arguments of `row`.
    """
    if key not in _rows:
        if len(_rows) > MOST:
            _rows.clear()

        def taken(found: Future[dict[str, Any]]) -> None:
            _rows[key] = found.result()
            beside.redraw('PROPERTIES')

        _rows[key] = None
        beside.begin(taken, row, *pickle.loads(key))
    if now := _rows[key]:
        _last[name] = now
    return _last.get(name)


def row(record: Any, convention: Any, model: Any, point: Any) -> dict[str, Any]:
    """Return the row; nothing of Blender is asked, so that any thread may.

    Its ``facing_lx`` is what arrives at `point` [bu], or at the convention's distance without one.
    """
    import numpy as np

    from ..blender_rad.inspection import inspect_lights
    from ..blender_rad.lights import Light, light_from_record
    from ..blender_rad.scene import Scene
    from ..blender_rad.stated import arriving, per_energy

    scene = Scene(
        unit_scale_m=record.unit_scale_m,
        model=model,
        luminance_weights=convention.weights,
        light_records=(record,),
    )
    found = inspect_lights(scene, convention.efficacy)[0][0]
    light = None if record.unknown else light_from_record(record, model)
    if point is None:
        facing = per_energy(record, "lx", convention, model) * record.properties["energy"]
    elif isinstance(light, Light):
        away = record.world_from_light[:3, 3] - np.array(point)
        normal = away / (np.linalg.norm(away) or 1.0)
        irradiance = arriving(light, np.array(point), normal)
        facing = convention.efficacy * float(np.array(convention.weights) @ irradiance)
    else:
        facing = 0.0
    if convention.lm_per_W and found["luminous_flux_lm"] is not None:
        found["radiant_flux_W"] = found["luminous_flux_lm"] / convention.lm_per_W
    return {**found, "facing_lx": facing}


def disabled() -> None:
    _rows.clear()
    _last.clear()
