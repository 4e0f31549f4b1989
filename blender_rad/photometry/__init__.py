# SPDX-License-Identifier: GPL-3.0-or-later
"""Photometric files: IES LM-63 and EULUMDAT, read into one model and checked."""

import os
from dataclasses import replace
from pathlib import Path

from ..errors import RadError
from .checks import check
from .distribution import Distribution
from .ies import is_ies, parse_ies
from .ldt import parse_ldt
from .text import Reader
from .writing import MADE_FOR_BLENDER, as_ies

__all__ = ["MADE_FOR_BLENDER", "Distribution", "as_ies", "parse_photometry", "read_photometry"]


def read_photometry(path: str | os.PathLike[str], lamp_set: int = 1) -> Distribution:
    """Return the distribution that an IES or LDT file holds, with what was found wrong in it.

    `lamp_set` counts those of an LDT file from 1. Where the file cannot be read, or its light
    cannot be known, RadError names the line and the reason.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or "cannot be read"
        raise RadError(reason, str(path), "expected an IES or LDT file") from None
    return parse_photometry(data, str(path), lamp_set=lamp_set, folder=path.parent)


def parse_photometry(
    data: bytes, name: str, *, lamp_set: int = 1, folder: Path | None = None
) -> Distribution:
    """Return the distribution that the content of a file holds; see `read_photometry`.

    What the content is decides, not what the name ends in. A tilt file is looked for in `folder`.
    """
    reader = Reader(data, name)
    light = parse_ies(reader, folder) if is_ies(reader) else parse_ldt(reader, lamp_set)
    return replace(light, findings=light.findings + check(light, name))
