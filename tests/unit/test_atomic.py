# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic files: whole or not there, and nothing left beside them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from blender_rad.atomic import atomic_path


def test_success_puts_the_file_in_place_with_the_usual_permissions(tmp_path: Path) -> None:
    target = tmp_path / "out.exr"
    with atomic_path(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".exr"
        temporary.write_bytes(b"new")
        assert not target.exists()
    (tmp_path / "plain").write_bytes(b"")
    assert target.read_bytes() == b"new"
    assert target.stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.exr", "plain"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_failure_leaves_the_old_file_alone(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "out.json"
    target.write_text("old")
    with pytest.raises(error), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise error
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_writing_nothing_or_nowhere_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "out"):
        pass
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "no" / "out") as temporary:
        temporary.write_text("x")


def test_long_names_and_links_work(tmp_path: Path) -> None:
    target, link = tmp_path / ("n" * 250), tmp_path / "link"
    link.symlink_to(target)
    with atomic_path(link) as temporary:
        temporary.write_text("x")
    assert link.is_symlink()
    assert target.read_text() == "x"


def test_devices_are_written_to_not_replaced() -> None:
    with atomic_path(os.devnull) as temporary:
        temporary.write_text("x")
    assert not Path(os.devnull).is_file()
