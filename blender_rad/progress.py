# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress bars, on terminals only."""

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager

LISTENERS: list[Callable[[str, float], None]] = []  # told what is done, and the share of it


@contextmanager
def bar(what: str) -> Generator[Callable[[float], None]]:
    """Yield a function that shows the share of the work done, 0 to 1, on standard error."""
    from tqdm import tqdm

    form = "{desc} {percentage:3.0f} % |{bar}| {elapsed} {remaining} to go"
    with tqdm(
        total=1.0, desc=what, bar_format=form, leave=False, disable=not sys.stderr.isatty()
    ) as shown:

        def update(share: float) -> None:
            shown.update(max(0.0, share - shown.n))
            for listen in LISTENERS:
                listen(what, share)

        yield update
