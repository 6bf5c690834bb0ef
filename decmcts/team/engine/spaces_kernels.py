"""Space that heads reserve and when two heads are too near, on bare arrays.

A `Space` is the reserved space, the box a head's nozzle stays within while it does something:
`(min x, max x, min y, max y, min z, max z)`. Two heads are too near when the
difference of their nozzles lies in one of a few boxes, the *relations* of the
pair: one for every two bodies that could meet, and a half-space for a rail.
`decmcts.team.engine.space` derives them so that "clear" here is never optimistic.

**Pieces** are what is left of a contour's space as its print goes on. From a vertex on, a print
needs only the space of the vertices still to come. Where that shrinks by a good deal another head
can be let in: such a vertex begins a *piece*. A piece's space holds all later ones, so spaces of a
print only shrink.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.print.motion_kernels import trapezoid_time


class Pieces(NamedTuple):
    """Pieces of every contour, along it and then the other way."""

    offsets: Ints  # (2 n + 1,) contour c along is row 2 c, back row 2 c + 1
    space: Floats  # (k, 6)
    share: Floats  # (k,) share of the contour's length that lies before
    point: Int32s  # (k,) vertex of the path it begins at


@kernel
def spaces_left(points: Floats, is_reversed: bool, space: Floats) -> Floats:
    """Write to `space` (m, 6) what is left from each vertex on; returns the length before it."""
    m = len(points)
    before = np.zeros(m)
    for i in range(m - 1, -1, -1):
        p = points[m - 1 - i] if is_reversed else points[i]
        for axis in range(3):
            low, high = p[axis], p[axis]
            if i < m - 1:
                low = min(low, space[i + 1, 2 * axis])
                high = max(high, space[i + 1, 2 * axis + 1])
            space[i, 2 * axis], space[i, 2 * axis + 1] = low, high
    for i in range(1, m):
        p = points[m - 1 - i] if is_reversed else points[i]
        q = points[m - i] if is_reversed else points[i - 1]
        before[i] = before[i - 1] + np.sqrt(np.sum((p - q) ** 2))
    return before


@kernel
def cut(space: Floats, step: float, most: int, chosen: Int32s) -> int:
    """Write to `chosen` the vertices where pieces begin; returns how many."""
    chosen[0], count = 0, 1
    for i in range(1, len(space) - 1):
        if count >= most:
            break
        held, left = space[chosen[count - 1]], space[i]
        shrinks = max(left[0] - held[0], held[1] - left[1], left[2] - held[2], held[3] - left[3])
        if shrinks >= step:
            chosen[count] = i
            count += 1
    return count


@kernel
def cut_pieces(points: Floats, offsets: Ints, reversible: Flags, step: float, most: int) -> Pieces:
    """Cut every contour, both ways where it may be printed back, at most into `most` pieces.

    A piece begins where the space has shrunk by `step` mm along x or y; `most` 1: none does.
    """
    n = len(offsets) - 1
    first = np.zeros(2 * n + 1, np.int64)
    space, share = np.empty((2 * n + 16, 6)), np.empty(2 * n + 16)
    point = np.empty(2 * n + 16, np.int32)
    chosen = np.empty(most, np.int32)
    used = 0
    for row in range(2 * n):
        c, back = row // 2, row % 2 == 1
        if reversible[c] or not back:
            path = points[offsets[c] : offsets[c + 1]]
            left = np.empty((len(path), 6))
            before = spaces_left(path, back, left)
            count = cut(left, step, most, chosen)
            while used + count > len(share):
                space, share = np.concatenate((space, space)), np.concatenate((share, share))
                point = np.concatenate((point, point))
            for k in range(count):
                i = chosen[k]
                space[used], point[used] = left[i], i
                share[used] = before[i] / before[-1] if before[-1] > 0.0 else 0.0
                used += 1
        first[row + 1] = used
    return Pieces(first, space[:used].copy(), share[:used].copy(), point[:used].copy())


Space = tuple[float, float, float, float, float, float]
Point = tuple[float, float, float] | Floats  # x, y, z

TOUCH = 1e-9  # mm; reserved spaces exactly as far apart as they must be are clear


class Fleet(NamedTuple):
    """The heads of a machine as the kernels see them."""

    relation: Floats  # (k, 6) boxes of nozzle of s minus nozzle of r, mm
    relation_offsets: Ints  # (heads * heads + 1,) pair (r, s) is row r * heads + s
    parks: Floats  # (heads, 3) where they begin and end
    low: Floats  # (heads, 2) least x and y a head may step aside to
    high: Floats  # (heads, 2)
    travel: Floats  # (heads, 6) see `travel_seconds`
    ceiling: float  # no travel rises higher, mm
    rest_s: float  # what a head loses where it waits for another, `decmcts.print.machine`
    lined: bool  # all heads on one rail: whatever the order, each can return to its park


@inlined
def space_at(spaces: Floats, k: int) -> Space:
    """Return row k of `spaces` (m, 6)."""
    return spaces[k, 0], spaces[k, 1], spaces[k, 2], spaces[k, 3], spaces[k, 4], spaces[k, 5]


@inlined
def keep_space(space: Space, spaces: Floats, k: int) -> None:
    """Write a space to row k of `spaces` (m, 6)."""
    for side in range(6):
        spaces[k, side] = space[side]


@inlined
def too_near(a: Space, b: Space, r: int, s: int, fleet: Fleet) -> bool:
    """Whether head r somewhere in space `a` and head s somewhere in space `b` could meet."""
    relation, pair = fleet.relation, r * len(fleet.parks) + s
    for k in range(fleet.relation_offsets[pair], fleet.relation_offsets[pair + 1]):
        if (
            b[0] - a[1] < relation[k, 1] - TOUCH
            and b[1] - a[0] > relation[k, 0] + TOUCH
            and b[2] - a[3] < relation[k, 3] - TOUCH
            and b[3] - a[2] > relation[k, 2] + TOUCH
            and b[4] - a[5] < relation[k, 5] - TOUCH
            and b[5] - a[4] > relation[k, 4] + TOUCH
        ):
            return True
    return False


@inlined
def space_of_point(point: Point, top: float) -> Space:
    """Space reserved by a head that rests at a point, at most at height `top`."""
    return point[0], point[0], point[1], point[1], point[2], max(point[2], top)


@inlined
def space_of_travel(p: Point, q: Point, ceiling: float) -> Space:
    """Space reserved by a travel from p to q."""
    return (
        min(p[0], q[0]),
        max(p[0], q[0]),
        min(p[1], q[1]),
        max(p[1], q[1]),
        min(p[2], q[2]),
        max(p[2], q[2], ceiling),
    )


@inlined
def join_spaces(a: Space, b: Space) -> Space:
    """Smallest space that holds two."""
    return (
        min(a[0], b[0]),
        max(a[1], b[1]),
        min(a[2], b[2]),
        max(a[3], b[3]),
        min(a[4], b[4]),
        max(a[5], b[5]),
    )


@kernel
def travel_seconds(p: Point, q: Point, travel: Floats) -> float:
    """Estimate of a travel from p to q: level move, height difference, retraction.

    `travel` is feed, acceleration, z feed, z acceleration, seconds of a retraction, and
    the length from which on there is one.
    """
    flat = np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2)
    rise = abs(q[2] - p[2])
    seconds = 0.0
    if flat > 0.0:
        seconds += trapezoid_time(flat, 0.0, 0.0, travel[0], travel[1])
    if rise > 0.0:
        seconds += trapezoid_time(rise, 0.0, 0.0, travel[2], travel[3])
    if flat >= travel[5]:
        seconds += travel[4]
    return seconds
