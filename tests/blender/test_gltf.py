# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF files: punctual lights keep their cd and lx, in text and in binary, and are judged."""

import base64
import json
import logging
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blender_rad

from .promised import inside, refused

PUNCTUAL = "KHR_lights_punctual"
LIGHTS: dict[str, dict[str, Any]] = {
    "Point": {"type": "point", "intensity": 100.0},
    "Bare point": {"type": "point"},
    "Spot": {"type": "spot", "intensity": 40.0, "spot": {"outerConeAngle": 0.6}},
    "Sun": {"type": "directional", "intensity": 683.0},
    "Bare sun": {"type": "directional"},
}
DOWN = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # from -Z to -Y
HEIGHT = 2.0


def write(path: Path, *, camera: bool = True, emission: bool = False) -> Path:
    """Write a floor of 4 m below lights 2 m above it, each seen from the middle."""
    floor = np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]], "<f4").tobytes()
    data = floor + np.array([0, 2, 1, 0, 3, 2], "<u2").tobytes()
    above = {"translation": [0.0, HEIGHT, 0.0], "rotation": DOWN}
    nodes: list[dict[str, Any]] = [{"name": "Floor", "mesh": 0}]
    for index, name in enumerate(LIGHTS):
        nodes.append({"name": name, **above, "extensions": {PUNCTUAL: {"light": index}}})
    if camera:
        nodes.append({"name": "Camera", **above, "camera": 0})
    glow = {"emissiveFactor": [1.0, 1.0, 1.0]} if emission else {}
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "extensionsUsed": [PUNCTUAL],
        "extensions": {PUNCTUAL: {"lights": list(LIGHTS.values())}},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "materials": [{"name": "Paint", **glow}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
            | {"min": [-2, 0, -2], "max": [2, 0, 2]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(floor)},
            {"buffer": 0, "byteOffset": len(floor), "byteLength": len(data) - len(floor)},
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if path.suffix == ".gltf":
        encoded = base64.b64encode(data).decode()
        document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{encoded}"
        path.write_text(json.dumps(document))
        return path
    chunks = b""
    for kind, body in ((b"JSON", json.dumps(document).encode()), (b"BIN\0", data)):
        whole = body + (b" " if kind == b"JSON" else b"\0") * (-len(body) % 4)
        chunks += struct.pack("<I4s", len(whole), kind) + whole
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


@pytest.mark.parametrize("name", ["scene.gltf", "scene.glb"])
def test_lights_keep_their_candelas_and_lux(name: str, tmp_path: Path) -> None:
    document = blender_rad.lights(write(tmp_path / name), efficacy=683.0)
    rows = {row["name"]: row for row in document["lights"]}
    candela = {n: rows[n]["peak_luminous_intensity_cd"] for n in ("Point", "Bare point", "Spot")}
    assert candela == pytest.approx({"Point": 100.0, "Bare point": 1.0, "Spot": 40.0}, rel=1e-6)
    assert math.isclose(rows["Point"]["blender_energy"], 100 * 4 * math.pi / 683, rel_tol=1e-6)
    lux = {name: rows[name]["illuminance_lx"] for name in ("Sun", "Bare sun")}
    assert lux == pytest.approx({"Sun": 683.0, "Bare sun": 1.0}, rel=1e-6)


def test_cycles_agrees_and_no_camera_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Blender's importer keeps a log on the standard error of the test that imported first.
    monkeypatch.setattr(logging, "raiseExceptions", False)
    seen = write(tmp_path / "seen.gltf")
    document = blender_rad.check(seen, shading="clay", resolution=(32, 24), samples=32)
    assert document["verdict"] == "agree", document["findings"]
    assert {row["name"] for row in document["lights"]} == set(LIGHTS)
    blind = write(tmp_path / "blind.glb", camera=False)
    refused(inside("check", blind), "camera", "blind.glb")
    assert inside("lights", blind).code == 0


@pytest.mark.parametrize("emission", [True, False])
def test_emission_counts_candelas_in_gltf_and_watts_in_blender(
    emission: bool, tmp_path: Path
) -> None:
    file = write(tmp_path / "glow.gltf", emission=emission)
    found = {f["code"]: f for f in inside("lint", file, "--json").document["findings"]}
    assert ("gltf-emission" in found) == emission
    if emission:
        assert found["gltf-emission"]["severity"] == "error"
        assert math.isclose(found["gltf-emission"]["effect_percent"], 68200.0)
