# SPDX-License-Identifier: GPL-3.0-or-later
"""A check against Cycles in a Blender of its own, so that this one stays free."""

import json
import os
import tempfile
from pathlib import Path
from typing import Any

import bpy

from .. import __package__ as root_package
from . import another

LONGEST_SIDE = 640  # pixels of the pictures compared, at most
POLL_S = 0.25
STEPS = {"ours": "Our engine", "witness": "Cycles"}
_CODE = """
from blender_rad import progress
from blender_rad.cli import run
progress.LISTENERS.append(
    lambda what, share: print("progress", share, what, file=sys.stderr, flush=True)
)
sys.exit(run({arguments!r}))
"""


class Check:
    """A check under way, or done: until `poll` has seen its end it is `running`."""

    def __init__(self, bl_scene: Any) -> None:
        package = str(root_package)
        self.folder = Path(bpy.utils.extension_path_user(package, path="report", create=True))
        self.running, self.share, self.step = True, 0.0, "Starting"
        self.document: dict[str, Any] | None = None  # of `report.json`, once there is one
        self.error = ""  # what went wrong
        self._scratch = tempfile.TemporaryDirectory()
        scratch = Path(self._scratch.name)
        copy = scratch / (Path(bpy.data.filepath).name or "unsaved.blend")
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, check_existing=False)
        self._log = scratch / "log.txt"
        code = _CODE.format(arguments=self._arguments(copy, bl_scene))
        self._process = another.start(code, self._log)

    def _arguments(self, file: Path, bl_scene: Any) -> list[str]:
        from ..blender_rad.bpy_io.read import frame_size

        own, size = bl_scene.radiometric, frame_size(bl_scene.render)
        smaller = min(1.0, LONGEST_SIDE / max(size))
        options = {
            "report": self.folder,
            "scene": bl_scene.name,
            "resolution": "x".join(str(max(1, round(side * smaller))) for side in size),
            "tolerance": own.tolerance,
            "model": own.model,
            "shading": own.shading,
            "efficacy": own.efficacy,
            "threads": max(1, (os.cpu_count() or 1) - 1),
        }
        return ["check", str(file), *(f"--{name}={value}" for name, value in options.items())]

    def poll(self) -> None:
        """See how far it is."""
        ended = self._process.poll() is not None
        said = self._log.read_text(encoding="utf-8", errors="replace").splitlines()
        steps = [line.split() for line in said if line.startswith("progress ")]
        if steps:
            _, share, step = steps[-1]
            self.share, self.step = float(share), STEPS.get(step, step)
        if ended and self.running:
            self._finish(said)

    def _finish(self, said: list[str]) -> None:
        self.running = False
        if self._process.returncode in {0, 1, 3}:
            self.document = json.loads((self.folder / "report.json").read_text(encoding="utf-8"))
        else:
            words = [line for line in said if line.strip() and not line.startswith("progress ")]
            self.error = words[-1] if words else "the check ended without a word"
        self._scratch.cleanup()

    def wait(self) -> None:
        self._process.wait()
        self.poll()

    def cancel(self) -> None:
        if self.running:
            self._process.kill()
            self._process.wait()
            self.running, self.error = False, "cancelled"
            self._scratch.cleanup()
