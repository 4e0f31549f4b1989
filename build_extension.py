# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the ZIPs that users install: one a platform, with the wheels of what Blender lacks.

Usage: python build_extension.py [-o DIR] [--wheels DIR] [--python VERSION …] [--platform NAME …]

Wheels come unmodified from pip's index and are kept in the folder `--wheels`, where they are not
fetched again. Blender's own builder, out of the bpy package that is installed, makes the ZIPs.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parent
PLATFORMS = {  # Blender's names, and the tags of wheels that run there
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}
PYTHONS = ("3.11", "3.13")  # Blender 4.5, Blender 5.2
# What we need and what that needs, less NumPy: that is Blender's own. colour-science 0.4.7 asks
# for NumPy 2, but what we use of it runs with 1.26 (Blender 4.5), and 0.4.6 needs all of SciPy.
WHEELS = (
    *("embreex", "OpenEXR", "colour-science==0.4.7", "tqdm", "jinja2", "markupsafe"),
    *("matplotlib", "contourpy", "cycler", "fonttools", "kiwisolver", "packaging", "pillow"),
    *("pyparsing", "python-dateutil", "tzdata"),
)
CONTENT = ("__init__.py", "addon", "blender_rad", "LICENSE", "README.md")


def fetch(folder: Path, platform: str, python: str) -> None:
    """Fetch the wheels for a platform and a Python into `folder`."""
    tags = [f"--platform={tag}" for tag in PLATFORMS[platform]]
    only = ["--no-deps", "--only-binary=:all:"]
    run("-m", "pip", "download", "-q", *only, *tags, f"--python-version={python}", *WHEELS,
        "-d", str(folder))  # fmt: skip


def stage(folder: Path, wheels: list[Path], platforms: list[str]) -> None:
    """Put what is to be packed into `folder`, and name the wheels in the manifest."""
    for name in CONTENT:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder)
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(wheel, folder / "wheels")
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    listed = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    named = ", ".join(f'"{platform}"' for platform in platforms)
    added = f"platforms = [{named}]\nwheels = [\n{listed}]\n\n[permissions]"
    manifest = manifest.replace("[permissions]", added, 1)
    manifest = manifest.replace('"!/LICENSE"', '"!/wheels",\n  "!/LICENSE"')
    (folder / "blender_manifest.toml").write_text(manifest, encoding="utf-8")


def builder() -> str:
    """Return the path of Blender's own extension builder."""
    spec = find_spec("bpy")
    if spec is None or spec.origin is None:
        sys.exit("build_extension.py: error: bpy is not installed, expected pip install '.[bpy]'")
    (path,) = Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    return str(path)


def run(*command: str) -> None:
    subprocess.run([sys.executable, *command], check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), metavar="DIR")
    parser.add_argument("--wheels", type=Path, default=Path("out/wheels"), metavar="DIR")
    parser.add_argument("--python", nargs="+", default=PYTHONS, metavar="VERSION")
    parser.add_argument("--platform", nargs="+", default=[*PLATFORMS], choices=PLATFORMS)
    given = parser.parse_args()
    wheels: dict[str, Path] = {}
    for platform in given.platform:
        for python in given.python:
            folder = given.wheels / f"{platform}-{python}"
            if not folder.is_dir():
                fetch(folder, platform, python)
            wheels |= {wheel.name: wheel for wheel in folder.glob("*.whl")}
    given.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        stage(Path(name), sorted(wheels.values()), given.platform)
        run(builder(), "build", "--split-platforms", "--source-dir", name, "--output-dir",
            str(given.output))  # fmt: skip
    for path in given.output.glob("radiometric-*.zip"):
        run(builder(), "validate", str(path))


if __name__ == "__main__":
    main()
