# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m blender_rad``, the same as ``blender-rad``."""

import sys

from .cli import main

sys.exit(main())
