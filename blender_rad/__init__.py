# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes light in Blender mean what its units say, and proves it.

Every verb of the command line is a function here: ``blender_rad.check("a.blend", tolerance=0.02)``
returns the document that ``blender-rad check a.blend --tolerance 0.02 --json`` prints.
"""

import sys
from collections.abc import Callable
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

Verb = Callable[..., dict[str, object]]


def _is_verb(name: str) -> bool:
    """Tell whether `commands` has a file of that name, without loading any."""
    folder = Path(__file__).parent / "commands"
    return not name.startswith("_") and PathFinder.find_spec(name, [str(folder)]) is not None


def _verb(name: str) -> Verb:
    from .commands import COMMANDS, as_function

    return as_function(name, COMMANDS[name])


class _VerbModule(ModuleType):
    """A submodule that shares its name with a verb (`lights`, `render`): it can be called too."""

    def __call__(self, *args: Any, **options: Any) -> dict[str, object]:
        return _verb(self.__name__.rpartition(".")[2])(*args, **options)


class _Package(ModuleType):
    def __getattr__(self, name: str) -> Verb:
        if not _is_verb(name):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return _verb(name)

    def __setattr__(self, name: str, value: object) -> None:
        if type(value) is ModuleType and _is_verb(name):
            value.__class__ = _VerbModule
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        from .commands import COMMANDS

        return sorted({*super().__dir__(), *COMMANDS})


sys.modules[__name__].__class__ = _Package
