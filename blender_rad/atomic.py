# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are either whole or not there."""

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Generator[Path, None, None]:
    """Yield a path to write to, which becomes `path` when the block ends well.

    The temporary file lies beside `path` (a rename within one file system is atomic) and keeps its
    suffix, since some writers choose their format by it. When the block raises, an interrupt
    included, the temporary file is removed and what stood at `path` before is untouched. Links
    are followed; pipes and devices are written to directly, since they cannot be replaced.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        yield target
        return
    temporary = target.with_name(f".{target.stem[:100]}.{secrets.token_hex(6)}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: str | os.PathLike[str], text: str, newline: str | None = None) -> None:
    """Write `text` to `path`, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline=newline)
