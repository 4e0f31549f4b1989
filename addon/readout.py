# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light truly emits, worked out beside Blender: `draw` only asks what is known by now."""

from __future__ import annotations

import pickle
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import bpy

POLL_S = 0.1
MOST = 256
_rows: dict[bytes, Future[dict[str, Any]]] = {}
_last: dict[str, dict[str, Any]] = {}
_pool: list[ThreadPoolExecutor] = []


def known(record: Any, convention: Any, model: str, point: tuple[float, ...] | None) -> Any:
    """Return the row of a light as ``lights`` has it, that of before while it is worked out.

    Its ``facing_lx`` is what arrives at `point` [bu], or at the convention's distance without one.
    """
    key = pickle.dumps((record, convention, model, point))
    if key not in _rows:
        if len(_rows) > MOST:
            _rows.clear()
        if not _pool:
            _pool.append(ThreadPoolExecutor(1))
        _rows[key] = _pool[0].submit(row, record, convention, model, point)
    if _rows[key].done():
        _last[record.name] = _rows[key].result()
    elif not bpy.app.timers.is_registered(_redraw):
        bpy.app.timers.register(_redraw, first_interval=POLL_S)
    return _last.get(record.name)


def row(record: Any, convention: Any, model: Any, point: Any) -> dict[str, Any]:
    """Return the row; nothing of Blender is asked, so that any thread may."""
    import numpy as np

    from ..blender_rad.inspection import inspect_lights
    from ..blender_rad.lights import Light, light_from_record
    from ..blender_rad.scene import Scene, World
    from ..blender_rad.stated import arriving, per_energy

    scene = Scene(
        file="",
        sha256="",
        frame=0,
        meshes=(),
        instances=(),
        materials=(),
        lights=(),
        world=World(),
        camera=None,
        resolution=(1, 1),
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


def _redraw() -> float | None:
    """Redraw the panels; as a timer, until nothing is under way."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == 'PROPERTIES':
                area.tag_redraw()
    return POLL_S if any(not future.done() for future in _rows.values()) else None


def register() -> None:
    """Nothing to register: the pool starts when a panel asks."""


def unregister() -> None:
    if bpy.app.timers.is_registered(_redraw):
        bpy.app.timers.unregister(_redraw)
    while _pool:
        _pool.pop().shutdown(cancel_futures=True)
    _rows.clear()
    _last.clear()
