"""The look for contacts with the print, compiled: moves in order, each against what stands then.

Each cell of a grid keeps its highest point of a bead. Squares of 2, 4, 8 … cells a side keep the
highest of all their cells. Where one holds nothing as high as a part of the head, nothing within it
is looked at, so the time is near linear in the moves. The swept part is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from sim.controllers.compiled import compiled
from sim.controllers.nearness import polygon_gap

CELL_MM = 0.25
MOST_CELLS = 1 << 22  # of larger prints cells are larger
NOTHING = -1  # no move: a cell where nothing is printed
GRAZE_MM = 0.01  # less is rounding
LOOKS = 40  # steps in which the begin of a contact is found
SQUARES = 256  # squares of the grid that are still to be looked at: far more than there can be
COLUMNS = 13  # of a contact


class Heights(NamedTuple):
    """The print as it stands at some time."""

    corner: Floats  # (2,) least x and y
    cell_mm: float
    first: Ints  # (levels,) where the squares of each level begin in `top`; level 0: cells
    columns: Ints  # (levels,)
    rows: Ints  # (levels,)
    top: Floats  # (n,) mm, of each square; -inf: nothing is printed there
    spot: Floats  # (cells, 2) where the highest point of each cell lies
    move: Ints  # (cells,) and which move laid it


class Moves(NamedTuple):
    """The moves of all heads, one head after the other, and at last what stood there before."""

    points: Floats  # (p, 3)
    row: Ints  # (m,) of the point at which each begins
    head: Ints  # (m,) -1: of none
    begin: Floats  # (m,)
    end: Floats  # (m,)
    lays: Flags  # (m,)
    looked_at: Flags  # (m,)
    number: Ints  # (m,) as `MoveBeads`
    layer: Ints  # (m,)
    height: Floats  # (m,)
    half: Floats  # (m,)
    widest: float  # of these


class Prisms(NamedTuple):
    """The prisms of all heads."""

    first: Ints  # (heads + 1,) parts of each head
    offsets: Ints  # (k + 1,) corners of each part
    corners: Floats  # (n, 2)
    low: Floats  # (k,) above the tip
    reach: Floats  # (k,) mm kept from beads
    wider: Floats  # (heads,) mm above the tip from which a head is wider than its nozzle


def bare(low: Floats, high: Floats) -> Heights:
    """Return a bed without print, from least to most x and y of all that will be printed."""
    size = np.maximum(high[:2] - low[:2], 0.0)
    cell = max(CELL_MM, float(np.sqrt(size.prod() / MOST_CELLS)), float(size.max() / MOST_CELLS))
    columns, rows = (int(side / cell) + 1 for side in size.tolist())
    sides = [(columns, rows)]
    while columns > 1 or rows > 1:
        columns, rows = (columns + 1) // 2, (rows + 1) // 2
        sides.append((columns, rows))
    table = np.array(sides, np.int64)
    ends = np.cumsum(table.prod(axis=1))
    cells = int(ends[0])
    return Heights(
        np.array(low[:2], np.float64), cell, np.concatenate([[0], ends[:-1]]),
        table[:, 0].copy(), table[:, 1].copy(), np.full(ends[-1], -np.inf),
        np.zeros((cells, 2)), np.full(cells, NOTHING, np.int64),
    )  # fmt: skip


@compiled
def lay(heights: Heights, start: Floats, end: Floats, move: int) -> None:
    """Put a bead into the grid, in place, by points no more than a cell apart."""
    x, y, z = start[0], start[1], start[2]
    dx, dy, dz = end[0] - x, end[1] - y, end[2] - z
    n = int(np.hypot(dx, dy) / heights.cell_mm) + 1
    for k in range(n + 1):
        share = k / n
        _raise(heights, x + share * dx, y + share * dy, z + share * dz, move)


@compiled
def _raise(heights: Heights, x: float, y: float, z: float, move: int) -> None:
    """Note one point of a bead, in place."""
    column = int((x - heights.corner[0]) / heights.cell_mm)
    row = int((y - heights.corner[1]) / heights.cell_mm)
    at = row * heights.columns[0] + column
    if z <= heights.top[at]:
        return
    heights.top[at], heights.move[at] = z, move
    heights.spot[at, 0], heights.spot[at, 1] = x, y
    for level in range(1, len(heights.columns)):
        column, row = column // 2, row // 2
        at = heights.first[level] + row * heights.columns[level] + column
        if z <= heights.top[at]:
            return
        heights.top[at] = z


@compiled
def go_through(
    order: Ints, moves: Moves, parts: Prisms, heights: Heights, heads: int, found: Floats
) -> int:
    """Look at moves in order and lay their beads; returns how many contacts are in `found`.

    Columns of `found`, (k, 13): when a contact begins and ends, its depth, the part of the head,
    the move, the move that laid the bead, where the nozzle is, where the bead, and the cell.

    A contact goes on while each next move of the head is in touch too.
    """
    stack, leg, best = np.zeros((SQUARES, 3), np.int64), np.zeros((2, 2)), np.zeros(13)
    goes_on, n = np.full(heads, -1), 0
    for i in order:
        h = moves.head[i]
        if moves.looked_at[i]:
            if not _look(moves, i, parts, heights, stack, leg, best):
                goes_on[h] = -1
            else:
                if goes_on[h] < 0:
                    if n == len(found):
                        break
                    goes_on[h] = n
                    found[n] = best
                    n += 1
                if best[2] > found[goes_on[h], 2]:
                    found[goes_on[h], 2:] = best[2:]
                found[goes_on[h], 1] = best[1]
        if moves.lays[i]:
            row = moves.row[i]
            lay(heights, moves.points[row], moves.points[row + 1], i)
    return n


@compiled
def _look(
    moves: Moves, i: int, parts: Prisms, heights: Heights, stack: Ints, leg: Floats, best: Floats
) -> bool:
    """Tell whether the head touches the print in a move, and write how into `best`."""
    h = moves.head[i]
    a, b = moves.points[moves.row[i]], moves.points[moves.row[i] + 1]
    best[2] = 0.0
    for k in range(parts.first[h], parts.first[h + 1]):
        low = min(a[2], b[2]) + parts.low[k]
        if heights.top[-1] <= low + GRAZE_MM:
            continue
        cell = _highest(moves, i, parts, k, heights, stack, leg)
        if cell >= 0 and heights.top[cell] - low > best[2]:
            best[2], best[3], best[4] = heights.top[cell] - low, k - parts.first[h], i
            best[5], best[12] = heights.move[cell], cell
    if best[2] <= 0.0:
        return False
    _detail(moves, i, parts, heights, leg, best)
    return True


@compiled
def _highest(
    moves: Moves, i: int, parts: Prisms, k: int, heights: Heights, stack: Ints, leg: Floats
) -> int:
    """Return the cell with the highest bead that part k of the head meets in move i; -1: none."""
    a, b = moves.points[moves.row[i]], moves.points[moves.row[i] + 1]
    limit, met = min(a[2], b[2]) + parts.low[k] + GRAZE_MM, -1
    reach = parts.reach[k] + moves.widest
    count = _begin(a, b, parts, k, reach, heights, stack)
    while count > 0:
        count -= 1
        level, row, column = stack[count, 0], stack[count, 1], stack[count, 2]
        at = heights.first[level] + row * heights.columns[level] + column
        if heights.top[at] <= limit:
            continue
        if level == 0:
            if _meets(moves, i, parts, k, heights, at, leg):
                limit, met = heights.top[at], at
            continue
        side = heights.cell_mm * 2**level
        x = heights.corner[0] + (column + 0.5) * side
        y = heights.corner[1] + (row + 0.5) * side
        if _gap(a, b, 0.0, 1.0, parts, k, x, y, leg) <= reach + 0.7072 * side:
            for r in range(2 * row, min(2 * row + 2, heights.rows[level - 1])):
                for c in range(2 * column, min(2 * column + 2, heights.columns[level - 1])):
                    stack[count, 0], stack[count, 1], stack[count, 2] = level - 1, r, c
                    count += 1
    return met


@compiled
def _begin(
    a: Floats, b: Floats, parts: Prisms, k: int, reach: float, heights: Heights, stack: Ints
) -> int:
    """Write the few squares in which all that a part may meet lies; return how many."""
    first, last = parts.offsets[k], parts.offsets[k + 1]
    low, high = np.zeros(2), np.zeros(2)
    for axis in range(2):
        sides = parts.corners[first:last, axis]
        low[axis] = min(a[axis], b[axis]) + sides.min() - reach - heights.corner[axis]
        high[axis] = max(a[axis], b[axis]) + sides.max() + reach - heights.corner[axis]
    level, side = 0, heights.cell_mm
    while level < len(heights.columns) - 1 and max(high[0] - low[0], high[1] - low[1]) > side:
        level, side = level + 1, 2.0 * side
    count = 0
    for row in range(max(0, int(low[1] // side)),
                     min(heights.rows[level], int(high[1] // side) + 1)):  # fmt: skip
        for column in range(max(0, int(low[0] // side)),
                            min(heights.columns[level], int(high[0] // side) + 1)):  # fmt: skip
            stack[count, 0], stack[count, 1], stack[count, 2] = level, row, column
            count += 1
    return count


@compiled
def _gap(
    a: Floats, b: Floats, low: float, high: float, parts: Prisms, k: int, x: float, y: float,
    leg: Floats,
) -> float:  # fmt: skip
    """Return how far a part stays from a point, seen from above, between two shares of a move."""
    for n, share in enumerate((low, high)):
        leg[n, 0] = x - a[0] - share * (b[0] - a[0])
        leg[n, 1] = y - a[1] - share * (b[1] - a[1])
    return polygon_gap(parts.corners, parts.offsets[k], parts.offsets[k + 1], leg, 0, 2, 0.0, 0.0)


@compiled
def _meets(
    moves: Moves, i: int, parts: Prisms, k: int, heights: Heights, cell: int, leg: Floats
) -> bool:
    """Tell whether a part meets the highest bead of a cell in a move, not as in the source."""
    a, b = moves.points[moves.row[i]], moves.points[moves.row[i] + 1]
    low, high = _span(moves, i, parts.low[k], heights.top[cell], heights.move[cell])
    if low > high:
        return False
    x, y = heights.spot[cell, 0], heights.spot[cell, 1]
    met = heights.move[cell]
    if _gap(a, b, low, high, parts, k, x, y, leg) >= _reach(moves, met, parts, k):
        return False
    tip = min(a[2] + low * (b[2] - a[2]), a[2] + high * (b[2] - a[2]))
    as_sliced = _as_sliced(moves, i, met, heights.top[cell] - tip, parts.wider[moves.head[i]])
    return not as_sliced


@compiled
def _reach(moves: Moves, met: int, parts: Prisms, k: int) -> float:
    """Return how near a part may not come to the middle of a bead, seen from above."""
    return float(max(parts.reach[k] + moves.half[met] - GRAZE_MM, 1e-9))


@compiled
def _span(moves: Moves, i: int, above: float, top: float, met: int) -> tuple[float, float]:
    """Return between which shares of a move a part is lower than a bead that is there by then."""
    a, b = moves.points[moves.row[i]], moves.points[moves.row[i] + 1]
    low, high = 0.0, 1.0
    under, climb = top - above - GRAZE_MM - a[2], b[2] - a[2]
    if climb > 0.0:
        high = min(high, under / climb)
    elif climb < 0.0:
        low = max(low, under / climb)
    elif under <= 0.0:
        high = -1.0
    late, lasts = moves.end[met] - moves.begin[i], moves.end[i] - moves.begin[i]
    if late > 0.0 and lasts > 0.0:  # another head laid it meanwhile
        low = max(low, late / lasts)
    return low, high


@compiled
def _as_sliced(moves: Moves, i: int, met: int, over_tip: float, wider: float) -> bool:
    """Tell whether a bead that stands so far above the tip does so in the source's order too."""
    if moves.number[i] < moves.number[met]:
        return False
    most = moves.height[met]
    if moves.layer[i] == moves.layer[met] and moves.layer[i] >= 0:
        most = max(most, wider)
    return bool(over_tip <= most + GRAZE_MM)


