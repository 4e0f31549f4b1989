# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of the engine: numbers in double precision, indices, and masks."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
