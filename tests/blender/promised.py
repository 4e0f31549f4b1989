# SPDX-License-Identifier: GPL-3.0-or-later
"""The program from outside, and the small scenes that it is asked about."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .reading import SQUARE, add, camera, empty_scene, light, material, polygons, world

WIDTH, HEIGHT = 32, 24
ALBEDO = (0.8, 0.5, 0.25)
ROOT = Path(__file__).parents[2]
ERROR = re.compile(r"blender-rad: error: [^,\n]+, [^\n]+, [^\n]+\n")


@dataclass(frozen=True)
class Ran:
    """What a run of the program left: its exit code and what it said."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        return strict(self.out)


PROGRAM = ("-m", "blender_rad")


def python(*arguments: object, **environment: str) -> Ran:
    """Run a Python of its own."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
    return Ran(done.returncode, done.stdout, done.stderr)


def ran(*arguments: object, **environment: str) -> Ran:
    return python(*PROGRAM, *arguments, **environment)


def interrupted(reached: Callable[[], object], *arguments: object) -> None:
    """Interrupt a run whose Blender is there when `reached` returns: it leaves no scratch file."""
    with tempfile.TemporaryDirectory() as scratch:
        process = subprocess.Popen(
            [sys.executable, *PROGRAM, *map(str, arguments)],
            cwd=ROOT,
            env=os.environ | {"TMPDIR": scratch},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
        )
        end = time.monotonic() + 60
        while not os.listdir(scratch) and time.monotonic() < end:  # Blender makes a folder there
            time.sleep(0.05)
        reached()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, out) == (130, ""), err
        assert "Traceback" not in err
        assert not os.listdir(scratch)


def inside(*arguments: object) -> Ran:
    """Run the program in this process, where a Blender of its own would only cost time."""
    from blender_rad.cli import main

    kept = sys.argv
    with said(1) as out, said(2) as err:
        try:
            sys.argv = ["blender-rad", *map(str, arguments)]
            code = main()
        except SystemExit as left:
            code = left.code
        finally:
            sys.argv = kept
    assert isinstance(code, int)
    return Ran(code, out[0], err[0])


@contextmanager
def said(descriptor: int) -> Iterator[list[str]]:
    """Gather what goes to standard output or error, Blender's own words among it."""
    name = {1: "stdout", 2: "stderr"}[descriptor]
    gathered: list[str] = []
    before, kept = getattr(sys, name), os.dup(descriptor)
    before.flush()
    with tempfile.TemporaryFile("w+b") as file:
        os.dup2(file.fileno(), descriptor)
        stream = os.fdopen(os.dup(descriptor), "w", encoding="utf-8")
        setattr(sys, name, stream)
        try:
            yield gathered
        finally:
            stream.close()
            if (own := getattr(sys, name)) is not stream:
                own.close()
            setattr(sys, name, before)
            os.dup2(kept, descriptor)
            os.close(kept)
            file.seek(0)
            gathered.append(file.read().decode())


def strict(text: str) -> dict[str, Any]:
    """Return the one JSON document that the text is, as RFC 8259 has it."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no JSON")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        assert len(dict(pairs)) == len(pairs), pairs
        return dict(pairs)

    return json.loads(text, parse_constant=refuse, object_pairs_hook=unique)


def refused(run: Ran, *named: str) -> None:
    """Hold a run against what is promised for bad input."""
    assert (run.code, run.out) == (2, ""), run
    assert ERROR.fullmatch(run.err), run.err
    for word in named:
        assert word in run.err, run.err


def tree(folder: Path) -> dict[str, tuple[int, int]]:
    """Return each file's digest and time of change, by its path in the folder."""
    return {
        str(path.relative_to(folder)): (hash(path.read_bytes()), path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def exr(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Return the header and each channel as (h, w)."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        assert {pixels.dtype for pixels in channels.values()} == {np.dtype(np.float32)}
        return dict(file.header()), {n: p.astype(np.float64) for n, p in channels.items()}


def layer(channels: dict[str, NDArray[np.float64]], name: str) -> NDArray[np.float64]:
    """Return the RGB of a layer, or of the picture where the name is empty: (h, w, 3)."""
    prefix = f"{name}." if name else ""
    return np.stack([channels[f"{prefix}{c}"] for c in "RGB"], axis=-1)


def square(name: str, half: float, at: Any = (0, 0, 0)) -> Any:
    corners, faces = SQUARE
    corners = [(half * x, half * y, 0) for x, y, _ in corners]
    paint = material(name, "BsdfDiffuse", Color=ALBEDO)
    return add(name, polygons(name, corners, faces, paint), location=at)


def point(
    name: str = "Key",
    at: Any = (0.4, 0.2, 2.0),
    energy: float = 100.0,
    radius: float = 0.0,
    soft: bool = False,
) -> Any:
    shape = {"shadow_soft_size": radius, "use_soft_falloff": soft}
    return light('POINT', name, location=at, energy=energy, **shape)


def panel(**properties: Any) -> Any:
    place = {"location": (-1.0, 0.0, 1.5), "energy": 40.0, "size": 1.0}
    return light('AREA', "Fill", **{**place, **properties})


def sky(name: str, colour: tuple[float, float, float]) -> None:
    world(name, Color=(*colour, 1))


def stage() -> Any:
    """Empty the session; put a camera 5 m above a 4 m floor, so that background shows beside it."""
    scene = empty_scene()
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    camera(type='ORTHO', ortho_scale=5.0, location=(0, 0, 5), rotation_euler=(0, 0, 0))
    square("Floor", 2.0)
    return scene


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    return path


def scene_file(folder: Path, name: str, *build: Callable[[], object]) -> Path:
    stage()
    for each in build:
        each()
    return save(folder / f"{name}.blend")
