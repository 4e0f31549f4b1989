# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender-rad``: the parser, made from the verbs; exit codes; who may write where.

Standard output belongs to the result. Blender and other libraries write to it from C, so `main`
gives them standard error in its place.
"""

import argparse
import logging
import os
import re
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import fields
from typing import Any, NoReturn

from . import __version__
from .commands import COMMANDS, Command, flag_of
from .errors import RadError, unknown_name
from .strict_json import dumps

PROGRAM = "blender-rad"
PACKAGE = __name__.rpartition(".")[0]
HERE = "command line"
BAD_INPUT, CRASHED, INTERRUPTED = 2, 70, 130

log = logging.getLogger(__name__)


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are `RadError`, and to which ``-1,2,3`` is a value."""

    def __init__(self, prog: str, description: str) -> None:
        super().__init__(
            prog,
            description=description,
            allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        raise RadError(message, HERE, f"expected what `{self.prog} --help` shows")


def main() -> int:
    """Run the program and return its exit code."""
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="backslashreplace")
    os.dup2(2, 1)
    code = run(sys.argv[1:])
    _write("")
    return code


def run(argv: Sequence[str]) -> int:
    """Run a command line within this process and return its exit code."""
    logging.basicConfig(format=f"{PROGRAM}: %(message)s", level=logging.WARNING)
    try:
        return _run(argv)
    except SystemExit as end:  # --help and --version
        return int(end.code or 0)
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED
    except RadError as error:
        return _complain(error)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and not (error.name or PACKAGE).startswith(
            PACKAGE
        ):
            python = "Python {}.{}".format(*sys.version_info)
            with_extra = "Python 3.11 or 3.13 and the package with its extra: pip install '.[bpy]'"
            what = f"{error.name} is not installed"
            return _complain(RadError(what, python, f"expected {with_extra}"))
        log.exception("a fault of this program, not of its input")
        return CRASHED


def _run(argv: Sequence[str]) -> int:
    verb = _program_parser().parse_args(argv[:1]).verb
    if verb not in COMMANDS:
        raise unknown_name("verb", verb, HERE, list(COMMANDS))
    command_class = COMMANDS[verb]
    given = vars(_verb_parser(verb, command_class).parse_args(argv[1:]))
    as_json, verbose = given.pop("json"), given.pop("verbose")
    logging.getLogger().setLevel(max(logging.DEBUG, logging.WARNING - 10 * verbose))
    with _standard_output_for_chatter():
        outcome = command_class(**given).run()
    _write((dumps(outcome.document) if as_json else outcome.text) + "\n")
    return outcome.code


@contextmanager
def _standard_output_for_chatter() -> Generator[None]:
    """Let Python's standard output be descriptor 1 again: Blender's operators report there."""
    with open(1, "w", encoding="utf-8", errors="backslashreplace", closefd=False) as chatter:
        with redirect_stdout(chatter):
            yield


def _program_parser() -> Parser:
    width = max(map(len, COMMANDS))
    verbs = "\n".join(f"  {name:{width}}  {_summary(COMMANDS[name])}" for name in sorted(COMMANDS))
    parser = Parser(PROGRAM, f"Light in Blender that means what its units say.\n\nverbs:\n{verbs}")
    parser.add_argument("verb", metavar="VERB", help=f"`{PROGRAM} VERB --help` shows its options")
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    return parser


def _verb_parser(verb: str, command: type[Command]) -> Parser:
    """Return the parser of a verb; it gathers text, and the dataclass checks it."""
    parser = Parser(f"{PROGRAM} {verb}", _summary(command))
    for entry in fields(command):
        meta = entry.metadata
        several: dict[str, Any] = {"nargs": "+", "action": "extend"} if meta["several"] else {}
        if meta["positional"]:
            parser.add_argument(entry.name, metavar=meta["metavar"], help=meta["help"], **several)
            continue
        parser.add_argument(
            *["-o"] * (entry.name == "output"),
            flag_of(entry),
            dest=entry.name,
            metavar=meta["metavar"],
            help=meta["help"],
            required=meta["required"],
            default=argparse.SUPPRESS,
            **several,
        )
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument(
        "-v", "--verbose", action="count", default=0, help="say what is done; twice: all of it"
    )
    return parser


def _summary(command: type[Command]) -> str:
    return (command.__doc__ or "").partition("\n")[0]


def _write(text: str) -> None:
    """Write to standard output now; a reader that has had enough is no fault."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _say(message: str) -> None:
    sys.stderr.write(f"{PROGRAM}: {' '.join(message.splitlines())}\n")


def _complain(error: RadError) -> int:
    log.info("raised here", exc_info=error)
    _say(f"error: {error}")
    return BAD_INPUT
