# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender extension's door. It imports nothing until Blender enables it."""


def register() -> None:
    from importlib import import_module  # `from . import` would give what `unregister` let go of

    import_module(f"{__name__}.addon").register()


def unregister() -> None:
    """Undo `register`, and let go of every module, so that enabling again loads what is on disk."""
    import sys

    sys.modules[f"{__name__}.addon"].unregister()
    for name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
        del sys.modules[name]
    for name in ("addon", "blender_rad"):  # `from . import` would find the old ones here
        globals().pop(name, None)
