"""How near a head comes, on its side, to beads that stand higher than what of it is beside them.

Kernels for `sim.replay.raster`, which asks about every bead that may be near enough. With a bead
point q and a nozzle point p a part is beside the bead where q - p is above the part's underside
(and the bead's underside below the part's top), as in `sim.replay.overlap`. What is left of the
parallelogram of all q - p is a convex polygon. Its distance to the part's polygon, less half
the bead's width, is the gap.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.replay.compiled import compiled
from sim.replay.gaps import polygon_gap


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
