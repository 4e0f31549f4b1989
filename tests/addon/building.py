# SPDX-License-Identifier: GPL-3.0-or-later
"""The ZIP that is tested: with its wheels where they were fetched before, else without."""

import os
import subprocess
import sys
from pathlib import Path

from build_extension import builder

ROOT = Path(__file__).parents[2]


def run(*command: str | Path, **environment: str) -> str:
    """Return what a Python program prints, for which nothing but success will do."""
    result = subprocess.run(
        [sys.executable, *command],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def build(folder: Path) -> Path:
    wheels, python = ROOT / "out" / "wheels", f"3.{sys.version_info.minor}"
    if (wheels / f"linux-x64-{python}").is_dir():
        only = ("--platform", "linux-x64", "--python", python)
        run(ROOT / "build_extension.py", "-o", folder, "--wheels", wheels, *only)
    else:
        path = folder / "radiometric.zip"
        run(builder(), "build", "--source-dir", ROOT, "--output-filepath", path)
    (path,) = folder.glob("*.zip")
    return path
