"""How long what lies under a contour must cool before it is printed over, on bare arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints


class Lags(NamedTuple):
    """The contours below each contour and how long they need."""

    offsets: Ints  # (n + 1,)
    below: Int32s  # (m,) those below b at below[offsets[b]:offsets[b + 1]]
    seconds: Floats  # (m,) b begins no sooner than this after the end of each


def no_lags(n: int) -> Lags:
    """Return the lags of n contours none of which has to cool."""
    return Lags(np.zeros(n + 1, np.int64), np.empty(0, np.int32), np.empty(0))
