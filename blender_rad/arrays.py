# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of the engine: numbers in double and single precision, indices, and masks."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Indices = NDArray[np.int32]
Bools = NDArray[np.bool_]
