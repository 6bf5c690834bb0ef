"""Distances of convex polygons on the plane, compiled."""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.controllers.compiled import compiled


@compiled
def parted(
    a: Floats, first: int, last: int, b: Floats, begin: int, end: int, dx: float, dy: float
) -> bool:
    """Tell whether an edge of the first convex polygon has all of the second outside it.

    The second is moved by (dx, dy).
    """
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        ex, ey = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
        outside = True
        for k in range(begin, end):
            if ex * (b[k, 1] + dy - a[i, 1]) - ey * (b[k, 0] + dx - a[i, 0]) >= 0.0:
                outside = False
                break
        if outside:
            return True
    return False


@compiled
def to_edge(c: Floats, begin: int, end: int, j: int, x: float, y: float) -> float:
    """Return the distance of a point to the edge that begins at corner j."""
    n = j + 1 if j + 1 < end else begin
    ex, ey = c[n, 0] - c[j, 0], c[n, 1] - c[j, 1]
    length = ex * ex + ey * ey
    share = 0.0
    if length > 0.0:
        share = min(1.0, max(0.0, ((x - c[j, 0]) * ex + (y - c[j, 1]) * ey) / length))
    return float(np.hypot(x - c[j, 0] - share * ex, y - c[j, 1] - share * ey))


@compiled
def polygon_gap(
    a: Floats, first: int, last: int, b: Floats, begin: int, end: int, dx: float, dy: float
) -> float:
    """Return the distance of two convex polygons, the second moved; 0: they overlap.

    The second may be a segment, two corners, or a point twice.
    """
    if not (
        parted(a, first, last, b, begin, end, dx, dy)
        or parted(b, begin, end, a, first, last, -dx, -dy)
    ):
        return 0.0
    least = np.inf
    for i in range(first, last):
        for j in range(begin, end):
            x, y = a[i, 0] - dx, a[i, 1] - dy
            least = min(least, to_edge(b, begin, end, j, x, y))
            x, y = b[j, 0] + dx, b[j, 1] + dy
            least = min(least, to_edge(a, first, last, i, x, y))
    return least
