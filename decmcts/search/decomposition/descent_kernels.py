"""Descent, the deterministic end of a search: at each position nearby moves that gain are made."""

from __future__ import annotations

from decmcts.compiled import kernel
from decmcts.search.sequence.anneal_kernels import (
    LONGEST_REVERSAL,
    commit_carry,
    commit_reversal,
    commit_swap,
)
from decmcts.search.sequence.borrowed_kernels import borrowed
from decmcts.search.sequence.entries_kernels import choose_entry, contour_of, near_row
from decmcts.search.sequence.moves_kernels import (
    Tour,
    carry_change,
    reversal_change,
    swap_change,
)

_GAIN = -1e-9  # mm; smaller gains are rounding


@kernel
def _improve_swaps(tour: Tour, p: int, at: int, longest: int) -> float:
    """Mutate the tour by the first improving exchange that lets `at` follow p; return the gain."""
    room = len(tour.order) - at if at > p else p - at
    for length in range(1, min(room, longest) + 1):
        i, j, k = (p + 1, at, at + length) if at > p else (at, at + length, p + 1)
        change = swap_change(tour, i, j, k)
        if change < _GAIN:
            change = commit_swap(tour, i, j, k, change)
            if change < 0.0:
                return change
    return 0.0


@kernel
def _improve_reversals(tour: Tour, p: int, at: int) -> float:
    """Mutate the tour by the first improving reversal or carry of `at` to p; return the gain."""
    if p < at <= p + LONGEST_REVERSAL:
        change = reversal_change(tour, p + 1, at + 1)
        if change < _GAIN:
            change = commit_reversal(tour, p + 1, at + 1, change, _GAIN)
            if change < 0.0:
                return change
    room = at - p - 1 if at > p else at + 1
    for length in range(1, min(room, LONGEST_REVERSAL) + 1):
        first = at + 1 - length
        change = carry_change(tour, first, at + 1, p)
        if change < _GAIN:
            change = commit_carry(tour, first, at + 1, p, change, _GAIN)
            if change < 0.0:
                return change
    return 0.0


@kernel
def descend(tour: Tour, first: int, last: int, longest: int) -> float:
    """Mutate the tour by improving moves behind positions [first, last); return the gain, <= 0.

    Segments up to `longest` are exchanged. Each position is worked on until
    nothing improves there.
    """
    gain, tour = 0.0, borrowed(tour)
    for p in range(first, last):
        gain += choose_entry(tour, p)
        better = True
        while better:
            better = False
            c = tour.order[p]
            near = tour.near[near_row(tour, c)]
            for x in range(len(near)):
                if near[x] < 0:
                    continue
                at = tour.position[contour_of(near[x], len(tour.order), tour.entry_owner)]
                if at == p + 1:
                    continue
                change = 0.0
                if near[x] >= 2 * len(tour.order) or tour.reversed[near[x] >> 1] == near[x] & 1:
                    change = _improve_swaps(tour, p, at, longest)
                if change == 0.0:
                    change = _improve_reversals(tour, p, at)
                if change < 0.0:
                    gain += change
                    better = True
                    break
    return gain
