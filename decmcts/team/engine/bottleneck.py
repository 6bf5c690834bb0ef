"""The part of the bed where heads on a rail hinder each other most.

Heads on one rail keep a separation, so in a window as wide as m separations at most m
heads can print. The bottleneck is the window with the most work for each of its m heads.
Whenever fewer than m heads print there, the whole print ends later
(`decmcts.team.bounds.makespan` has the proof).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.kinematics import fixed_order
from decmcts.print.machine import Machine

CELL_MM = 1.0  # windows begin this far apart


def bottleneck(
    boxes: NDArray[np.float64], seconds: NDArray[np.float64], machine: Machine
) -> NDArray[np.bool_]:
    """Return which contours lie in the bottleneck, (n,); none where heads stand in no fixed order.

    Parameters
    ----------
    boxes : (n, 4) min x, max x, min y, max y of each contour, mm
    seconds : (n,) printing times
    """
    row = fixed_order(machine)
    inside, most = np.zeros(len(seconds), np.bool_), 0.0
    if row is None or not len(seconds):
        return inside
    low, high = boxes[:, 2 * row.axis], boxes[:, 2 * row.axis + 1]
    for heads in range(1, len(machine.heads)):
        width = heads * row.apart_mm
        begin, work = _fullest(low - width, high, seconds)
        if work / heads > most:
            most, inside = work / heads, (low - width < begin) & (begin < high)
    return inside


def _fullest(
    low: NDArray[np.float64], high: NDArray[np.float64], work: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the place in most of the open intervals `low` to `high`, by work, and that work."""
    origin = low.min()
    cells = int((high.max() - origin) / CELL_MM) + 2
    first = np.floor((low - origin) / CELL_MM).astype(np.int64) + 1
    end = np.ceil((high - origin) / CELL_MM).astype(np.int64)
    change = np.bincount(first, work, cells + 1) - np.bincount(end, work, cells + 1)
    sums = np.cumsum(change)
    best = int(np.argmax(sums))
    return float(origin + best * CELL_MM), float(sums[best])
