# SPDX-License-Identifier: GPL-3.0-or-later
"""Registries that fill themselves: one file a light, BSDF, metric or verb, and nothing to edit."""

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from typing import Generic, TypeVar, cast

T = TypeVar("T")
Entry = TypeVar("Entry")


class Registry(Mapping[str, T], Generic[T]):
    """A name-to-object table that imports its package's modules on first use, but `_` ones."""

    def __init__(self, package: str, kind: str) -> None:
        self._package, self._kind = package, kind
        self._entries: dict[str, T] = {}
        self._loaded = False

    def register(self, key: str) -> Callable[[Entry], Entry]:
        """Return a decorator that enters its object under `key`; a key taken twice raises."""

        def enter(entry: Entry) -> Entry:
            if key in self._entries:
                raise KeyError(f"{self._kind} {key!r} is registered twice")
            self._entries[key] = cast("T", entry)
            return entry

        return enter

    def _load(self) -> dict[str, T]:
        if not self._loaded:
            package = importlib.import_module(self._package)
            for module in pkgutil.iter_modules(package.__path__):
                if not module.name.startswith("_"):
                    importlib.import_module(f"{self._package}.{module.name}")
            self._loaded = True
        return self._entries

    def __getitem__(self, key: str) -> T:
        entries = self._load()
        if key not in entries:
            known = ", ".join(sorted(entries))
            raise KeyError(f"unknown {self._kind} {key!r}; known: {known}")
        return entries[key]

    def __contains__(self, key: object) -> bool:
        return key in self._load()

    def __iter__(self) -> Iterator[str]:
        return iter(self._load())

    def __len__(self) -> int:
        return len(self._load())
