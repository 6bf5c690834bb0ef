"""Which part of a bead a wipe goes back along."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def level_part(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first points of a way up to where it goes straight up or down.

    A wipe does not go back into a vertical bead.
    """
    step = np.diff(way, axis=0)
    upright = np.flatnonzero((step[:, 2] != 0.0) & (step[:, :2] == 0.0).all(axis=1))
    return way[: upright[0] + 1] if len(upright) else way


def first_part(way: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return the first `length` mm of a polyline."""
    step = np.linalg.norm(np.diff(way, axis=0), axis=1)
    reach = np.cumsum(step)
    k = int(np.searchsorted(reach, length))
    if k >= len(step):
        return way
    before = reach[k - 1] if k else 0.0
    t = (length - before) / step[k] if step[k] > 0 else 0.0
    last = way[k] + t * (way[k + 1] - way[k])
    return np.concatenate([way[: k + 1], np.round(last, 3)[None]])
