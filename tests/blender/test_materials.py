# SPDX-License-Identifier: GPL-3.0-or-later
"""`materials`: a file with materials of every fate, judged from outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")

import numpy as np  # noqa: E402
from mathutils import Matrix  # noqa: E402

from . import facets, reading  # noqa: E402
from .promised import inside, link, save, stage  # noqa: E402

KEYS = {
    "name",
    "supported",
    "positive",
    "reciprocal",
    "energy_conserving",
    "max_albedo",
    "max_albedo_angle_deg",
    "findings",
}


def show(name: str, node: str, at: int, **sockets: Any) -> Any:
    mesh = bpy.data.meshes.new(name)
    corners, faces = reading.SQUARE
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(reading.material(name, node, **sockets))
    link(name, mesh, (0, 0, -at))
    return mesh.materials[0]


def test_each_material_is_judged_by_the_laws(tmp_path: Path) -> None:
    stage()
    glow = show("Glow", 'ShaderNodeBsdfDiffuse', 1)
    rgb = glow.node_tree.nodes.new('ShaderNodeRGB')
    rgb.outputs[0].default_value = (1.5, 0.2, 0.2, 1)
    target = glow.node_tree.nodes["Diffuse BSDF"].inputs["Color"]
    glow.node_tree.links.new(rgb.outputs[0], target)
    wrong = save(tmp_path / "glow.blend")
    stage()
    show("Plaster", 'ShaderNodeBsdfDiffuse', 1, Color=(0.7, 0.6, 0.5, 1))
    show("Paint", 'ShaderNodeBsdfPrincipled', 2, **{"Base Color": (0.98, 0.98, 0.98, 1)})
    soot = {"Base Color": (0.05, 0.05, 0.05, 1), "Metallic": 1.0, "IOR": 4.0}
    show("Dull metal", 'ShaderNodeBsdfPrincipled', 3, **soot)
    show("Lamp", 'ShaderNodeEmission', 4, Strength=2.0)
    cloudy = show("Cloudy", 'ShaderNodeBsdfDiffuse', -1).node_tree  # in view, above the floor
    noise = cloudy.nodes.new('ShaderNodeTexNoise')
    cloudy.links.new(noise.outputs["Color"], cloudy.nodes["Diffuse BSDF"].inputs["Color"])
    show("Toon", 'ShaderNodeBsdfToon', 5)
    rough = show("Rough", 'ShaderNodeBsdfAnisotropic', 6, Roughness=0.6)
    rough.node_tree.nodes["Glossy BSDF"].distribution = 'GGX'
    sound = save(tmp_path / "sound.blend")
    run = inside("materials", sound, "--json", "--plot", tmp_path / "laws.png")
    assert run.code == 0, run.err
    assert (tmp_path / "laws.png").stat().st_size > 10_000
    rows = {row["name"]: row for row in run.document["materials"]}
    assert all(row.keys() >= KEYS for row in rows.values())
    found = {
        name: {f["code"]: f["severity"] for f in row["findings"]} for name, row in rows.items()
    }
    assert rows["Plaster"]["max_albedo"] == pytest.approx(0.7, abs=1e-6)
    assert [rows["Plaster"][k] for k in ("positive", "reciprocal", "energy_conserving")] == [
        True
    ] * 3
    assert found["Plaster"] == found["Rough"] == found["Lamp"] == {}
    assert rows["Lamp"]["max_albedo"] == 0.0
    assert rows["Rough"]["reciprocal"] and 0.3 < rows["Rough"]["max_albedo"] < 1.0
    assert found["Paint"]["not-reciprocal"] == "info", "by construction"
    assert found["Paint"]["reflectance-high"] == "warning"
    assert {"reflectance-of-metal-low", "ior-high"} <= found["Dull metal"].keys()
    assert rows["Cloudy"]["reciprocal"] and 0.6 < rows["Cloudy"]["max_albedo"] < 1.0
    low, high = (f(row[0] for row in rows["Cloudy"]["albedo"]) for f in (min, max))
    assert 0.4 < low <= high < 0.6, "noise is 0.5 on average"
    assert not rows["Toon"]["supported"] and rows["Toon"]["positive"] is None
    run = inside("materials", wrong)
    assert run.code == 1
    assert "error: Glow: 1.5 of the light leaves" in run.out


def test_cycles_itself_is_reciprocal_where_we_say_so() -> None:
    """f(i → r) over f(r → i), on pairs of quads that light and view meet the other way round."""
    angles = np.radians([5.0, 80.0, 20.0, 65.0])
    wi = np.array([np.sin(angles[0] + angles[1]), 0.0, np.cos(angles[0] + angles[1])])
    quads = np.array([np.array(Matrix.Rotation(angle, 3, 'Y')) for angle in angles])
    inputs = {"Color": (1.0, 1.0, 1.0), "Roughness": 0.6}
    closures = [
        facets.Closure("ShaderNodeBsdfAnisotropic", inputs, {"distribution": kind})
        for kind in ('GGX', 'BECKMANN', 'MULTI_GGX')
    ]
    white = {"Base Color": (1.0, 1.0, 1.0), "Roughness": 0.3}
    closures.append(facets.Closure("ShaderNodeBsdfPrincipled", white))
    shown = facets.shot(closures, [quads] * 4, wi).mean(axis=2)
    f = shown / (quads[:, :, 2] @ wi)
    ratio = f[:, ::2] / f[:, 1::2]
    assert ratio[:2] == pytest.approx(1.0, abs=2e-4)
    assert (np.abs(ratio[2:] - 1.0).max(axis=1) > [0.04, 0.3]).all(), ratio
    ours = closures[2].ours(quads[:, :, 2], wi).mean(axis=1) / (quads[:, :, 2] @ wi)
    assert ratio[2] == pytest.approx(ours[::2] / ours[1::2], abs=2e-3)
