# SPDX-License-Identifier: GPL-3.0-or-later
"""Files are whole or not there, with nothing left beside them; JSON is what every parser reads."""

import json
import os
from pathlib import Path, PurePosixPath

import numpy as np
import pytest

from blender_rad.atomic import atomic_path
from blender_rad.errors import Finding
from blender_rad.strict_json import dumps, plain


def test_success_puts_the_file_in_place_with_the_usual_permissions(tmp_path):
    target, link = tmp_path / ("n" * 246 + ".exr"), tmp_path / "link.exr"
    link.symlink_to(target)
    with atomic_path(link) as temporary:
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".exr")
        temporary.write_bytes(b"new")
        assert not target.exists()
    (tmp_path / "plain").write_bytes(b"")
    assert target.read_bytes() == b"new" and link.is_symlink()
    assert target.stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert set(tmp_path.iterdir()) == {target, link, tmp_path / "plain"}
    with atomic_path(os.devnull) as temporary:
        temporary.write_text("x")
    assert not Path(os.devnull).is_file()


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, FileNotFoundError])
def test_failure_leaves_the_old_file_alone(tmp_path, error):
    target = tmp_path / "out.json"
    target.write_text("old")
    with pytest.raises(error), atomic_path(target) as temporary:
        if error is not FileNotFoundError:  # which is what writing nothing is
            temporary.write_text("half")
            raise error
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_json_is_strict():
    assert plain([float("nan"), np.float32("inf"), np.array([[1.0, -np.inf]])]) == [
        None, None, [[1.0, None]],
    ]  # fmt: skip
    finding = Finding("code", "info", "Key", "λ\udcff", effect_percent=float("nan"))
    document = {"a": np.int64(3), "b": np.bool_(True), 4: PurePosixPath("x/y"), "c": (finding,)}
    assert dumps(document).isascii()
    found = json.loads(dumps(document))
    (row,) = found.pop("c")
    assert found == {"a": 3, "b": True, "4": "x/y"} and found["b"] is True
    assert (row["object"], row["message"], row["effect_percent"]) == ("Key", "λ\udcff", None)
    with pytest.raises(TypeError, match="object has no meaning"):
        dumps({"a": object()})
