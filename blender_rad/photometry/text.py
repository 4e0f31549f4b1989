# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of photometric files: encodings and line ends as found, numbers with their lines."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from ..arrays import Floats
from ..errors import Finding, RadError, Severity

SIZE_LIMIT = 64 << 20  # bytes; the largest real files have a hundredth of it
SAME_DEG = 1e-6
TINY = 1e-30  # no quantity here is smaller, or its inverse greater
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
NOT_TEXT = re.compile(r"[\0-\x08\x0e-\x19\x1b-\x1f]")


class Reader:
    """The lines of a file that messages call `name`, and what was found and repaired so far."""

    def __init__(self, data: bytes, name: str) -> None:
        self.name = name
        self.findings: list[Finding] = []
        self.lines = re.split(r"\r*\n|\r", self._decoded(data).rstrip("\x1a"))
        for line, text in enumerate(self.lines, 1):
            if NOT_TEXT.search(text):
                raise self.refuse("not a text file", line, "expected an IES or LDT file")

    def _decoded(self, data: bytes) -> str:
        if len(data) > SIZE_LIMIT:
            raise self.refuse("too large", 1, f"expected at most {SIZE_LIMIT >> 20} MiB")
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return data.decode("utf-16", "replace")
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError:
            self.note("not-utf-8", "info", "the text is not ASCII or UTF-8; read as Latin-1")
            return data.decode("latin-1")

    def note(
        self, code: str, severity: Severity, message: str, effect_percent: float | None = None
    ) -> None:
        self.findings.append(Finding(code, severity, self.name, message, effect_percent))

    def refuse(self, what: str, line: int, expected: str) -> RadError:
        """Return the error that says what is wrong in which line."""
        return RadError(what, f"{self.name}, line {line}", expected)

    def number(self, text: str, line: int, what: str) -> float:
        """Return the number of sane size that `text` is."""
        value = float(text) if NUMBER.fullmatch(text) else np.nan
        if not abs(value) < 1 / TINY:
            raise self.refuse(f"{text[:30]!r} is not a usable number", line, f"expected {what}")
        return value if abs(value) > TINY else 0.0

    def tokens(self, first: int, decimal_comma: bool = False) -> Numbers:
        """Return what blanks or commas part from line `first` (from 1) on."""
        lines = [text.replace(",", "." if decimal_comma else " ") for text in self.lines]
        rows = enumerate(lines[first - 1 :], first)
        return Numbers(self, ((line, token) for line, text in rows for token in text.split()))


class Numbers:
    """Numbers that are taken one after the other, each with its line."""

    def __init__(self, reader: Reader, tokens: Iterable[tuple[int, str]]) -> None:
        self.reader, self._tokens, self._at = reader, list(tokens), 0

    @property
    def line(self) -> int:
        """The line of the number taken last."""
        return self._tokens[self._at - 1][0] if self._at else 1

    def take(self, count: int, what: str) -> Floats:
        """Return the next `count` numbers."""
        taken = self._tokens[self._at : self._at + count]
        values = [self.reader.number(token, line, what) for line, token in taken]
        if len(taken) < count:
            last = self._tokens[-1][0] if self._tokens else len(self.reader.lines)
            message = f"the data ends after {len(taken)} of {count} numbers"
            raise self.reader.refuse(message, last, f"expected {what}")
        self._at += count
        return np.array(values, dtype=np.float64)

    def one(self, what: str) -> float:
        return float(self.take(1, what)[0])

    def choice(self, what: str, low: int, high: int | None = None) -> int:
        """Return the next number, which has to be a whole one from `low` to `high`."""
        value = self.one(what)
        if value != int(value) or value < low or (high is not None and value > high):
            limits = f"of at least {low}" if high is None else f"{low} to {high}"
            expected = f"expected {what}, a whole number {limits}"
            raise self.reader.refuse(f"{value:g} is not allowed", self.line, expected)
        return int(value)

    def note_rest(self) -> None:
        """Keep a finding of what stands after the last number that means something."""
        if self._at < len(self._tokens):
            line, token = self._tokens[self._at]
            rest = f"after the end of the table, {token[:30]!r} in line {line}, is ignored"
            if NUMBER.fullmatch(token):
                self.reader.note("trailing-values", "warning", f"what comes {rest}")
            else:
                self.reader.note("trailing-text", "info", f"text {rest}")
