"""How far apart convex polygons in the plane are: exact, compiled, for least clearances.

Nothing here knows of heads or beads.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.replay.compiled import compiled


@compiled
def point_gap2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the squared distance of a point p to the segment from a to b."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / square))
    ex, ey = px - ax - share * dx, py - ay - share * dy
    return ex * ex + ey * ey


@compiled
def inside(x: float, y: float, polygon: Floats, n: int) -> bool:
    """Whether a point lies within a convex polygon of n corners, run either way round."""
    left, right = False, False
    for v in range(n):
        w = v + 1 if v + 1 < n else 0
        dx, dy = polygon[w, 0] - polygon[v, 0], polygon[w, 1] - polygon[v, 1]
        turn = dx * (y - polygon[v, 1]) - dy * (x - polygon[v, 0])
        left, right = left or turn > 0.0, right or turn < 0.0
    return left != right


@compiled
def crosses(a: Floats, i: int, j: int, b: Floats, v: int, w: int) -> bool:
    """Whether the edge from a[i] to a[j] properly crosses that from b[v] to b[w]."""
    ax, ay, cx, cy = a[i, 0], a[i, 1], b[v, 0], b[v, 1]
    dx, dy, ex, ey = a[j, 0] - ax, a[j, 1] - ay, b[w, 0] - cx, b[w, 1] - cy
    one = (dx * (cy - ay) - dy * (cx - ax)) * (dx * (cy + ey - ay) - dy * (cx + ex - ax))
    two = (ex * (ay - cy) - ey * (ax - cx)) * (ex * (ay + dy - cy) - ey * (ax + dx - cx))
    return bool(one < 0.0 and two < 0.0)


@compiled
def polygon_gap(a: Floats, n: int, b: Floats, m: int) -> float:
    """Return the distance of two convex polygons, 0 where they meet.

    Of each the first n, or m, corners count; one without area is a segment, or a point.
    """
    if inside(a[0, 0], a[0, 1], b, m) or inside(b[0, 0], b[0, 1], a, n):
        return 0.0
    least = np.inf
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        for v in range(m):
            w = v + 1 if v + 1 < m else 0
            if crosses(a, i, j, b, v, w):
                return 0.0
            of_a = point_gap2(a[i, 0], a[i, 1], b[v, 0], b[v, 1], b[w, 0], b[w, 1])
            of_b = point_gap2(b[v, 0], b[v, 1], a[i, 0], a[i, 1], a[j, 0], a[j, 1])
            least = min(least, of_a, of_b)
    return float(np.sqrt(least))
