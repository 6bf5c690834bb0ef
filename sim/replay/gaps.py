"""How far apart convex polygons are, and how near a head comes to beads beside it: compiled.

A bead segment fills, at each point of its centreline, the disc of half its width from its height
below the nozzle's way up to it; so its ends are round. With a bead point q(s) and a nozzle point
p(t), 0 <= s, t <= 1, a part of a head is beside the bead where q - p is above the part's underside
(and the bead's underside below the part's top). Both are linear in (s, t), so what is left of the
parallelogram of all q - p is a convex polygon. Its distance to the part's polygon, less half the
bead's width, is the gap.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.arrays import Floats
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


@compiled
def margin_of(near: Any, move: int) -> float:
    """Return how far beyond a bead's rectangle a nearer gap than the least may be, mm."""
    best, who, limits = near[0], near[1], near[2]
    if move < who[3] or move >= who[4]:
        return 0.0
    return max(0.0, float(best[0] - limits[0]))


@compiled
def clip(corners: Floats, n: int, level: float, side: float, kept: Floats) -> int:
    """Write what of a convex polygon in space is not beyond a level; returns its corners.

    Beyond is below with side 1, above with side -1.
    """
    m = 0
    for v in range(n):
        w = v + 1 if v + 1 < n else 0
        a, b = side * (corners[v, 2] - level), side * (corners[w, 2] - level)
        if a >= 0.0:
            for d in range(3):
                kept[m, d] = corners[v, d]
            m += 1
        if a * b < 0.0:
            share = a / (a - b)
            for d in range(3):
                kept[m, d] = corners[v, d] + share * (corners[w, d] - corners[v, d])
            m += 1
    return m


def room() -> tuple[Floats, Floats, Floats]:
    """Return arrays for `bead_gap` to compute in."""
    return np.empty((4, 3)), np.empty((6, 3)), np.empty((8, 3))


@compiled
def bead_gap(
    move: Floats, start: Floats, end: Floats, span: Any, polygon: Floats, room: Any
) -> float:
    """Return the distance of a moved part to a bead's centreline where it is beside it, mm.

    Infinite where it is nowhere. `span` has the heights above the nozzle between which q - p
    counts; `room` is mutated.
    """
    corners, above, left = room
    for d in range(3):
        p, p_end, q, q_end = move[d], move[d + 3], start[d], end[d]
        corners[0, d], corners[1, d] = q - p, q_end - p
        corners[2, d], corners[3, d] = q_end - p_end, q - p_end
    n = clip(corners, 4, span[0], 1.0, above)
    m = clip(above, n, span[1], -1.0, left)
    if m == 0:
        return float(np.inf)
    return polygon_gap(left, m, polygon, len(polygon))


@compiled
def meets(
    move: Floats, start: Floats, end: Floats, span: Any, polygon: Floats, reach: float, room: Any
) -> bool:
    """Whether a moved part comes nearer than `reach` to a bead's centreline where it is beside it.

    Touching heights are not beside one another.
    """
    highest, lowest = -np.inf, np.inf
    for q in (start[2], end[2]):
        for p in (move[2], move[5]):
            highest, lowest = max(highest, q - p), min(lowest, q - p)
    if highest <= span[0] or lowest >= span[1]:
        return False
    return bool(bead_gap(move, start, end, span, polygon, room) < reach)


@compiled
def is_exempt(exempt: Any, move: int, label: int) -> bool:
    """Whether the nozzle of a move, and a bead, are of two contours that touch in the source."""
    keys, whose, n = exempt
    if len(keys) == 0:
        return False
    for c in range(3):
        if whose[move, c] >= 0 and label >= 0:
            key = whose[move, c] * n + label
            at = np.searchsorted(keys, key)
            if at < len(keys) and keys[at] == key:
                return True
    return False


@compiled
def come_nearer(near: Any, move: int, b: int, part: int, path: Floats) -> None:
    """Look at one bead beside one part on one move; mutates the least gap where it is nearer.

    What comes nearer than the clearance is a contact, which others judge.

    Parameters
    ----------
    near : tuple
        best (1,): the least gap, mm. who (5,): its move, bead and part, and the first move that
        counts and one past the last. limits (2,): by how much the rectangles of beads are larger
        than the beads, and the tolerance. beads: start (n, 3), end (n, 3), width, height, label
        (n,), and the row of each candidate. parts: spans (k, 2), clearances (k,), offsets (k + 1,)
        and corners of their polygons. exempt: keys of pairs of contours that touch in the
        source, ascending, whose each move is (m, 3), and what the first of a pair is multiplied by
        in a key. room: arrays to compute in.
    """
    best, who, limits, beads, parts, exempt, room = near
    start, end, width, height, label, rows = beads
    spans, clearances, offsets, xy = parts
    row = rows[b]
    span = (spans[part, 0], spans[part, 1] + height[row])
    polygon = xy[offsets[part] : offsets[part + 1]]
    gap = bead_gap(path, start[row], end[row], span, polygon, room) - 0.5 * width[row]
    if gap >= best[0] or gap < clearances[part] - limits[1]:
        return
    if not is_exempt(exempt, move, label[row]):
        best[0], who[0], who[1], who[2] = gap, move, row, part
