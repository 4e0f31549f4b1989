# SPDX-License-Identifier: GPL-3.0-or-later
"""The lecture's Phong put to the laws: its albedos as a table, and `docs/phong.png`."""

from pathlib import Path

from blender_rad.laws import judge
from blender_rad.report.furnace import write_furnaces
from blender_rad.scene import Closure, Instance, Material
from blender_rad.textures import constant
from tests import handmade

KINDS = {"Phong as printed": "PHONG", "Modified Phong": "PHONG_MODIFIED", "Blinn": "BLINN"}
PICTURE = Path(__file__).parents[2] / "docs" / "phong.png"


def main() -> None:
    materials: list[Material] = []
    for exponent in (5.0, 50.0):
        inputs = {"Color": constant((1.0, 1.0, 1.0)), "Exponent": constant(exponent)}
        for name, kind in KINDS.items():
            closures = (Closure(kind, constant(1.0), inputs),)
            materials.append(Material(f"{name}, n = {exponent:g}", closures=closures))
    placed = [Instance(m.name, 0, handmade.moved(), (k,)) for k, m in enumerate(materials)]
    judged = judge(handmade.scene([handmade.square()], placed, [], materials=materials))
    for each in judged:
        curve = zip(each.angles_deg, each.albedo[:, 0], strict=True)
        print(f"{each.name:26}  ", *(f"{angle:g}° {albedo:.3f}" for angle, albedo in curve))
        print(*(f"  {finding}" for finding in each.findings), sep="\n")
    write_furnaces(judged, PICTURE)


if __name__ == "__main__":
    main()
