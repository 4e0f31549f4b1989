# SPDX-License-Identifier: GPL-3.0-or-later
"""What a verb is: a frozen dataclass of its options with a `run`.

The command line's parser, the checks of values and the Python function are all made from the
dataclass's fields, so that an option is one line in one place.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from typing import Any, NamedTuple, cast

from ..errors import RadError
from ..registry import Registry
from ..strict_json import plain
from ._values import Parse

COMMANDS: Registry[type[Command]] = Registry(__name__.rpartition(".")[0], "verb")


class Outcome(NamedTuple):
    """What a verb hands back: the JSON document, a short text for people, the exit code."""

    document: Mapping[str, object]
    text: str
    code: int = 0


def aligned(rows: Iterable[Sequence[str]], left: int = 1) -> list[str]:
    """Return rows as lines of aligned columns, the first `left` of them to the left."""
    columns = [
        [f"{cell:{'<' if k < left else '>'}{max(map(len, column))}}" for cell in column]
        for k, column in enumerate(zip(*rows, strict=True))
    ]
    return ["  ".join(line).rstrip() for line in zip(*columns, strict=True)]


def option(
    parse: Parse,
    help: str,
    *,
    default: Any = None,
    metavar: str | None = None,
    positional: bool = False,
    several: bool = False,
    required: bool = False,
) -> Any:
    """Return the dataclass field of an option.

    Parameters
    ----------
    parse : takes the command line's text or the Python API's value, returns the checked value;
        raises `ValueError` with what was expected. It sees the default too, unless that is None.
    metavar : where `parse` has none.
    several : takes one or more values, may be repeated, and is a tuple.
    """
    if default not in (None, ()):
        shown = ",".join(default) if isinstance(default, tuple) else default
        help += f" (default: {shown:g})" if isinstance(shown, float) else f" (default: {shown})"
    metadata = {
        "parse": parse,
        "help": help,
        "metavar": metavar or getattr(parse, "metavar", None),
        "positional": positional,
        "required": required,
        "several": several,
    }
    if positional or required:
        return field(metadata=metadata, kw_only=not positional)
    return field(default=() if several else default, metadata=metadata)


def flag_of(entry: Field[Any]) -> str:
    """Return an option's name on the command line."""
    if entry.metadata["positional"]:
        return str(entry.metadata["metavar"])
    return "--" + entry.name.rstrip("_").replace("_", "-")


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A verb with its options, checked when it is made: `RadError` for those not allowed."""

    def __init_subclass__(cls, verb: str | None = None) -> None:
        if verb is not None:
            COMMANDS.register(verb)(cls)

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if value is not entry.default or value not in (None, ()):
                object.__setattr__(self, entry.name, _checked(entry, value))

    @abstractmethod
    def run(self) -> Outcome:
        """Do it, and return the result."""

    def exclude(self, *names: str) -> None:
        """Raise where more than one of the named options is given."""
        given = [entry for entry in fields(self) if entry.name in names and self._has(entry)]
        if len(given) > 1:
            listed = " and ".join(flag_of(entry) for entry in given)
            raise RadError("these exclude each other", listed, "expected only one of them")

    def require(self, name: str, other: str) -> None:
        """Raise where the option `name` is given without the `other` that it belongs to."""
        by_name = {entry.name: entry for entry in fields(self)}
        if self._has(by_name[name]) and not self._has(by_name[other]):
            here, there = flag_of(by_name[name]), flag_of(by_name[other])
            raise RadError("this option means nothing by itself", here, f"expected {there} as well")

    def _has(self, entry: Field[Any]) -> bool:
        return getattr(self, entry.name) != entry.default


def _checked(entry: Field[Any], value: Any) -> Any:
    if not entry.metadata["several"]:
        return _parsed(entry, value)
    values = cast(Iterable[Any], value) if isinstance(value, (list, tuple)) else (value,)
    return tuple(_parsed(entry, single) for single in values)


def _parsed(entry: Field[Any], value: Any) -> Any:
    try:
        return entry.metadata["parse"](value)
    except RadError:
        raise
    except OSError as error:  # a path that no file can have: too long, or a loop of links
        raise RadError(str(error.strerror), str(value), "expected a usable path") from None
    except (ValueError, TypeError, OverflowError) as error:
        expected = f"expected {error}"
        raise RadError(f"{str(value)!r} is not allowed", flag_of(entry), expected) from None


def as_function(name: str, command: type[Command]) -> Callable[..., dict[str, object]]:
    """Return the verb as a Python function of its options."""

    def function(*args: Any, **options: Any) -> dict[str, object]:
        return plain(command(*args, **options).run().document)

    options = "\n".join(f"{e.name} : {e.metadata['help']}" for e in fields(command))
    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{inspect.getdoc(command)}\n\nParameters\n----------\n{options}\n"
    signature = inspect.signature(command).replace(return_annotation=dict[str, object])
    vars(function)["__signature__"] = signature
    return function
