"""Moves on a complete sequence: cost change, feasibility and application of each.

Two moves generate all others used here. `swap` exchanges the adjacent segments
[i, j) and [j, k) of the sequence (or-opt, 3-exchange that keeps directions,
whole runs of one tower past another). `turn` reverses the segment [i, k),
contours that may turn being turned (2-opt, single flips).

Since the stored edges have the closure of all, a swap is allowed iff no stored
edge leads from the left segment into the right one: were a before b only by way
of others, each of those lies between them in the old sequence, hence in one of
the two segments, and some stored edge crosses. Only the shorter segment is
scanned (Gambardella & Dorigo 2000, SOP-3-exchange).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.tour import distance


class Tour(NamedTuple):
    """A complete sequence and all that moves on it need, as arrays."""

    ports: NDArray[np.float64]  # (2n, 3) start and end of each contour
    turns: NDArray[np.bool_]  # (n,) may be printed backwards
    group: NDArray[np.int32]  # (n,) moves stay within one group; non-decreasing along the order
    pred_offsets: NDArray[np.int64]  # (n + 1,)
    preds: NDArray[np.int32]  # (m,)
    succ_offsets: NDArray[np.int64]  # (n + 1,)
    succs: NDArray[np.int32]  # (m,)
    near: NDArray[np.int32]  # (2n, k) entry ports near each exit port, -1 padded
    order: NDArray[np.int32]  # (n,) contours in printing order
    position: NDArray[np.int32]  # (n,) inverse of order
    flip: NDArray[np.uint8]  # (n,) by contour
    scratch: NDArray[np.int32]  # (n,)


@kernel
def entry(tour: Tour, p: int) -> int:
    """Return the entry port of the contour at position p."""
    c = tour.order[p]
    return int(2 * c + tour.flip[c])


@kernel
def leave(tour: Tour, p: int) -> int:
    """Return the exit port of the contour at position p."""
    c = tour.order[p]
    return int(2 * c + 1 - tour.flip[c])


@kernel
def turned_entry(tour: Tour, p: int) -> int:
    """Return the entry port of the contour at position p once its segment is turned."""
    c = tour.order[p]
    f = tour.flip[c]
    return int(2 * c + (1 - f if tour.turns[c] else f))


@kernel
def hop(tour: Tour, a: int, b: int) -> float:
    """Return the travel from the exit at position a to the entry at b, 0 outside the sequence."""
    if a < 0 or b >= len(tour.order):
        return 0.0
    return distance(tour.ports, leave(tour, a), entry(tour, b))


@kernel
def swap_change(tour: Tour, i: int, j: int, k: int) -> float:
    """Return the cost change of exchanging [i, j) and [j, k), mm. O(1)."""
    before = hop(tour, i - 1, i) + hop(tour, j - 1, j) + hop(tour, k - 1, k)
    return hop(tour, i - 1, j) + hop(tour, k - 1, i) + hop(tour, j - 1, k) - before


@kernel
def swap_allowed(tour: Tour, i: int, j: int, k: int) -> bool:
    """Say whether no edge leads from [i, j) into [j, k). O(shorter segment's edges)."""
    if tour.group[tour.order[i]] != tour.group[tour.order[k - 1]]:
        return False
    if j - i <= k - j:
        for p in range(j - 1, i - 1, -1):
            c = tour.order[p]
            for e in range(tour.succ_offsets[c], tour.succ_offsets[c + 1]):
                at = tour.position[tour.succs[e]]
                if j <= at < k:
                    return False
        return True
    for p in range(j, k):
        c = tour.order[p]
        for e in range(tour.pred_offsets[c], tour.pred_offsets[c + 1]):
            at = tour.position[tour.preds[e]]
            if i <= at < j:
                return False
    return True


@kernel
def apply_swap(tour: Tour, i: int, j: int, k: int) -> None:
    """Mutate the tour: exchange [i, j) and [j, k). O(k - i)."""
    order, scratch = tour.order, tour.scratch
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
        tour.position[order[p]] = p


@kernel
def inner_change(tour: Tour, i: int, k: int) -> float:
    """Return what turning [i, k) changes inside it, mm: 0 where all contours turn."""
    change = 0.0
    for p in range(i, k - 1):
        if tour.turns[tour.order[p]] and tour.turns[tour.order[p + 1]]:
            continue
        there = turned_entry(tour, p + 1) ^ 1
        change += distance(tour.ports, there, turned_entry(tour, p)) - hop(tour, p, p + 1)
    return change


@kernel
def turn_change(tour: Tour, i: int, k: int) -> float:
    """Return the cost change of turning [i, k), mm. O(k - i)."""
    change = inner_change(tour, i, k) - hop(tour, i - 1, i) - hop(tour, k - 1, k)
    if i > 0:
        change += distance(tour.ports, leave(tour, i - 1), turned_entry(tour, k - 1))
    if k < len(tour.order):
        change += distance(tour.ports, turned_entry(tour, i) ^ 1, entry(tour, k))
    return change


@kernel
def turn_allowed(tour: Tour, i: int, k: int) -> bool:
    """Say whether no edge lies inside [i, k). O(edges of the segment)."""
    if tour.group[tour.order[i]] != tour.group[tour.order[k - 1]]:
        return False
    for p in range(i, k - 1):
        c = tour.order[p]
        for e in range(tour.succ_offsets[c], tour.succ_offsets[c + 1]):
            if tour.position[tour.succs[e]] < k:
                return False
    return True


@kernel
def apply_turn(tour: Tour, i: int, k: int) -> None:
    """Mutate the tour: reverse [i, k) and turn its contours that may turn. O(k - i)."""
    order = tour.order
    a, b = i, k - 1
    while a < b:
        order[a], order[b] = order[b], order[a]
        a += 1
        b -= 1
    for p in range(i, k):
        c = order[p]
        tour.position[c] = p
        if tour.turns[c]:
            tour.flip[c] = 1 - tour.flip[c]
