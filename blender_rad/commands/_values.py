# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of options: from the command line's text, or as they come from Python.

Each parser returns the checked value, or raises `ValueError` with the words for what was expected.
"""

from __future__ import annotations

import math
import operator
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import RadError
from ..quantities import EFFICACIES_LM_W

Parse = Callable[[Any], Any]

FRAME_LIMIT = 1_048_574  # Blender's own
RESOLUTION_LIMIT = 65_536  # Blender's own
SCENE_SUFFIX = re.compile(r"\.(blend\d*|glb|gltf)", re.IGNORECASE)


def text(value: Any) -> str:
    """Return a name as it is; an empty one is not a name."""
    if not isinstance(value, str) or not value:
        raise ValueError("a name")
    return value


def choice(*names: str) -> Parse:
    """Return a parser of one of `names`."""

    def parse(value: Any) -> str:
        if value not in names:
            raise ValueError(f"one of: {', '.join(names)}")
        return str(value)

    return parse


def names(*known: str) -> Parse:
    """Return a parser of a comma-separated list, each of `known` where these are given."""
    expected = f"a comma-separated list of: {', '.join(known)}" if known else "names with commas"

    def parse(value: Any) -> tuple[str, ...]:
        entries = value.split(",") if isinstance(value, str) else list(value)
        entries = tuple(str(entry).strip() for entry in entries)
        if not entries or not all(entries) or (known and not set(entries) <= set(known)):
            raise ValueError(expected)
        return tuple(dict.fromkeys(entries))

    return parse


def integer(low: int, high: int | None = None) -> Parse:
    """Return a parser of a whole number, both ends included."""
    expected = f"a whole number of at least {low}" + ("" if high is None else f", at most {high}")

    def parse(value: Any) -> int:
        try:
            number = int(value) if isinstance(value, str) else operator.index(value)
        except (ValueError, TypeError):
            raise ValueError(expected) from None
        if number < low or (high is not None and number > high):
            raise ValueError(expected)
        return number

    return parse


def number(low: float = -math.inf, high: float = math.inf, *, closed: bool = False) -> Parse:
    """Return a parser of a finite number, both ends excluded unless `closed`."""
    limits = [f"above {low:g}"] * (low > -math.inf) + [f"below {high:g}"] * (high < math.inf)
    words = [f"{low:g} to {high:g}"] if closed else [" and ".join(limits)]
    expected = " ".join(["a number", *words]).strip()

    def parse(value: Any) -> float:
        try:
            result = float(value)
        except (ValueError, TypeError):
            raise ValueError(expected) from None
        inside = low <= result <= high if closed else low < result < high
        if not (math.isfinite(result) and inside):
            raise ValueError(expected)
        return result

    return parse


def vector(length: int) -> Parse:
    """Return a parser of `length` finite numbers with commas between them."""
    expected = f"{length} numbers with commas between them"

    def parse(value: Any) -> tuple[float, ...]:
        entries = value.split(",") if isinstance(value, str) else list(value)
        try:
            result = tuple(float(entry) for entry in entries)
        except (ValueError, TypeError):
            raise ValueError(expected) from None
        if len(result) != length or not all(map(math.isfinite, result)):
            raise ValueError(expected)
        return result

    return parse


def resolution(value: Any) -> tuple[int, int]:
    """Return (width, height) of ``WIDTHxHEIGHT`` in pixels."""
    entries = value.lower().split("x") if isinstance(value, str) else list(value)
    try:
        width, height = (integer(1, RESOLUTION_LIMIT)(entry) for entry in entries)
    except (ValueError, TypeError):
        raise ValueError(f"WIDTHxHEIGHT in pixels, each 1 to {RESOLUTION_LIMIT}") from None
    return width, height


def frame_range(value: Any) -> tuple[int, int]:
    """Return (first, last) of ``A-B``, or of a single frame."""
    expected = f"FIRST-LAST, or one frame, within {-FRAME_LIMIT} to {FRAME_LIMIT}"
    if isinstance(value, str):
        match = re.fullmatch(r"(-?\d+)(?:-(-?\d+))?", value)
        if match is None:
            raise ValueError(expected)
        value = (match[1], match[2] or match[1])
    try:
        first, last = (integer(-FRAME_LIMIT, FRAME_LIMIT)(entry) for entry in value)
    except (ValueError, TypeError):
        raise ValueError(expected) from None
    if first > last:
        raise ValueError(expected)
    return first, last


def efficacy(value: Any) -> float:
    """Return the luminous efficacy [lm/W] that is named or given."""
    if isinstance(value, str) and value in EFFICACIES_LM_W:
        return EFFICACIES_LM_W[value]
    try:
        return number(0)(value)
    except ValueError:
        listed = ", ".join(EFFICACIES_LM_W)
        raise ValueError(f"one of: {listed}, or a number of lm/W above 0") from None


def scene_file(value: Any) -> Path:
    """Return the path of a scene that exists."""
    expected = "expected a .blend, .glb or .gltf file"
    path = existing_file(value, expected)
    if not SCENE_SUFFIX.fullmatch(path.suffix):
        raise RadError("not a scene", str(path), expected)
    return path


def existing_file(value: Any, expected: str = "expected a file") -> Path:
    """Return the path of a file that exists."""
    path = Path(value)
    if path.is_dir():
        raise RadError("a folder", str(path), expected)
    if not path.is_file():
        raise RadError("no such file", str(path), expected)
    return path


def exr_input(value: Any) -> Path:
    """Return the path of an EXR file that exists."""
    return existing_file(value, "expected an EXR file")


def output_file(*suffixes: str) -> Parse:
    """Return a parser of a path that can be written and ends in one of `suffixes`."""
    kinds = " or ".join(suffixes)

    def parse(value: Any) -> Path:
        path = Path(value)
        if path.suffix.lower() not in suffixes:
            raise RadError("cannot write this format", str(path), f"expected a {kinds} file")
        folder = path.parent
        if path.is_dir() or not folder.is_dir() or not os.access(folder, os.W_OK):
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
