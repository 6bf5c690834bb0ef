"""Loops that may be entered at several vertices: their entries, and changing between them.

Entry o begins at the metric's point 2n + 2o and its loop then ends at 2n + 2o + 1. A
contour that uses it has these points copied to its ports, so that the moves on
sequences need not know of entries. In lists of near ports 2n + o stands for it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.search.sequence.metric_kernels import Metric, distance, points_of
from decmcts.search.sequence.moves_kernels import Tour, port_in, port_out, refresh

LONGEST_SLIDE = 100  # contours


@inlined
def near_row(tour: Tour, c: int) -> int:
    """Return the row of the near lists for the exit of contour c."""
    entry = tour.entry_id[c]
    return int(port_out(tour.reversed, c) if entry < 0 else tour.entry_row[entry])


@kernel
def contour_of(port: int, n: int, entry_owner: Int32s) -> int:
    """Return the contour of an entry in the near lists."""
    return int(port >> 1 if port < 2 * n else entry_owner[port - 2 * n])


@kernel
def entry_change(tour: Tour, p: int, entry: int) -> float:
    """Return the cost change of entering the contour at position p by an entry. O(1)."""
    n, c, change = len(tour.order), tour.order[p], 0.0
    into = 2 * n + 2 * entry
    if p > 0:
        before = tour.order[p - 1]
        change += distance(tour.metric, port_out(tour.reversed, before), into) - tour.after[before]
    if p + 1 < n:
        out = port_in(tour.reversed, tour.order[p + 1])
        change += distance(tour.metric, into + 1, out) - tour.after[c]
    return float(change)


@kernel
def use_entry(tour: Tour, p: int, entry: int) -> None:
    """Mutate the tour: enter the contour at position p by an entry. O(1)."""
    n, c, points = len(tour.order), tour.order[p], points_of(tour.metric)
    for port in range(2):
        for axis in range(3):
            points[2 * c + port, axis] = points[2 * n + 2 * entry + port, axis]
    tour.entry_id[c] = entry
    refresh(tour, p - 1, p + 1)


@kernel
def choose_entry(tour: Tour, p: int) -> float:
    """Mutate the tour: enter the contour at p where it is cheapest; return the change, <= 0."""
    c = tour.order[p]
    if tour.entry_id[c] < 0:
        return 0.0
    best, least = -1, -1e-9
    for entry in range(tour.entry_offsets[c], tour.entry_offsets[c + 1]):
        change = entry_change(tour, p, entry)
        if change < least:
            best, least = entry, change
    if best < 0:
        return 0.0
    use_entry(tour, p, best)
    return least


@kernel
def nearest_entry(tour: Tour, q: int, forward: bool) -> int:
    """Return the entry of the contour at q nearest to the one before (forward) or behind it."""
    n, d, best, least = len(tour.order), tour.order[q], -1, np.inf
    c = tour.order[q - 1 if forward else q + 1]
    other = port_out(tour.reversed, c) if forward else port_in(tour.reversed, c)
    for entry in range(tour.entry_offsets[d], tour.entry_offsets[d + 1]):
        door = 2 * n + 2 * entry
        if forward:
            length = distance(tour.metric, other, door)
        else:
            length = distance(tour.metric, door + 1, other)
        if length < least:
            best, least = entry, length
    return best


@kernel
def slide_entries(tour: Tour, p: int, entry: int, forward: bool, slack: float) -> float:
    """Mutate the tour: the contour at p takes an entry, and loops behind (or before) it follow.

    Each takes what is nearest to the last one, until all together costs no more than
    `slack`. Returns the change; 0 if that never is, then nothing has changed.
    """
    n, q, made, total, step = len(tour.order), p, 0, 0.0, 1 if forward else -1
    while True:
        tour.scratch[made] = tour.entry_id[tour.order[q]]
        made += 1
        total += entry_change(tour, q, entry)
        use_entry(tour, q, entry)
        if total <= slack:
            return total
        q += step
        if made == LONGEST_SLIDE or q < 0 or q >= n or tour.entry_id[tour.order[q]] < 0:
            break
        entry = nearest_entry(tour, q, forward)
        if entry == tour.entry_id[tour.order[q]]:
            break
    for x in range(made):
        use_entry(tour, p + step * x, tour.scratch[x])
    return 0.0


@kernel
def point_in(n: int, is_reversed: NDArray[np.uint8], entry_id: Int32s, c: int) -> int:
    """Return the point of the metric at which contour c of n is entered."""
    return int(2 * c + is_reversed[c] if entry_id[c] < 0 else 2 * n + 2 * entry_id[c])


@kernel
def point_out(n: int, is_reversed: NDArray[np.uint8], entry_id: Int32s, c: int) -> int:
    """Return the point of the metric at which contour c of n is left."""
    return int(2 * c + 1 - is_reversed[c] if entry_id[c] < 0 else 2 * n + 2 * entry_id[c] + 1)


@kernel
def visits_cost(
    metric: Metric,
    order: Int32s,
    is_reversed: NDArray[np.uint8],
    entry_id: Int32s,
) -> float:
    """Return what the travels of a sequence cost, by entries rather than by ports."""
    n, total = len(order), 0.0
    for k in range(1, n):
        a, b = order[k - 1], order[k]
        total += distance(
            metric, point_out(n, is_reversed, entry_id, a), point_in(n, is_reversed, entry_id, b)
        )
    return total


@kernel
def _ports_of(c: int, n: int, reversible: Flags, offsets: Ints, into: Ints, out: Ints) -> int:
    """Mutate `into` and `out`: the ports of each choice for c; return how many there are."""
    count = offsets[c + 1] - offsets[c]
    if count > 1:
        for x in range(count):
            into[x] = 2 * n + 2 * (offsets[c] + x)
            out[x] = into[x] + 1
        return int(count)
    into[0], out[0] = 2 * c, 2 * c + 1
    into[1], out[1] = 2 * c + 1, 2 * c
    return 2 if reversible[c] else 1


@kernel
def choose_visits(
    metric: Metric,
    order: Int32s,
    reversible: Flags,
    offsets: Ints,
) -> tuple[NDArray[np.uint8], Int32s]:
    """Return the directions and entries, by contour, that are cheapest for a fixed order.

    Dynamic programme over the choices for each contour, O(n k²) for k entries. On
    ties the sliced direction, or the first entry, wins.
    """
    n, most = len(order), 2
    for c in range(n):
        most = max(most, offsets[c + 1] - offsets[c])
    came = np.zeros((n, most), np.int32)
    best, step = np.zeros(most), np.zeros(most)
    into, out = np.zeros(most, np.int64), np.zeros(most, np.int64)
    before = np.zeros(most, np.int64)
    n_before = 0
    for k in range(n):
        count = _ports_of(order[k], n, reversible, offsets, into, out)
        for x in range(count):
            step[x] = 0.0 if k == 0 else np.inf
            for y in range(n_before):
                cost = best[y] + distance(metric, before[y], into[x])
                if cost < step[x]:
                    step[x] = cost
                    came[k, x] = y
        best[:count] = step[:count]
        before[:count] = out[:count]
        n_before = count
    is_reversed, entry_id = np.zeros(n, np.uint8), np.full(n, -1, np.int32)
    x = 0
    for y in range(1, n_before):
        if best[y] < best[x]:
            x = y
    for k in range(n - 1, -1, -1):
        c = order[k]
        if offsets[c + 1] - offsets[c] > 1:
            entry_id[c] = offsets[c] + x
        else:
            is_reversed[c] = x
        x = came[k, x]
    return is_reversed, entry_id
