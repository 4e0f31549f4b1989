# SPDX-License-Identifier: GPL-3.0-or-later
"""What can go wrong, said so that a user knows what to do next."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "warning", "error"]


class RadError(ValueError):
    """Bad input or usage: what, where, what was expected.

    The command line prints it as one line and exits with 2; the add-on reports it as an error.
    """

    def __init__(self, what: str, where: str, expected: str) -> None:
        super().__init__(f"{what}, {where}, {expected}")
        self.what, self.where, self.expected = what, where, expected


def unknown_name(kind: str, name: str, where: str, known: list[str]) -> RadError:
    """Return the error for a name that does not exist, listing those that do."""
    listed = ", ".join(sorted(known)) if known else "none"
    return RadError(f"unknown {kind} {name!r}", where, f"expected one of: {listed}")


@dataclass(frozen=True)
class Finding:
    """Something a user should know about the scene or the run."""

    code: str  # a stable kebab-case key
    severity: Severity
    object: str  # name of the light, object, material or setting; empty for the whole scene
    message: str
    effect_percent: float | None = None  # on the light, where that is known

    def __str__(self) -> str:
        about = f" {self.object}:" if self.object else ""
        return f"{self.severity}:{about} {self.message} [{self.code}]"
