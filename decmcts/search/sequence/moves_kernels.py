"""Moves on a complete sequence: cost change, feasibility and application of each.

Two moves generate all others used here. `swap` exchanges the adjacent segments
[i, j) and [j, k) of the sequence (or-opt, 3-exchange that keeps directions,
whole runs of one tower past another). A *reversal* puts the segment [i, k) in reverse
order, and reverses those of its contours that may be (2-opt, single contours too).

Since the stored edges have the closure of all, a swap is allowed iff no stored
edge leads from the left segment into the right one: were a before b only by way
of others, each of those lies between them in the old sequence, hence in one of
the two segments, and some stored edge crosses. Only the shorter segment is
scanned (Gambardella & Dorigo 2000, SOP-3-exchange).

Functions that price a proposal are compiled into their callers: passing a whole `Tour` costs
more than the arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.search.sequence.metric_kernels import Metric, costs_the_same_back, distance
from decmcts.search.sequence.timed_lags_kernels import (
    LagState,
    retime,
    reversal_keeps,
    swap_keeps,
)


class Tour(NamedTuple):
    """A complete sequence and all that moves on it need, as arrays."""

    metric: Metric  # prices travels between ports
    reversible: Flags  # (n,) may be reversed
    group: Int32s  # (n,) moves stay within one group; non-decreasing along the order
    pred_offsets: Ints  # (n + 1,)
    preds: Int32s  # (m,)
    succ_offsets: Ints  # (n + 1,)
    succs: Int32s  # (m,)
    near: Int32s  # (2n + anchors, k) entry ports near each exit, -1 padded
    entry_offsets: Ints  # (n + 1,) possible entries of each contour
    entry_owner: Int32s  # (m,) contour of each entry; empty where there are none
    entry_row: Int32s  # (m,) row of `near` for the exit of each entry
    entry_id: Int32s  # (n,) entry in use, -1: entered as sliced
    order: Int32s  # (n,) contours in printing order
    position: Int32s  # (n,) inverse of order
    reversed: NDArray[np.uint8]  # (n,) by contour
    after: Floats  # (n,) by contour: travel to the next one, 0 for the last
    scratch: Int32s  # (n,)
    mark: Flags  # (n,) all False between moves
    lags: LagState  # between contours that lie on each other


@kernel
def port_in(is_reversed: NDArray[np.uint8], c: int) -> int:
    """Return the port contour c is entered at."""
    return int(2 * c + is_reversed[c])


@kernel
def port_out(is_reversed: NDArray[np.uint8], c: int) -> int:
    """Return the port contour c is left at."""
    return int(2 * c + 1 - is_reversed[c])


@kernel
def port_in_reversed(is_reversed: NDArray[np.uint8], reversible: Flags, c: int) -> int:
    """Return the port contour c is entered at once its segment is reversed."""
    return int(2 * c + (1 - is_reversed[c] if reversible[c] else is_reversed[c]))


@kernel
def refresh(tour: Tour, i: int, k: int) -> None:
    """Mutate the tour: recompute the travels after positions [i, k)."""
    order, is_reversed, n = tour.order, tour.reversed, len(tour.order)
    for p in range(max(i, 0), min(k, n)):
        travel = 0.0
        if p + 1 < n:
            travel = distance(
                tour.metric, port_out(is_reversed, order[p]), port_in(is_reversed, order[p + 1])
            )
        tour.after[order[p]] = travel


@inlined
def swap_change(tour: Tour, i: int, j: int, k: int) -> float:
    """Return the cost change of exchanging [i, j) and [j, k). O(1)."""
    metric, order, is_reversed, after = tour.metric, tour.order, tour.reversed, tour.after
    first, middle, last = order[i], order[j - 1], order[k - 1]
    change = distance(metric, port_out(is_reversed, last), port_in(is_reversed, first))
    change -= after[middle] + after[last]
    if i > 0:
        before = order[i - 1]
        change += (
            distance(metric, port_out(is_reversed, before), port_in(is_reversed, order[j]))
            - after[before]
        )
    if k < len(order):
        change += distance(metric, port_out(is_reversed, middle), port_in(is_reversed, order[k]))
    return float(change)


@kernel
def edge_leads(
    order: Int32s,
    position: Int32s,
    pred_offsets: Ints,
    preds: Int32s,
    succ_offsets: Ints,
    succs: Int32s,
    i: int,
    j: int,
    k: int,
) -> bool:
    """Say whether an edge leads from [i, j) into [j, k). O(edges of the shorter segment)."""
    if j - i <= k - j:
        for p in range(j - 1, i - 1, -1):
            c = order[p]
            for e in range(succ_offsets[c], succ_offsets[c + 1]):
                if j <= position[succs[e]] < k:
                    return True
    else:
        for p in range(j, k):
            c = order[p]
            for e in range(pred_offsets[c], pred_offsets[c + 1]):
                if i <= position[preds[e]] < j:
                    return True
    return False


@kernel
def edge_inside(
    order: Int32s,
    position: Int32s,
    succ_offsets: Ints,
    succs: Int32s,
    i: int,
    k: int,
) -> bool:
    """Say whether an edge lies inside [i, k). O(edges of the segment)."""
    for p in range(i, k - 1):
        c = order[p]
        for e in range(succ_offsets[c], succ_offsets[c + 1]):
            if position[succs[e]] < k:
                return True
    return False


@kernel
def exchange(order: Int32s, position: Int32s, scratch: Int32s, i: int, j: int, k: int) -> None:
    """Mutate order and position: exchange [i, j) and [j, k). O(k - i)."""
    left, right = j - i, k - j
    if left <= right:
        scratch[:left] = order[i:j]
        for p in range(i, i + right):
            order[p] = order[p + left]
        order[i + right : k] = scratch[:left]
    else:
        scratch[:right] = order[j:k]
        for p in range(k - 1, i + right - 1, -1):
            order[p] = order[p - right]
        order[i : i + right] = scratch[:right]
    for p in range(i, k):
        position[order[p]] = p


@kernel
def reverse(order: Int32s, position: Int32s, i: int, k: int) -> None:
    """Mutate order and position: reverse [i, k). O(k - i)."""
    a, b = i, k - 1
    while a < b:
        order[a], order[b] = order[b], order[a]
        a += 1
        b -= 1
    for p in range(i, k):
        position[order[p]] = p


@kernel
def swap_allowed(tour: Tour, i: int, j: int, k: int) -> bool:
    """Say whether no edge leads from [i, j) into [j, k), and lags are kept.

    O(shorter segment's edges), and what lies within the longest lag.
    """
    order, position = tour.order, tour.position
    if tour.group[order[i]] != tour.group[order[k - 1]]:
        return False
    if edge_leads(
        order, position, tour.pred_offsets, tour.preds, tour.succ_offsets, tour.succs, i, j, k
    ):
        return False
    return swap_keeps(tour.lags, order, position, i, j, k)


@kernel
def apply_swap(tour: Tour, i: int, j: int, k: int) -> None:
    """Mutate the tour: exchange [i, j) and [j, k). O(k - i)."""
    order, right = tour.order, k - j
    exchange(order, tour.position, tour.scratch, i, j, k)
    retime(tour.lags, order, i, k)
    refresh(tour, i - 1, i)
    refresh(tour, i + right - 1, i + right)
    refresh(tour, k - 1, k)


@inlined
def change_inside(tour: Tour, i: int, k: int) -> float:
    """Return what reversing [i, k) changes inside it: 0 where all may be, but for bare climbs."""
    metric, order, is_reversed, after = tour.metric, tour.order, tour.reversed, tour.after
    reversible = tour.reversible
    change = 0.0
    for p in range(i, k - 1):
        a, b = order[p], order[p + 1]
        there = port_in_reversed(is_reversed, reversible, b) ^ 1
        back = port_in_reversed(is_reversed, reversible, a)
        if reversible[a] and reversible[b] and costs_the_same_back(metric, there, back):
            continue
        change += distance(metric, there, back) - after[a]
    return float(change)


@inlined
def reversal_change(tour: Tour, i: int, k: int) -> float:
    """Return the cost change of reversing [i, k) without what changes inside. O(1)."""
    metric, order, is_reversed, after = tour.metric, tour.order, tour.reversed, tour.after
    reversible = tour.reversible
    first, last = order[i], order[k - 1]
    change = -after[last]
    if i > 0:
        before = order[i - 1]
        into = port_in_reversed(is_reversed, reversible, last)
        change += distance(metric, port_out(is_reversed, before), into) - after[before]
    if k < len(order):
        out = port_in_reversed(is_reversed, reversible, first) ^ 1
        change += distance(metric, out, port_in(is_reversed, order[k]))
    return float(change)


@kernel
def reversal_allowed(tour: Tour, i: int, k: int) -> bool:
    """Say whether no edge lies inside [i, k) and reversing it keeps the lags."""
    if not is_unrelated(tour, i, k):
        return False
    return reversal_keeps(tour.lags, tour.order, tour.position, i, k)


@kernel
def is_unrelated(tour: Tour, i: int, k: int) -> bool:
    """Say whether no edge lies inside [i, k), which is of one group. O(edges of the segment)."""
    order, position = tour.order, tour.position
    if tour.group[order[i]] != tour.group[order[k - 1]]:
        return False
    return not edge_inside(order, position, tour.succ_offsets, tour.succs, i, k)


@kernel
def apply_reversal(tour: Tour, i: int, k: int) -> None:
    """Mutate the tour: reverse [i, k), and its contours that may be. O(k - i)."""
    order, is_reversed = tour.order, tour.reversed
    reverse(order, tour.position, i, k)
    for p in range(i, k):
        c = order[p]
        if tour.reversible[c]:
            is_reversed[c] = 1 - is_reversed[c]
    retime(tour.lags, order, i, k)
    refresh(tour, i - 1, k)


@inlined
def carry_change(tour: Tour, i: int, k: int, p: int) -> float:
    """Return the cost change of moving [i, k) reversed to follow position p, outside it. O(1).

    As with `reversal_change`, what changes inside the segment is not counted.
    """
    metric, order, is_reversed, after = tour.metric, tour.order, tour.reversed, tour.after
    reversible = tour.reversible
    first, last, anchor = order[i], order[k - 1], order[p]
    change = distance(
        metric, port_out(is_reversed, anchor), port_in_reversed(is_reversed, reversible, last)
    )
    change -= after[anchor] + after[last]
    if p + 1 < len(order):
        out = port_in_reversed(is_reversed, reversible, first) ^ 1
        change += distance(metric, out, port_in(is_reversed, order[p + 1]))
    if i > 0:
        before = order[i - 1]
        change -= after[before]
        if k < len(order):
            change += distance(
                metric, port_out(is_reversed, before), port_in(is_reversed, order[k])
            )
    return float(change)
