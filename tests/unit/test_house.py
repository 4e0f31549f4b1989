# SPDX-License-Identifier: GPL-3.0-or-later
"""README's words and map, and the one version, are those of the house as it stands."""

import re
import tomllib
from pathlib import Path

import blender_rad
from blender_rad import cli
from blender_rad.quantities import QUANTITIES, quantity

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_readme_uses_the_words_and_units_of_the_quantities():
    assert len({(q.form, q.kind) for q in QUANTITIES.values()}) == len(QUANTITIES) == 5 * 3
    text = " ".join(README.split())
    for form in ("flux", "intensity", "irradiance", "radiance"):
        for entry in (quantity(form, "radiant"), quantity(form, "luminous")):
            assert f"{entry.words} {entry.unit}" in text


def test_readme_maps_what_is_there():
    (block,) = re.findall(r"```\n(__init__.*?)```", README, re.DOTALL)
    mapped, folder = set(), ""
    for line in block.splitlines():
        names = re.split(r"\s{2,}", line.strip())[0].split()
        inner = line.startswith(" ")
        folder = folder if inner else names[0]
        mapped |= {folder + n for n in names if re.search(r"/$|\.\w+$", n)} if inner else {folder}
    assert not {path for path in mapped if not (ROOT / path).exists()}
    packages = {path.parent for path in (ROOT / "blender_rad").glob("*/__init__.py")}
    assert packages and {f"{p.relative_to(ROOT).as_posix()}/" for p in packages} <= mapped


def test_one_version(capsys):
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    heading = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert manifest["version"] == heading[1] == blender_rad.__version__
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out == f"blender-rad {blender_rad.__version__}\n"