@compiled
def _detail(
    moves: Moves, i: int, parts: Prisms, heights: Heights, leg: Floats, best: Floats
) -> None:
    """Write when a move is in touch, where its nozzle is then, and where the bead is."""
    a, b = moves.points[moves.row[i]], moves.points[moves.row[i] + 1]
    cell, k = int(best[12]), parts.first[moves.head[i]] + int(best[3])
    met = heights.move[cell]
    low, high = _span(moves, i, parts.low[k], heights.top[cell], met)
    x, y = heights.spot[cell, 0], heights.spot[cell, 1]
    at = _first(a, b, low, high, parts, k, x, y, _reach(moves, met, parts, k), leg)
    best[0] = moves.begin[i] + at * (moves.end[i] - moves.begin[i])
    best[1] = moves.end[i]
    for axis in range(3):
        best[6 + axis] = a[axis] + at * (b[axis] - a[axis])
    best[9], best[10], best[11] = x, y, heights.top[cell]


@compiled
def _first(
    a: Floats, b: Floats, low: float, high: float, parts: Prisms, k: int, x: float, y: float,
    reach: float, leg: Floats,
) -> float:  # fmt: skip
    """Return the first share of a move at which a part is nearer to a point than its reach.

    Its distance falls and then grows, as it is convex: the least is found, and then the first.
    """
    begin, near = low, high
    for _ in range(LOOKS):
        third = (near - begin) / 3.0
        one = _gap(a, b, begin + third, begin + third, parts, k, x, y, leg)
        two = _gap(a, b, near - third, near - third, parts, k, x, y, leg)
        if one < reach:
            near = begin + third
            break
        if one <= two:
            near -= third
        else:
            begin += third
    begin = low
    for _ in range(LOOKS):
        middle = 0.5 * (begin + near)
        if _gap(a, b, middle, middle, parts, k, x, y, leg) < reach:
            near = middle
        else:
            begin = middle
    return near
