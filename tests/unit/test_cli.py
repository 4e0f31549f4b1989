# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: exit codes, one-line complaints, and a standard output of the result alone."""

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
def test_every_verb_is_named_as_its_file_and_has_help(verb, capsys):
    assert COMMANDS[verb].__module__ == f"blender_rad.commands.{verb}"
    assert cli.run([verb, "-h"]) == 0
    assert COMMANDS[verb].__doc__.partition("\n")[0][:40] in capsys.readouterr().out
    assert cli.run(["--help"]) == 0
    assert f"\n  {verb} " in capsys.readouterr().out


BAD = {
    "--resolution 0x10": "'0x10' is not allowed|--resolution|WIDTHxHEIGHT",
    "--resolution -4x10": "--resolution",
    "--resolution 1000000x1000000": "--resolution",
    "--samples 0": "--samples|at least 1",
    "--samples": "--samples|expected one argument",
    "--frame=-1048575": "--frame|at least -1048574",
    "--model blue": "--model|cycles, physical",
    "--efficacy 0": "--efficacy|photopic, cycles-ies, radiance",
    "check --tolerance 1": "--tolerance|above 0 and below 1",
    "check --toleranc 0.1": "unrecognized|check --help",
    "check --frames 9-3": "--frames|FIRST-LAST",
    "check --frames 3 --frame 3": "--frame and --frames|exclude each other",
    "check --against cycles,povray": "--against|cycles, radiance, mitsuba",
    "check --exposure 2": "--exposure|--render",
    "check --exposure -2": "'-2'|--exposure",
    "check --render none.exr": "no such file|none.exr",
    "render --error=-0.1": "--error",
    "render --error 0.1 --samples 4": "--error and --samples",
}


@pytest.mark.parametrize("options", BAD)
def test_bad_options_are_one_line(options, scene, tmp_path, capsys):
    verb, dashes, rest = options.partition("--")
    verb = verb.strip() or "render"
    output = ["-o", str(tmp_path / "a.exr")] if verb == "render" else []
    line = complaint(capsys, verb, scene, *output, *shlex.split(dashes + rest))
    assert all(word in line for word in BAD[options].split("|")), line


def test_bad_scenes_verbs_and_outputs_are_one_line_before_the_work(scene, tmp_path, capsys):
    (tmp_path / "a.txt").write_text("")
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "cycles.exr").touch()
    long = 300 * "x" + ".exr"  # longer than a file's name can be
    for said, *argv in (
        ("no such file", "check", tmp_path / "two\nlines.blend"),
        ("not a scene", "check", tmp_path / "a.txt"),
        ("a folder", "check", tmp_path),
        ("SCENE", "check"),
        (", ".join(sorted(COMMANDS)), "chek"),
        ("VERB",),
        ("--output", "render", scene),
        ("expected a usable path", "render", scene, "-o", tmp_path / long),
        ("expected a usable path", "check", scene, "--report", tmp_path / long),
        ("cannot write", "check", scene, "--report", f"{scene}/below"),
        ("cannot write", "check", scene, "--report", scene),
        *(
            ("cannot write", "render", scene, "-o", tmp_path / bad)
            for bad in ("a.png", "a.blend", "no/a.exr", "a.blend/a.exr", "folder.exr", "/proc/a")
        ),
        (
            "would overwrite", "check", scene,
            "--render", tmp_path / "cycles.exr", "--report", tmp_path,
        ),
    ):  # fmt: skip
        assert said in complaint(capsys, *map(str, argv)), argv


@pytest.mark.usefixtures("probe")
@pytest.mark.parametrize(
    "at", [["--at", "-1,2,-.5"], ["--at=-1,2,-.5"], ["--at", "9,9,9", "--at", "-1,2,-.5"]]
)
def test_values_may_begin_with_a_minus(at, scene, capsys):
    assert cli.run(["probe", scene, *at, "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["at"][-1] == [-1.0, 2.0, -0.5]


@pytest.mark.usefixtures("probe")
def test_json_is_strict_people_get_text_and_faults_have_their_codes(scene, capsys):
    assert cli.run(["probe", scene, "--json"]) == 3
    assert json.loads(capsys.readouterr().out) == {"at": [], "nothing": None, "most": None}
    assert cli.run(["probe", scene]) == 3
    assert capsys.readouterr().out == "a short table\n"
    assert cli.run(["probe", scene, "--at", "0,0,0"]) == 130
    assert capsys.readouterr().err == "blender-rad: interrupted\n"
    assert cli.run(["probe", scene, "--at", "1,1,1"]) == 70
    assert "bpy is not installed" in complaint(capsys, "probe", scene, "--at", "2,2,2")
    assert cli.run(["probe", scene, "--at", "3,3,3"]) == 70


def python(code):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code], **pipes)


def test_help_loads_nothing_heavy_and_what_c_code_prints_is_not_on_standard_output():
    light = (
        "import sys; from blender_rad import cli; cli.run(['check', '--help']);"
        "sys.exit(','.join({'numpy', 'bpy', 'matplotlib', 'colour', 'embreex'} & set(sys.modules)))"
    )
    assert python(light).communicate(timeout=60)[1].strip() == ""
    noisy = (
        "import os, sys; from blender_rad import cli; cli.run = lambda argv: os.write(1, b'Fra:1');"
        "sys.argv = ['x']; cli.main(); print('result')"
    )
    assert python(noisy).communicate(timeout=60) == ("result\n", "Fra:1")


def test_a_reader_that_has_had_enough_is_no_fault():
    code = "import sys; from blender_rad import cli; sys.argv[1:] = ['-h']; sys.exit(cli.main())"
    with python(code) as run:
        run.stdout.close()
        assert run.stderr.read() == ""
        assert run.wait(timeout=60) == 0


def test_verbs_are_functions(scene, monkeypatch):
    outcome = lambda self: Outcome({"t": self.tolerance, "r": self.resolution}, "")  # noqa: E731
    monkeypatch.setattr(COMMANDS["check"], "run", outcome)
    document = blender_rad.check(scene, tolerance=0.02, resolution=(64, 48))
    assert document == {"t": 0.02, "r": [64, 48]}
    with pytest.raises(RadError, match="--tolerance"):
        blender_rad.check(scene, tolerance=2)
    with pytest.raises(AttributeError, match="no attribute 'chek'"):
        _ = blender_rad.chek
    module = type(sys)("blender_rad.check")  # a submodule with a verb's name can be called
    monkeypatch.setattr(blender_rad, "check", module, raising=False)
    with pytest.raises(RadError, match="no such file"):
        blender_rad.check("none.blend")
