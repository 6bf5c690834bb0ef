"""How long what lies under a contour must cool before it is printed over, on bare arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Lags(NamedTuple):
    """The contours below each contour and how long they need."""

    offsets: NDArray[np.int64]  # (n + 1,)
    below: NDArray[np.int32]  # (m,) those below b at below[offsets[b]:offsets[b + 1]]
    seconds: NDArray[np.float64]  # (m,) b begins no sooner than this after the end of each


def no_lags(n: int) -> Lags:
    """Return the lags of n contours none of which has to cool."""
    return Lags(np.zeros(n + 1, np.int64), np.empty(0, np.int32), np.empty(0))
