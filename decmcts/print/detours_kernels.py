"""Ways round outer walls: along the loops a straight travel crosses, then pulled taut.

Where a travel crosses a loop twice or more it follows the loop, a little beside it, from the
first crossing to the last, the shorter way round (Lumelsky & Stepanov 1987, "Bug2"; slicers do
it alike). A loop crossed once lies around one end only: it is crossed upright, by a leg as short
as can be. What results is pulled taut and the cheapest of its shortcuts taken, walls that are
crossed priced by the length of the legs that cross them. So a way is never dearer than the
straight one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.compiled import kernel
from decmcts.print.walls_kernels import (
    END_MM,
    HEAD,
    PER_LAYER,
    Walls,
    crosses,
    is_inside,
    layer_at,
    over_either,
)

BESIDE_MM = 0.3  # between a loop's centreline and a way along it
GRAZE_MM = 0.02  # a way round keeps so far from walls, but near its corners
GRAZE_END_MM = 0.5
ROUNDS = 3  # a way along one loop may cross others
MOST_BENDS = 48  # of a way pulled taut, among which shortcuts are sought


class Loops(NamedTuple):
    """Outer walls as closed loops, by the layers of `Walls`."""

    points: Floats  # (p, 2) mm
    inner: Floats  # (p, 2) unit normals into the part, longer at corners
    along: Floats  # (p,) mm along its loop
    offsets: Ints  # (n + 1,)
    length: Floats  # (n,) mm
    boxes: Floats  # (n, 4) x0, y0, x1, y1
    first: Ints  # (layers + 1,) loops of layer l: first[l]..first[l + 1]


@kernel
def meets(
    ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float
) -> float:
    """Return where on a..b, 0 to 1, it meets p..q; -1 where it does not."""
    dx, dy, ex, ey = bx - ax, by - ay, qx - px, qy - py
    area = dx * ey - dy * ex
    if area == 0.0:
        return -1.0
    t = ((px - ax) * ey - (py - ay) * ex) / area
    s = ((px - ax) * dy - (py - ay) * dx) / area
    if -1e-9 <= t <= 1.0 + 1e-9 and -1e-9 <= s <= 1.0 + 1e-9:
        return min(max(t, 0.0), 1.0)
    return -1.0


@kernel
def first_and_last(loops: Loops, n: int, a: Floats, b: Floats, found: Floats) -> None:
    """Write to `found` where a..b first and last meets loop n: t and edge, twice; t 2 for never."""
    found[0], found[2] = 2.0, -1.0
    box = loops.boxes[n]
    if (
        max(a[0], b[0]) < box[0] or min(a[0], b[0]) > box[2]
        or max(a[1], b[1]) < box[1] or min(a[1], b[1]) > box[3]
    ):  # fmt: skip
        return
    first, end = loops.offsets[n], loops.offsets[n + 1]
    px, py = loops.points[end - 1, 0], loops.points[end - 1, 1]
    edge = end - 1
    for v in range(first, end):
        qx, qy = loops.points[v, 0], loops.points[v, 1]
        t = meets(a[0], a[1], b[0], b[1], px, py, qx, qy)
        if t >= 0.0 and t < found[0]:
            found[0], found[1] = t, edge
        if t >= 0.0 and t > found[2]:
            found[2], found[3] = t, edge
        px, py, edge = qx, qy, v


@kernel
def next_loop(loops: Loops, layer: int, a: Floats, b: Floats, t: float, best: Floats) -> int:
    """Return the loop that a..b meets first beyond t, -1 for none.

    `best` becomes where it is met, as `first_and_last` says it. A loop met but once, at an end
    of a..b, is not crossed.
    """
    nearest, found = -1, np.empty(4)
    end = END_MM / math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    best[0] = 2.0
    for n in range(loops.first[layer], loops.first[layer + 1]):
        first_and_last(loops, n, a, b, found)
        if not t + 1e-9 < found[0] < best[0]:
            continue
        if found[2] > found[0] + 1e-6 or end < found[0] < 1.0 - end:
            best[:] = found
            nearest = n
    return nearest


@kernel
def cross_upright(
    loops: Loops, a: Floats, b: Floats, t: float, edge: int, n: int, way: Floats, size: int,
) -> int:  # fmt: skip
    """Add a point on either side of an edge of loop n where a..b crosses it at t; the new size."""
    if size >= len(way) - 3:
        return size
    v = edge + 1 if edge + 1 < loops.offsets[n + 1] else loops.offsets[n]
    ex, ey = loops.points[v, 0] - loops.points[edge, 0], loops.points[v, 1] - loops.points[edge, 1]
    length = math.sqrt(ex * ex + ey * ey)
    if length <= 0.0:
        return size
    x, y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
    beside = BESIDE_MM / length
    if (b[0] - a[0]) * -ey + (b[1] - a[1]) * ex < 0.0:
        beside = -beside
    way[size, 0], way[size, 1] = x + beside * ey, y - beside * ex
    way[size + 1, 0], way[size + 1, 1] = x - beside * ey, y + beside * ex
    return size + 2


@kernel
def side_of(walls: Walls, k: int, a: Floats, b: Floats, met: Floats) -> float:
    """Return the side a loop is followed on: 1 inside the part, -1 outside of it."""
    length = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    before, behind = met[0] - 0.05 / length, met[2] + 0.05 / length
    if before <= 0.0 or behind >= 1.0:
        return 1.0
    for t in (before, behind):
        if is_inside(walls, k, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])):
            return 1.0
    return -1.0


@kernel
def place(loops: Loops, edge: int, a: Floats, b: Floats, t: float) -> float:
    """Return how far along its loop the point at t of a..b lies, on this edge."""
    x, y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
    dx, dy = x - loops.points[edge, 0], y - loops.points[edge, 1]
    return float(loops.along[edge]) + math.sqrt(dx * dx + dy * dy)


@kernel
def follow(
    loops: Loops, n: int, a: Floats, b: Floats, met: Floats, side: float, way: Floats, size: int,
) -> int:  # fmt: skip
    """Add the way beside loop n from where a..b first meets it to where it last does.

    The shorter way round; returns the new size.
    """
    first, end = loops.offsets[n], loops.offsets[n + 1]
    one, two = int(met[1]), int(met[3])
    forward = place(loops, two, a, b, met[2]) - place(loops, one, a, b, met[0])
    forward += loops.length[n] if forward < 0.0 else 0.0
    ahead = forward <= 0.5 * loops.length[n]
    v = one + 1 if ahead else one
    last = two if ahead else two + 1
    last = first if last >= end else last
    for _ in range(end - first):
        v = first if v >= end else v
        v = end - 1 if v < first else v
        if size >= len(way) - 2:
            break
        way[size, 0] = loops.points[v, 0] + side * BESIDE_MM * loops.inner[v, 0]
        way[size, 1] = loops.points[v, 1] + side * BESIDE_MM * loops.inner[v, 1]
        size += 1
        if v == last:
            break
        v += 1 if ahead else -1
    return size


@kernel
def round_loops(walls: Walls, loops: Loops, k: int, old: Floats, size: int, way: Floats) -> int:
    """Write to `way` the way `old` with its crossings of the layer at k gone round."""
    layer = (k - HEAD) // PER_LAYER
    way[0] = old[0]
    now = 1
    met = np.empty(4)
    for i in range(size - 1):
        a, b = old[i], old[i + 1]
        if crosses(walls, k, a[0], a[1], b[0], b[1]):
            t = -1.0
            while True:
                n = next_loop(loops, layer, a, b, t, met)
                if n < 0:
                    break
                if met[2] > met[0] + 1e-6:
                    side = side_of(walls, k, a, b, met)
                    now = follow(loops, n, a, b, met, side, way, now)
                else:
                    now = cross_upright(loops, a, b, met[0], int(met[1]), n, way, now)
                t = met[2]
        if now < len(way) - 1:
            way[now] = b
            now += 1
    way[now - 1] = old[size - 1]
    return now


@kernel
def leg_over(walls: Walls, ka: int, kb: int, way: Floats, i: int, j: int) -> bool:
    """Tell whether the straight leg from point i of a way to point j crosses a wall, or grazes one.

    Files round points, so a leg that merely touches no wall may cross it where it is written.
    """
    ax, ay, bx, by = way[i, 0], way[i, 1], way[j, 0], way[j, 1]
    if over_either(walls, ka, kb, ax, ay, bx, by):
        return True
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length <= 2.0 * GRAZE_END_MM:
        return False
    ux, uy = (bx - ax) / length, (by - ay) / length
    ax, ay = ax + GRAZE_END_MM * ux, ay + GRAZE_END_MM * uy
    bx, by = bx - GRAZE_END_MM * ux, by - GRAZE_END_MM * uy
    for side in (-GRAZE_MM, GRAZE_MM):
        x, y = -side * uy, side * ux
        if over_either(walls, ka, kb, ax + x, ay + y, bx + x, by + y):
            return True
    return False


@kernel
def pull_taut(walls: Walls, ka: int, kb: int, way: Floats, size: int) -> int:
    """Leave out points of a way that need not be there, in place; returns the new size."""
    kept, i = 1, 0
    while i < size - 1 and kept < MOST_BENDS - 1:
        good, step = i + 1, 2
        while i + step < size and not leg_over(walls, ka, kb, way, i, i + step):
            good, step = i + step, 2 * step
        bad = min(i + step, size)
        while bad - good > 1:
            middle = (good + bad) // 2
            if leg_over(walls, ka, kb, way, i, middle):
                bad = middle
            else:
                good = middle
        i = good
        way[kept] = way[good]
        kept += 1
    way[kept - 1] = way[size - 1]
    return kept


@kernel
def cheapest(walls: Walls, ka: int, kb: int, price: float, way: Floats, size: int) -> int:
    """Keep the points of the cheapest way through some of them, in place; returns the new size."""
    cost, before = np.full(size, np.inf), np.zeros(size, np.int64)
    cost[0] = 0.0
    for j in range(1, size):
        for i in range(j):
            length = math.sqrt((way[j, 0] - way[i, 0]) ** 2 + (way[j, 1] - way[i, 1]) ** 2)
            if cost[i] + length >= cost[j]:
                continue
            if leg_over(walls, ka, kb, way, i, j):
                length *= 1.0 + price
            if cost[i] + length < cost[j]:
                cost[j], before[j] = cost[i] + length, i
    kept = np.zeros(size, np.bool_)
    j = size - 1
    while j > 0:
        kept[j] = True
        j = before[j]
    now = 1
    for j in range(1, size):
        if kept[j]:
            way[now] = way[j]
            now += 1
    return now


@kernel
def route(
    walls: Walls, loops: Loops, price: float, a: Floats, b: Floats, way: Floats, spare: Floats,
) -> int:  # fmt: skip
    """Write the way from a to b, (3,) each, to `way`; returns how many points it has.

    It keeps off the walls of the layers of both ends, as far as that pays.
    """
    ka, kb = layer_at(walls, a[2]), layer_at(walls, b[2])
    way[0], way[1] = a[:2], b[:2]
    size = 2
    for _ in range(ROUNDS):
        for k in (ka, kb):
            if k >= 0:
                size = round_loops(walls, loops, k, way, size, spare)
                way[:size] = spare[:size]
        size = pull_taut(walls, ka, kb, way, size)
    return cheapest(walls, ka, kb, price, way, size)


@kernel
def detours(
    walls: Walls, loops: Loops, price: float, starts: Floats,
    goals: Floats, counts: Ints, longest: int,
) -> Floats:  # fmt: skip
    """Return the bends of the travels from starts to goals, (m, 3) each, one after the other.

    `counts` (m,) becomes how many each has: 0 where it goes straight. A mm over walls is
    worth `price` mm of travel beyond its own.
    """
    way, spare = np.empty((longest, 2)), np.empty((longest, 2))
    bends = np.empty((4 * len(starts) + MOST_BENDS, 2))
    used = 0
    for m in range(len(starts)):
        a, b = starts[m], goals[m]
        counts[m] = 0
        ka, kb = layer_at(walls, a[2]), layer_at(walls, b[2])
        if not over_either(walls, ka, kb, a[0], a[1], b[0], b[1]):
            continue
        counts[m] = route(walls, loops, price, a, b, way, spare) - 2
        if used + counts[m] > len(bends):
            grown = np.empty((2 * len(bends) + MOST_BENDS, 2))
            grown[:used] = bends[:used]
            bends = grown
        bends[used : used + counts[m]] = way[1 : 1 + counts[m]]
        used += counts[m]
    return bends[:used].copy()
