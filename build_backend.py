# SPDX-License-Identifier: GPL-3.0-or-later
"""Flit's build backend behind a door that tells another Python which one to take.

Without it pip would look for versions of our dependencies for minutes before it gives up.
"""

import sys

if sys.version_info[:2] not in {(3, 11), (3, 13)}:
    this = "{}.{}".format(*sys.version_info)
    sys.exit(f"Radiometric needs Python 3.13 (Blender 5.2) or 3.11 (Blender 4.5), not {this}.")

from flit_core.buildapi import *  # noqa: F403
