# SPDX-License-Identifier: GPL-3.0-or-later
"""`materials`: a file with materials of every fate, judged from outside."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from . import facets
from .agreement import square
from .promised import inside, save, stage
from .reading import material, node

KEYS = {"name", "supported", "positive", "reciprocal", "energy_conserving", "max_albedo"}
KEYS |= {"max_albedo_angle_deg", "findings"}


def show(name: str, kind: Any, at: int, **values: Any) -> None:
    square(name, material(name, kind, **values), location=(0, 0, -at))


def wrong(tree: Any) -> Any:
    rgb = node(tree, "RGB")
    rgb.outputs[0].default_value = (1.5, 0.2, 0.2, 1)
    return node(tree, "BsdfDiffuse", rgb)


def cloudy(tree: Any) -> Any:
    return node(tree, "BsdfDiffuse", node(tree, "TexNoise").outputs["Color"])


def test_each_material_is_judged_by_the_laws(tmp_path: Path) -> None:
    stage()
    show("Glow", wrong, 1)
    glow = save(tmp_path / "glow.blend")
    stage()
    show("Plaster", "BsdfDiffuse", 1, Color=(0.7, 0.6, 0.5))
    show("Paint", "BsdfPrincipled", 2, Base_Color=(0.98, 0.98, 0.98))
    show("Dull metal", "BsdfPrincipled", 3, Base_Color=(0.05,) * 3, Metallic=1.0, IOR=4.0)
    show("Lamp", "Emission", 4, Strength=2.0)
    show("Cloudy", cloudy, -1)  # in view, above the floor
    show("Toon", "BsdfToon", 5)
    show("Rough", "BsdfAnisotropic", 6, Roughness=0.6, distribution='GGX')
    sound = save(tmp_path / "sound.blend")
    run = inside("materials", sound, "--json", "--plot", tmp_path / "laws.png")
    assert run.code == 0, run.err
    assert (tmp_path / "laws.png").stat().st_size > 10_000
    rows = {row["name"]: row for row in run.document["materials"]}
    assert all(row.keys() >= KEYS for row in rows.values())
    found = {n: {f["code"]: f["severity"] for f in row["findings"]} for n, row in rows.items()}
    assert rows["Plaster"]["max_albedo"] == pytest.approx(0.7, abs=1e-6)
    assert all(rows["Plaster"][k] for k in ("positive", "reciprocal", "energy_conserving"))
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
    run = inside("materials", glow)
    assert run.code == 1
    assert "error: Glow: 1.5 of the light that arrives" in run.out


def test_cycles_itself_is_reciprocal_where_we_say_so() -> None:
    """f(i → r) over f(r → i), on pairs of quads that light and view meet the other way round."""
    angles = np.radians([5.0, 80.0, 20.0, 65.0])
    wi = np.array([np.sin(angles[0] + angles[1]), 0.0, np.cos(angles[0] + angles[1])])
    quads = np.array([np.array(facets.Matrix.Rotation(angle, 3, 'Y')) for angle in angles])
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
