"""The most work in a window that only one head fits into at a time.

Where any two nozzles in a window are too near to each other, whatever the heads, at most
one head prints there at every moment. So a plan takes at least as long as all printing
in that window, whoever does it and however room is released.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.machine import Machine
from decmcts.team.space import relation_of

CELL_MM = 0.5  # windows begin at multiples of it
MOST_CELLS = 1000  # along an axis; cells grow beyond
MOST_SAMPLES = 4_000_000  # of all paths together
TOUCH_MM = 1e-3  # heads that only touch may pass
Floats = NDArray[np.float64]


def window_of(machine: Machine, height_mm: float) -> Floats:
    """Return the size along x and y of the largest window that only one head fits into, (2,).

    For prints of this height; 0 where there is none.
    """
    size = np.full(2, np.inf)
    for r in range(len(machine.heads)):
        for s in range(r + 1, len(machine.heads)):
            box = relation_of(machine, r, s)
            half = np.minimum(-box[:, 0::2], box[:, 1::2])
            half = half[(half[:, 2] >= height_mm) & (half[:, :2] > TOUCH_MM).all(axis=1), :2]
            if not len(half):
                return np.zeros(2)
            size = np.minimum(size, half[np.minimum(half, 1e4).prod(axis=1).argmax()])
    return np.maximum(size - TOUCH_MM, 0.0)


def window_bound(points: Floats, seconds: Floats, size: Floats) -> float:
    """Return the most seconds of printing in any window of a size.

    Parameters
    ----------
    points : (m, 3) mm, contour after contour
    seconds : (m,) of the segment that ends at each point, 0 at the first of a contour
    size : (2,) mm, along x and y
    """
    ends = np.flatnonzero(seconds > 0.0)
    ends = ends[ends > 0]
    if not len(ends) or not (size > 0.0).all():
        return 0.0
    first, last = points[ends - 1, :2], points[ends, :2]
    length = np.linalg.norm(last - first, axis=1)
    low = points[:, :2].min(axis=0)
    extent = np.ptp(points[:, :2], axis=0)
    cell = max(CELL_MM, float(extent.max()) / MOST_CELLS)
    step = max(cell / 4, float(length.sum()) / MOST_SAMPLES)
    wide = np.floor((np.minimum(size, extent + 2 * cell + step) - step) / cell).astype(np.int64)
    if (wide < 1).any():
        return 0.0
    parts = np.maximum(np.ceil(length / step), 1.0).astype(np.int64)
    owner = np.repeat(np.arange(len(ends)), parts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (place + 0.5) / parts[owner]
    middle = first[owner] + share[:, None] * (last - first)[owner]
    at = np.floor((middle - low) / cell).astype(np.int64)
    shape = np.floor(extent / cell).astype(np.int64) + 1
    work = np.zeros(shape + 1)
    np.add.at(work, tuple((at + 1).T), (seconds[ends] / parts)[owner])
    total = work.cumsum(axis=0).cumsum(axis=1)
    x, y = np.minimum(wide, shape)
    inside = total[x:, y:] - total[:-x, y:] - total[x:, :-y] + total[:-x, :-y]
    return float(inside.max())
