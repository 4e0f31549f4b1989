# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON that every parser reads: what is not finite is null, arrays are lists, keys are text."""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import Any, cast


def plain(value: object) -> Any:
    """Return `value` made of dict, list, str, int, float, bool and None; `TypeError` where not."""
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, PurePath):
        return str(value)
    if hasattr(value, "tolist"):  # NumPy's arrays and scalars, without importing NumPy
        return plain(cast(Any, value).tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        items = cast(Mapping[object, object], value).items()
        return {str(key): plain(entry) for key, entry in items}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(entry) for entry in cast(Iterable[object], value)]
    raise TypeError(f"{type(value).__name__} has no meaning in JSON")


def dumps(value: object) -> str:
    """Return `value` as indented JSON in plain ASCII."""
    return json.dumps(plain(value), indent=2, allow_nan=False)
