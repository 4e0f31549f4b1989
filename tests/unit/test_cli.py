# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: exit codes, one-line complaints, and a standard output of the result alone."""

from __future__ import annotations

import json
import math
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

import blender_rad
from blender_rad import cli
from blender_rad.commands import COMMANDS, Command, Outcome
from blender_rad.commands import _values as values
from blender_rad.commands._base import option
from blender_rad.errors import RadError


@dataclass(frozen=True, kw_only=True)
class Probe(Command):
    """A verb for tests."""

    file: Path = option(values.scene_file, "a file", metavar="SCENE", positional=True)
    at: tuple[tuple[float, ...], ...] = option(
        values.vector(3), "a point", metavar="X,Y,Z", several=True
    )

    def run(self) -> Outcome:
        if self.at == ((0.0, 0.0, 0.0),):
            raise KeyboardInterrupt
        if self.at == ((1.0, 1.0, 1.0),):
            raise ZeroDivisionError
        if self.at == ((2.0, 2.0, 2.0),):
            raise ModuleNotFoundError("No module named 'bpy'", name="bpy")
        if self.at == ((3.0, 3.0, 3.0),):
            raise ModuleNotFoundError("No module named ...", name="blender_rad.typo")
        document = {"at": self.at, "nothing": math.nan, "most": math.inf}
        return Outcome(document, "a short table", 3)


@pytest.fixture
def probe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(COMMANDS._load(), "probe", Probe)


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / "a.blend"
    path.write_bytes(b"BLENDER")
    return str(path)


