# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of options: from the command line's text, or as they come from Python.

Each parser returns the checked value, or raises `ValueError` with the words for what was expected.
"""

import math
import operator
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import RadError
from ..quantities import EFFICACIES_LM_W

Parse = Callable[[Any], Any]

FRAME_LIMIT = 1_048_574  # Blender's own
RESOLUTION_LIMIT = 65_536  # Blender's own


@dataclass(frozen=True)
class Value:
    """A parser: what `convert` gives, where it is `allowed`; else `expected` is said."""

    metavar: str
    expected: str
    convert: Callable[[Any], Any]
    allowed: Callable[[Any], object] = lambda result: True

    def __call__(self, value: Any) -> Any:
        try:
            result = self.convert(value)
            if self.allowed(result):
                return result
        except (ValueError, TypeError, ArithmeticError):
            pass
        raise ValueError(self.expected)


def split(value: Any, mark: str = ",") -> list[Any]:
    """Return the parts of a text between marks, or what a list of Python's holds."""
    return re.split(mark, value, flags=re.IGNORECASE) if isinstance(value, str) else list(value)


text = Value("NAME", "a name", lambda value: value, lambda name: isinstance(name, str) and name)


def choice(*names: str) -> Parse:
    """Return a parser of one of `names`."""
    return Value("|".join(names), f"one of: {', '.join(names)}", str, names.__contains__)


def names(*known: str) -> Parse:
    """Return a parser of a comma-separated list, each of `known` where these are given."""
    expected = f"a comma-separated list of: {', '.join(known)}" if known else "names with commas"
    return Value(
        "A,B",
        expected,
        lambda value: tuple(dict.fromkeys(str(entry).strip() for entry in split(value))),
        lambda entries: entries and all(entries) and not (known and set(entries) - set(known)),
    )


def integer(low: int, high: int | None = None) -> Parse:
    """Return a parser of a whole number, both ends included."""
    expected = f"a whole number of at least {low}" + ("" if high is None else f", at most {high}")
    return Value(
        "N",
        expected,
        lambda value: int(value) if isinstance(value, str) else operator.index(value),
        lambda result: low <= result <= (math.inf if high is None else high),
    )


def number(low: float = -math.inf, high: float = math.inf, *, closed: bool = False) -> Parse:
    """Return a parser of a finite number, both ends excluded, `closed` ones but the upper."""
    limits = [f"{'at least' if closed else 'above'} {low:g}"] * (low > -math.inf)
    limits += [f"below {high:g}"] * (high < math.inf)
    return Value(
        "X",
        f"a number {' and '.join(limits)}".strip(),
        float,
        lambda x: math.isfinite(x) and (low < x < high or (closed and x == low)),
    )


def vector(length: int) -> Parse:
    """Return a parser of `length` finite numbers with commas between them."""
    return Value(
        ",".join("XYZ"[:length]),
        f"{length} numbers with commas between them",
        lambda value: tuple(map(float, split(value))),
        lambda result: len(result) == length and all(map(math.isfinite, result)),
    )


# (width, height) of ``WIDTHxHEIGHT`` in pixels
resolution = Value(
    "WxH",
    f"WIDTHxHEIGHT in pixels, each 1 to {RESOLUTION_LIMIT}",
    lambda value: tuple(map(integer(1, RESOLUTION_LIMIT), split(value, "x"))),
    lambda size: len(size) == 2,
)


def _frames(value: Any) -> tuple[int, ...]:
    if isinstance(value, str):
        match = re.fullmatch(r"(-?\d+)(?:-(-?\d+))?", value)
        value = (match[1], match[2] or match[1]) if match else ()
    return tuple(map(integer(-FRAME_LIMIT, FRAME_LIMIT), value))


# (first, last) of ``A-B``, or of a single frame
frame_range = Value(
    "A-B",
    f"FIRST-LAST, or one frame, within {-FRAME_LIMIT} to {FRAME_LIMIT}",
    _frames,
    lambda frames: len(frames) == 2 and frames[0] <= frames[1],
)

# the luminous efficacy [lm/W] that is named or given
efficacy = Value(
    "NAME|NUMBER",
    f"one of: {', '.join(EFFICACIES_LM_W)}, or a number of lm/W above 0",
    lambda value: EFFICACIES_LM_W[value] if value in EFFICACIES_LM_W else number(0)(value),
)


def input_file(kind: str, suffix: str = "") -> Parse:
    """Return a parser of the path of a file that exists; `suffix` is a pattern of what it ends in.

    `kind` says what is expected.
    """
    expected = f"expected {kind}"

    def parse(value: Any) -> Path:
        path = Path(value)
        if not path.is_file():
            raise RadError("a folder" if path.is_dir() else "no such file", str(path), expected)
        if not re.fullmatch(suffix or ".*", path.suffix, re.IGNORECASE):
            raise RadError("not a scene", str(path), expected)
        return path

    return parse


scene_file = input_file("a .blend, .glb or .gltf file", r"\.(blend\d*|glb|gltf)")
exr_input = input_file("an EXR file")


def output_file(*suffixes: str) -> Parse:
    """Return a parser of a path that can be written and ends in one of `suffixes`."""
    kinds = " or ".join(suffixes)

    def parse(value: Any) -> Path:
        path = Path(value)
        if path.suffix.lower() not in suffixes:
            raise RadError("cannot write this format", str(path), f"expected a {kinds} file")
        if path.is_dir() or not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
            raise RadError("cannot write there", str(path), "expected a file in a folder to write")
        return path

    return parse


def output_folder(value: Any) -> Path:
    """Return the path of a folder that exists or can be made."""
    path = Path(value)
    if not str(value):
        raise ValueError("a folder")
    nearest = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise RadError("cannot write there", str(path), "expected a folder, made if missing")
    return path
