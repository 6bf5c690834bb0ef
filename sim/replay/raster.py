"""The printed material as it grows, on a grid: which beads a moving head may touch.

The broad and middle phase of the head-material check. It may name a bead that the head does not
touch, but never leaves one out. `sim.replay.material` then decides exactly.

The grid keeps for every cell the beads that reach into it, newest first, each
with the highest top among itself and all older ones, so that a walk down the
list ends as soon as nothing higher than the head's slice can follow. A coarser
grid of the highest tops answers most questions without looking at cells.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.arrays import Floats, Ints
from sim.replay.compiled import compiled
from sim.replay.gaps import come_nearer, margin_of

CELL_MM = 2.0  # side of a cell, unless that makes too many
MOST_CELLS = 1 << 22  # of a grid: a larger area has larger cells
COARSE = 8  # cells of the fine grid along one side of a coarse cell


def grid_over(low: Floats, high: Floats) -> tuple[Floats, Ints]:
    """Return corner and cell side (3,), and the cells along x and y, of a grid over an area."""
    span = np.maximum(high - low, 0.0)
    cell = CELL_MM
    while np.prod(np.ceil(span / cell) + 1) > MOST_CELLS:
        cell *= 2.0
    return np.array([*low, cell]), (np.ceil(span / cell) + 1).astype(np.int64)


@compiled
def bead_reaches(bead: Floats, x: float, y: float, half: float) -> bool:
    """Whether the rectangle of a bead may reach into the square cell at (x, y)."""
    ux, uy, long, wide = bead[2], bead[3], bead[4], bead[5]
    dx, dy = x - bead[0], y - bead[1]
    spread = half * (abs(ux) + abs(uy))
    if abs(dx * ux + dy * uy) > long + spread:
        return False
    return bool(abs(dy * ux - dx * uy) <= wide + spread)


@compiled
def bead_cells(bead: Floats, grid: Floats, shape: Ints) -> tuple[int, int, int, int]:
    """Return the range of cells under the bounding box of a bead."""
    ex = abs(bead[2]) * bead[4] + abs(bead[3]) * bead[5]
    ey = abs(bead[3]) * bead[4] + abs(bead[2]) * bead[5]
    i0 = max(0, int((bead[0] - ex - grid[0]) // grid[2]))
    i1 = min(shape[0] - 1, int((bead[0] + ex - grid[0]) // grid[2]))
    j0 = max(0, int((bead[1] - ey - grid[1]) // grid[2]))
    j1 = min(shape[1] - 1, int((bead[1] + ey - grid[1]) // grid[2]))
    return i0, i1, j0, j1


@compiled
def rows_at(bead: Floats, grid: Floats, x: float, j0: int, j1: int) -> tuple[int, int]:
    """Return the range of cells a bead may reach in the column of cells around x.

    So that a long slanting bead costs its length, not the area of its bounding box.
    """
    ux, uy, long, wide = bead[2], bead[3], bead[4], bead[5]
    if abs(ux) < 1e-6:
        return j0, j1
    half, middle = 0.5 * grid[2] + abs(uy) * wide, (x - bead[0]) / ux
    t0, t1 = max(-long, middle - half / abs(ux)), min(long, middle + half / abs(ux))
    low = bead[1] + min(t0 * uy, t1 * uy) - abs(ux) * wide - grid[1]
    high = bead[1] + max(t0 * uy, t1 * uy) + abs(ux) * wide - grid[1]
    return max(j0, int(low // grid[2]) - 1), min(j1, int(high // grid[2]) + 1)


@compiled
def count_entries(beads: Floats, grid: Floats, shape: Ints) -> int:
    """Return how many (bead, cell) entries all beads make together."""
    total = 0
    for b in range(len(beads)):
        i0, i1, j0, j1 = bead_cells(beads[b], grid, shape)
        for i in range(i0, i1 + 1):
            x = grid[0] + (i + 0.5) * grid[2]
            first, last = rows_at(beads[b], grid, x, j0, j1)
            for j in range(first, last + 1):
                y = grid[1] + (j + 0.5) * grid[2]
                total += bead_reaches(beads[b], x, y, 0.5 * grid[2])
    return total


@compiled
def insert_bead(
    b: int, bead: Floats, grid: Floats, shape: Ints, lists: Any, peaks: Any, used: int
) -> int:
    """Add bead `b` to the cells it reaches; mutates lists and peaks, returns entries used."""
    first, following, owner = lists
    cell_peak, entry_peak, coarse_peak = peaks
    i0, i1, j0, j1 = bead_cells(bead, grid, shape)
    top = bead[6]
    for i in range(i0, i1 + 1):
        x = grid[0] + (i + 0.5) * grid[2]
        j_first, j_last = rows_at(bead, grid, x, j0, j1)
        for j in range(j_first, j_last + 1):
            y = grid[1] + (j + 0.5) * grid[2]
            if not bead_reaches(bead, x, y, 0.5 * grid[2]):
                continue
            owner[used] = b
            following[used] = first[i, j]
            cell_peak[i, j] = max(cell_peak[i, j], top)
            entry_peak[used] = cell_peak[i, j]
            first[i, j] = used
            used += 1
            ci, cj = i // COARSE, j // COARSE
            coarse_peak[ci, cj] = max(coarse_peak[ci, cj], top)
    return used


@compiled
def sweep_planes(polygon: Floats, move: Floats, planes: Floats) -> int:
    """Write the half-planes n·x <= d of a polygon swept along a move; returns their number.

    The sum of a convex polygon and a segment has the edge normals of both.
    """
    k = len(polygon)
    count = 0
    dx, dy = move[3] - move[0], move[4] - move[1]
    for e in range(k + 2):
        if e < k:
            f = e + 1 if e + 1 < k else 0
            nx, ny = polygon[f, 1] - polygon[e, 1], polygon[e, 0] - polygon[f, 0]
        else:
            sign = 1.0 if e == k else -1.0
            nx, ny = sign * dy, -sign * dx
        length = np.sqrt(nx * nx + ny * ny)
        if length < 1e-12:
            continue
        nx, ny = nx / length, ny / length
        reach = -np.inf
        for v in range(k):
            reach = max(reach, nx * polygon[v, 0] + ny * polygon[v, 1])
        along = max(nx * move[0] + ny * move[1], nx * move[3] + ny * move[4])
        planes[count, 0], planes[count, 1], planes[count, 2] = nx, ny, reach + along
        count += 1
    return count


@compiled
def outside(planes: Floats, count: int, x: float, y: float, half: float, more: float) -> bool:
    """Whether the square of half side `half` at (x, y) is `more` beyond one of the half-planes."""
    for e in range(count):
        nx, ny = planes[e, 0], planes[e, 1]
        if nx * x + ny * y - half * (abs(nx) + abs(ny)) > planes[e, 2] + more:
            return True
    return False


@compiled
def sweep_meets(sweep: Any, bead: Floats, more: float) -> bool:
    """Whether no axis parts a swept polygon from the rectangle of a bead by over `more`, mm."""
    planes, count, polygon, move = sweep
    x, y, ux, uy, long, wide = bead[0], bead[1], bead[2], bead[3], bead[4], bead[5]
    for e in range(count):
        nx, ny = planes[e, 0], planes[e, 1]
        extent = abs(nx * ux + ny * uy) * long + abs(ny * ux - nx * uy) * wide
        if nx * x + ny * y - extent > planes[e, 2] + more:
            return False
    for axis in range(2):
        ax, ay, extent = (ux, uy, long) if axis == 0 else (-uy, ux, wide)
        low, high = np.inf, -np.inf
        for v in range(len(polygon)):
            s = ax * polygon[v, 0] + ay * polygon[v, 1]
            low, high = min(low, s), max(high, s)
        s0, s1 = ax * move[0] + ay * move[1], ax * move[3] + ay * move[4]
        centre = ax * x + ay * y
        reach = extent + more
        if low + min(s0, s1) > centre + reach or high + max(s0, s1) < centre - reach:
            return False
    return True


@compiled
def box_of(polygon: Floats, move: Floats, more: float) -> tuple[float, float, float, float]:
    """Return x and y range of a polygon swept along a move, `more` wider on every side."""
    x0, x1, y0, y1 = np.inf, -np.inf, np.inf, -np.inf
    for v in range(len(polygon)):
        x0, x1 = min(x0, polygon[v, 0]), max(x1, polygon[v, 0])
        y0, y1 = min(y0, polygon[v, 1]), max(y1, polygon[v, 1])
    return (
        x0 + min(move[0], move[3]) - more,
        x1 + max(move[0], move[3]) + more,
        y0 + min(move[1], move[4]) - more,
        y1 + max(move[1], move[4]) + more,
    )


@compiled
def lowest_asked(moves: Floats, upto: Ints, tops: Floats, least: float) -> Floats:
    """Return the height above which beads matter to a move or to any later one, (m,).

    It is infinite where none does: all that is there by then is below every part of the head.
    `least` is how high the lowest part begins above the tip; the rest is as in `scan`.
    """
    lowest = np.full(len(moves), np.inf)
    grown, highest = 0, -np.inf
    for m in range(len(moves)):
        while grown < upto[m]:
            highest = max(highest, tops[grown])
            grown += 1
        level = min(moves[m, 2], moves[m, 5]) + least
        if highest > level:
            lowest[m] = level
    for m in range(len(moves) - 2, -1, -1):
        lowest[m] = min(lowest[m], lowest[m + 1])
    return lowest


@compiled
def coarse_hit(
    box: tuple[float, float, float, float], level: float, grid: Floats, coarse_peak: Floats
) -> bool:
    """Whether any coarse cell under the box holds material above `level`."""
    size = grid[2] * COARSE
    i0, i1 = max(0, int((box[0] - grid[0]) // size)), int((box[1] - grid[0]) // size)
    j0, j1 = max(0, int((box[2] - grid[1]) // size)), int((box[3] - grid[1]) // size)
    for i in range(i0, min(i1 + 1, coarse_peak.shape[0])):
        for j in range(j0, min(j1 + 1, coarse_peak.shape[1])):
            if coarse_peak[i, j] > level:
                return True
    return False


@compiled
def walk_cell(
    entry: int, level: float, sweep: Any, beads: Floats, lists: Any, entry_peak: Floats,
    stamp: Any, found: Any, tag: Any, near: Any,
) -> int:  # fmt: skip
    """Collect the beads of one cell's list that the sweep meets; mutates stamp, found and near."""
    query, part, mark, n = tag
    while entry >= 0 and entry_peak[entry] > level:
        b = lists[2][entry]
        if beads[b, 6] > level and stamp[b] != mark:
            stamp[b] = mark
            more = margin_of(near, query)
            if sweep_meets(sweep, beads[b], more):
                if more == 0.0 or sweep_meets(sweep, beads[b], 0.0):
                    if n < len(found):
                        found[n, 0], found[n, 1], found[n, 2] = query, b, part
                    n += 1
                if more > 0.0:
                    come_nearer(near, query, b, part, sweep[3])
        entry = lists[1][entry]
    return int(n)