def complaint(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Return the one line that `argv` is refused with."""
    assert cli.run(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"blender-rad: error: [^\n]+, [^\n]+, [^\n]+\n", err), err
    return err


@pytest.mark.parametrize("verb", sorted(COMMANDS))
def test_every_verb_is_named_as_its_file_and_has_help(
    verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert COMMANDS[verb].__module__ == f"blender_rad.commands.{verb}"
    assert cli.run([verb, "-h"]) == 0
    assert COMMANDS[verb].__doc__.partition("\n")[0][:40] in capsys.readouterr().out
    assert cli.run(["--help"]) == 0
    assert f"\n  {verb} " in capsys.readouterr().out


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from blender_rad import cli; cli.run(['check', '--help']);"
        "sys.exit(','.join({'numpy', 'bpy', 'matplotlib', 'colour', 'embreex'} & set(sys.modules)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert result.stderr.strip() == ""


BAD = {
    "--resolution 0x10": "'0x10' is not allowed|--resolution|WIDTHxHEIGHT",
    "--resolution 640": "--resolution|WIDTHxHEIGHT",
    "--resolution big": "--resolution",
    "--resolution -4x10": "--resolution",
    "--resolution 4x4x4": "--resolution",
    "--resolution 1000000x1000000": "--resolution",
    "--samples 0": "--samples|at least 1",
    "--samples 1.5": "--samples|whole number",
    "--samples": "--samples|expected one argument",
    "--threads -1": "--threads|at least 1",
    "--frame 1048575": "--frame|at most 1048574",
    "--frame=-1048575": "--frame",
    "--frame first": "--frame",
    "--model blue": "--model|cycles, physical",
    "--shading wood": "--shading|full, clay",
    "--efficacy 0": "--efficacy|photopic, cycles-ies, radiance",
    "--efficacy bright": "--efficacy",
    "--efficacy nan": "--efficacy",
    "--camera ''": "--camera|a name",
    "check --tolerance 1": "--tolerance|above 0 and below 1",
    "check --tolerance -0.1": "'-0.1'|--tolerance",
    "check --tolerance nan": "--tolerance",
    "check --toleranc 0.1": "unrecognized|check --help",
    "check --confidence 0.5": "--confidence|above 0.5 and below 1",
    "check --frames 9-3": "--frames|FIRST-LAST",
    "check --frames 1-": "--frames",
    "check --frames 1-2000000": "--frames",
    "check --frames 3 --frame 3": "--frame and --frames|exclude each other",
    "check --against cycles,povray": "--against|cycles, radiance, mitsuba",
    "check --against ''": "--against",
    "check --exposure 2": "--exposure|--render",
    "check --exposure -2": "'-2'|--exposure",
    "check --render none.exr": "no such file|none.exr",
    "check --render": "--render",
    "check --witness-settings mine": "reference, file",
    "check --witness-scene none.blend": "no such file|none.blend",
    "render --error inf": "--error",
    "render --error=-0.1": "--error",
    "render --error 0.1 --samples 4": "--error and --samples",
    "render --time-limit 0": "--time-limit",
    "render --passes ''": "--passes",
}


@pytest.mark.parametrize("options", BAD)
def test_bad_options_are_one_line(
    options: str, scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verb, dashes, rest = options.partition("--")
    verb = verb.strip() or "render"
    output = ["-o", str(tmp_path / "a.exr")] if verb == "render" else []
    line = complaint(capsys, verb, scene, *output, *shlex.split(dashes + rest))
    assert all(word in line for word in BAD[options].split("|")), line


def test_bad_scenes_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.txt").write_text("")
    assert "no such file" in complaint(capsys, "check", str(tmp_path / "two\nlines.blend"))
    assert "not a scene" in complaint(capsys, "check", str(tmp_path / "a.txt"))
    assert "a folder" in complaint(capsys, "check", str(tmp_path))
    assert "SCENE" in complaint(capsys, "check")


def test_an_unknown_verb_lists_those_that_exist(capsys: pytest.CaptureFixture[str]) -> None:
    assert ", ".join(sorted(COMMANDS)) in complaint(capsys, "chek")
    assert "VERB" in complaint(capsys)


def test_outputs_are_checked_before_the_work(
    scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.exr").mkdir()
    for bad in ("a.png", "a.blend", "no/a.exr", "a.blend/a.exr", "folder.exr", "/proc/no/a.exr"):
        assert "cannot write" in complaint(capsys, "render", scene, "-o", str(tmp_path / bad))
    for bad in (f"{scene}/below", scene):
        assert "cannot write" in complaint(capsys, "check", scene, "--report", bad)
    long = str(tmp_path / (300 * "x" + ".exr"))  # longer than a file's name can be
    for verb, flag in (("render", "-o"), ("check", "--report")):
        assert "expected a usable path" in complaint(capsys, verb, scene, flag, long)
    assert "--output" in complaint(capsys, "render", scene)
    picture = tmp_path / "cycles.exr"
    picture.touch()
    overwriting = ("--render", str(picture), "--report", str(tmp_path))
    assert "would overwrite" in complaint(capsys, "check", scene, *overwriting)


@pytest.mark.usefixtures("probe")
@pytest.mark.parametrize(
    "at", [["--at", "-1,2,-.5"], ["--at=-1,2,-.5"], ["--at", "9,9,9", "--at", "-1,2,-.5"]]
)
def test_values_may_begin_with_a_minus(
    at: list[str], scene: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["probe", scene, *at, "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["at"][-1] == [-1.0, 2.0, -0.5]


@pytest.mark.usefixtures("probe")
def test_json_is_strict_and_people_get_text(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["probe", scene, "--json"]) == 3
    assert json.loads(capsys.readouterr().out) == {"at": [], "nothing": None, "most": None}
    assert cli.run(["probe", scene]) == 3
    assert capsys.readouterr().out == "a short table\n"


@pytest.mark.usefixtures("probe")
def test_exit_codes_of_what_goes_wrong(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["probe", scene, "--at", "0,0,0"]) == 130
    assert capsys.readouterr().err == "blender-rad: interrupted\n"
    assert cli.run(["probe", scene, "--at", "1,1,1"]) == 70
    assert "bpy is not installed" in complaint(capsys, "probe", scene, "--at", "2,2,2")
    assert cli.run(["probe", scene, "--at", "3,3,3"]) == 70


def test_what_c_code_prints_is_not_on_standard_output() -> None:
    code = (
        "import os, sys; from blender_rad import cli; cli.run = lambda argv: os.write(1, b'Fra:1');"
        "sys.argv = ['x']; cli.main(); print('result')"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert (result.stdout, result.stderr) == ("result\n", "Fra:1")


def test_a_reader_that_has_had_enough_is_no_fault() -> None:
    code = "from blender_rad.cli import main; raise SystemExit(main())"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "--help"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(timeout=30) == 0


def test_verbs_are_functions(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    check = COMMANDS["check"]
    monkeypatch.setattr(
        check, "run", lambda self: Outcome({"t": self.tolerance, "r": self.resolution}, "")
    )
    document = blender_rad.check(scene, tolerance=0.02, resolution=(64, 48))
    assert document == {"t": 0.02, "r": [64, 48]}
    with pytest.raises(RadError, match="--tolerance"):
        blender_rad.check(scene, tolerance=2)
    with pytest.raises(AttributeError, match="no attribute 'chek'"):
        _ = blender_rad.chek


def test_a_submodule_with_a_verbs_name_can_be_called(monkeypatch: pytest.MonkeyPatch) -> None:
    module = type(sys)("blender_rad.check")
    monkeypatch.setattr(blender_rad, "check", module, raising=False)
    assert blender_rad.check is module
    with pytest.raises(RadError, match="no such file"):
        blender_rad.check("none.blend")
