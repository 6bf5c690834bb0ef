"""The kinds of arrays that the project has; shapes stand where an array is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Int32s = NDArray[np.int32]  # contours, and all that is kept for each of many
Flags = NDArray[np.bool_]