@compiled
def search_cells(
    box: tuple[float, float, float, float], level: float, sweep: Any, beads: Floats, grid: Floats,
    shape: Ints, lists: Any, peaks: Any, stamp: Any, found: Any, tag: Any, near: Any,
) -> int:  # fmt: skip
    """Collect the beads above `level` that one sweep meets; returns the new number found."""
    half = 0.5 * grid[2]
    query, part, mark, n = tag
    i0, i1 = int((box[0] - grid[0]) // grid[2]), int((box[1] - grid[0]) // grid[2])
    j0, j1 = int((box[2] - grid[1]) // grid[2]), int((box[3] - grid[1]) // grid[2])
    for i in range(max(0, i0), min(i1, shape[0] - 1) + 1):
        for j in range(max(0, j0), min(j1, shape[1] - 1) + 1):
            if peaks[0][i, j] <= level:
                continue
            x, y = grid[0] + (i + 0.5) * grid[2], grid[1] + (j + 0.5) * grid[2]
            if outside(sweep[0], sweep[1], x, y, half, margin_of(near, query)):
                continue
            n = walk_cell(
                lists[0][i, j], level, sweep, beads, lists, peaks[1], stamp, found,
                (query, part, mark, n), near,
            )  # fmt: skip
    return int(n)


@compiled
def scan(
    moves: Floats, upto: Ints, beads: Floats, parts: Any, grid: Floats, shape: Ints,
    entries: int, found: Any, near: Any,
) -> int:  # fmt: skip
    """Grow the material move by move and collect what each move may touch; mutates near.

    Writes rows (move, bead, part) into `found` and returns how many there are; it
    stops at the first move for which there is no more room, and returns more than that.

    Parameters
    ----------
    moves : (m, 6) start and end of each move
    upto : (m,) beads[:upto[i]] may be there during move i; non-decreasing
    beads : (n, 7) centre x, y, unit direction x, y, half length, half width, top
    parts : (heights (k,), offsets (k + 1,), xy (p, 2)) convex polygons of the head
    grid : (3,) corner of the grid and side of a cell
    shape : (2,) cells along x and y
    entries : number of (bead, cell) entries, from `count_entries`
    near : how near a bead comes that no move touches (`sim.replay.gaps`)
    """
    heights, offsets, xy = parts
    nx, ny = shape[0], shape[1]
    first = np.full((nx, ny), -1, np.int64)
    lists = (first, np.empty(entries, np.int32), np.empty(entries, np.int32))
    coarse = np.full(((nx + COARSE - 1) // COARSE, (ny + COARSE - 1) // COARSE), -np.inf)
    peaks = (np.full((nx, ny), -np.inf), np.empty(entries, np.float64), coarse)
    stamp = np.full(len(beads), -1, np.int64)
    planes = np.empty((len(xy) + 2, 3))
    used, grown, n, highest = 0, 0, 0, -np.inf
    for m in range(len(moves)):
        if n > len(found):
            break
        while grown < upto[m]:
            used = insert_bead(grown, beads[grown], grid, shape, lists, peaks, used)
            highest = max(highest, beads[grown, 6])
            grown += 1
        for k in range(len(heights)):
            level = min(moves[m, 2], moves[m, 5]) + heights[k]
            if highest <= level:
                continue
            polygon = xy[offsets[k] : offsets[k + 1]]
            box = box_of(polygon, moves[m], margin_of(near, m))
            if not coarse_hit(box, level, grid, coarse):
                continue
            count = sweep_planes(polygon, moves[m], planes)
            sweep = (planes, count, polygon, moves[m])
            tag = (m, k, m * len(heights) + k, n)
            n = search_cells(
                box, level, sweep, beads, grid, shape, lists, peaks, stamp, found, tag, near
            )
    return n
