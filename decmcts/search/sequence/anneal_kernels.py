"""Simulated annealing on linear extensions, and descent: proposals drawn, judged and applied.

A proposal names a contour near the exit of a random one and makes it follow, by
one of the moves of `decmcts.search.sequence.moves_kernels`, or exchanges two adjacent segments
of log-uniform lengths. Cost comes first (O(1)), feasibility only for proposals
that the Metropolis rule would take. Descent, the deterministic end of a search, makes nearby
moves that gain, position by position.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import inlined, kernel
from decmcts.random_kernels import below, length_up_to, uniform
from decmcts.search.sequence.borrowed_kernels import borrowed
from decmcts.search.sequence.entries_kernels import (
    choose_entry,
    contour_of,
    entry_change,
    near_row,
    slide_entries,
    use_entry,
)
from decmcts.search.sequence.insertion_kernels import try_insertion
from decmcts.search.sequence.metric_kernels import distance
from decmcts.search.sequence.moves_kernels import (
    Tour,
    apply_reversal,
    apply_swap,
    carry_change,
    change_inside,
    is_unrelated,
    port_in_reversed,
    port_out,
    reversal_allowed,
    reversal_change,
    swap_allowed,
    swap_change,
)
from decmcts.search.sequence.timed_lags_kernels import reversal_keeps

LONGEST_REVERSAL = 50  # longer segments can rarely be reversed: some edge lies inside

# Moves, by the positions i, j, k and the entry that are proposed with them:
SWAP = 0  # exchange [i, j) and [j, k); the contour that comes to follow takes the entry, if any
REVERSE = 1  # reverse [i, j)
CARRY = 2  # move [i, j), reversed, to follow position k
INSERT = 3  # let the contour at j follow that at i, and take the entry, if any
NOTHING = 4
ENTER = 5  # enter the contour at i by the entry
INSERT_ONE_IN = 16  # an insertion costs some twenty exchanges
ANY_ONE_IN = 16  # proposals that heed no distance
CHOOSE_ONE_IN = 16  # where contours may be entered at several places
SLIDE_ONE_IN = 4  # of these
REACH = 1.0  # temperatures by which a new travel may be longer than the one it replaces
MOST = 16.0  # temperatures; no step of such a cost is ever taken
_GAIN = -1e-9  # mm; smaller gains are rounding


@inlined
def propose_follow(
    tour: Tour, reach: float, state: NDArray[np.uint64]
) -> tuple[int, int, int, int, int]:
    """Mutate `state`; return a move that lets a near contour follow a random one.

    That is its kind, i, j, k, and the entry the contour takes for it, -1 if none.

    The new travel may be longer than the one it replaces by `reach` at most. That
    loses nothing: of the travels a cheap move adds, one is about as short as the
    one that left the same contour, and every one of them has its proposal.
    """
    metric, order, position, is_reversed = tour.metric, tour.order, tour.position, tour.reversed
    after, near, n = tour.after, tour.near, len(tour.order)
    p = below(state, n)
    c = order[p]
    if tour.reversible[c] and below(state, 4) == 0:
        port = near[2 * c + is_reversed[c], below(state, near.shape[1])]
        if port < 0 or port >= 2 * n:
            return NOTHING, 0, 0, 0, -1
        at = position[port >> 1]
        if at <= p or at > p + LONGEST_REVERSAL or is_reversed[port >> 1] != port & 1:
            return NOTHING, 0, 0, 0, -1
        if distance(metric, 2 * c + is_reversed[c], port) - after[order[at - 1]] > reach:
            return NOTHING, 0, 0, 0, -1
        return REVERSE, p, at, 0, -1
    port = near[near_row(tour, c), below(state, near.shape[1])]
    if port < 0:
        return NOTHING, 0, 0, 0, -1
    d, entry = contour_of(port, n, tour.entry_owner), -1
    at = position[d]
    if port >= 2 * n:
        entry = port - 2 * n
        if distance(metric, port_out(is_reversed, c), 2 * n + 2 * entry) - after[c] > reach:
            return NOTHING, 0, 0, 0, -1
        if entry == tour.entry_id[d]:
            entry = -1
        elif at == p + 1:
            return ENTER, at, 0, 0, entry
        port = 2 * d
    elif distance(metric, port_out(is_reversed, c), port) - after[c] > reach:
        return NOTHING, 0, 0, 0, -1
    if at == p + 1:
        return NOTHING, 0, 0, 0, -1
    wants_reversal = is_reversed[d] != port & 1
    if wants_reversal or (entry < 0 and below(state, 4) == 0):
        if port != port_in_reversed(is_reversed, tour.reversible, d):
            return NOTHING, 0, 0, 0, -1
        if p < at <= p + LONGEST_REVERSAL and below(state, 2) == 0:
            return REVERSE, p + 1, at + 1, 0, -1
        room = at - p if at > p else at + 1
        first = at + 1 - length_up_to(state, min(room, LONGEST_REVERSAL))
        return REVERSE if first == p + 1 else CARRY, first, at + 1, p, -1
    if below(state, INSERT_ONE_IN) == 0:
        return INSERT, p, at, 0, entry
    if at > p and below(state, 4) == 0:
        return SWAP, p + 1 - length_up_to(state, p + 1), p + 1, at, entry
    room = n - at if at > p else p - at
    length = length_up_to(state, room)
    if at > 0 and below(state, 2) == 0:
        left_alone = order[at - 1]
        row = near_row(tour, left_alone)
        partner = near[row, below(state, near.shape[1])]
        if partner >= 0:
            gap = position[contour_of(partner, n, tour.entry_owner)] - at
            fits = partner >= 2 * n or is_reversed[partner >> 1] == partner & 1
            if fits and 0 < gap <= room:
                length = gap
    if at > p:
        return SWAP, p + 1, at, at + length, entry
    return SWAP, at, at + length, p + 1, entry


@kernel
def propose_any(n: int, state: NDArray[np.uint64]) -> tuple[int, int, int, int]:
    """Mutate `state`; return a reversal or an exchange of adjacent segments anywhere."""
    i = below(state, n)
    if below(state, 4) == 0:
        return REVERSE, i, i + length_up_to(state, min(n - i, LONGEST_REVERSAL)), 0
    if i == 0:
        return NOTHING, 0, 0, 0
    left = length_up_to(state, i)
    return SWAP, i - left, i, i + length_up_to(state, n - i)


@kernel
def commit_swap(tour: Tour, i: int, j: int, k: int, change: float) -> float:
    """Mutate the tour if the swap is allowed; return the change, 0 if refused."""
    if not swap_allowed(tour, i, j, k):
        return 0.0
    apply_swap(tour, i, j, k)
    return change


@kernel
def commit_reversal(tour: Tour, i: int, k: int, change: float, slack: float) -> float:
    """Mutate the tour if the reversal is allowed and within slack; return the change."""
    change += change_inside(tour, i, k)
    if change > slack or not reversal_allowed(tour, i, k):
        return 0.0
    apply_reversal(tour, i, k)
    return change


@kernel
def commit_carry(tour: Tour, i: int, k: int, p: int, change: float, slack: float) -> float:
    """Mutate the tour if carrying is allowed and within slack; return the change.

    Lags must be kept by the exchange alone too, before the segment is reversed.
    """
    change += change_inside(tour, i, k)
    if change > slack or not is_unrelated(tour, i, k):
        return 0.0
    if p < i:
        left, middle, right, to = p + 1, i, k, p + 1
    else:
        left, middle, right, to = i, k, p + 1, p + 1 - (k - i)
    if not swap_allowed(tour, left, middle, right):
        return 0.0
    apply_swap(tour, left, middle, right)
    if not reversal_keeps(tour.lags, tour.order, tour.position, to, to + k - i):
        apply_swap(tour, left, left + right - middle, right)
        return 0.0
    apply_reversal(tour, to, to + k - i)
    return change


@kernel
def step_to_entry(tour: Tour, kind: int, i: int, j: int, k: int, entry: int, slack: float) -> float:
    """Mutate the tour by a move for which a contour takes an entry; return the change.

    0 if refused; then nothing has changed.
    """
    d = tour.entry_owner[entry]
    old = tour.entry_id[d]
    extra = entry_change(tour, tour.position[d], entry)
    if kind == ENTER:
        if extra > slack:
            return 0.0
        use_entry(tour, i, entry)
        return extra
    use_entry(tour, tour.position[d], entry)
    if kind == INSERT:
        c = tour.order[i]
        change = extra + try_insertion(tour, i, j, slack - extra)
        if tour.position[d] == tour.position[c] + 1:
            return change
    else:
        change = extra + swap_change(tour, i, j, k)
        if change <= slack and swap_allowed(tour, i, j, k):
            apply_swap(tour, i, j, k)
            return change
    use_entry(tour, tour.position[d], old)
    return 0.0


@kernel
def anneal(tour: Tour, state: NDArray[np.uint64], temperature: float, proposals: int) -> float:
    """Mutate the tour by `proposals` Metropolis steps; return the change of its cost.

    `temperature` is in the metric's unit.
    """
    tour, state = borrowed(tour), borrowed(state)
    order, n = tour.order, len(tour.order)
    total, reach, most = 0.0, REACH * temperature, MOST * temperature
    for _ in range(proposals):
        entry = -1
        if below(state, ANY_ONE_IN) == 0:
            kind, i, j, k = propose_any(n, state)
        elif len(tour.entry_owner) > 0 and below(state, CHOOSE_ONE_IN) == 0:
            i = below(state, n)
            if below(state, SLIDE_ONE_IN) > 0:
                total += choose_entry(tour, i)
            elif tour.entry_id[order[i]] >= 0:
                first, last = tour.entry_offsets[order[i]], tour.entry_offsets[order[i] + 1]
                entry, forward = first + below(state, last - first), below(state, 2) == 0
                slack = -temperature * math.log(uniform(state))
                total += slide_entries(tour, i, entry, forward, slack)
            continue
        else:
            kind, i, j, k, entry = propose_follow(tour, reach, state)
        if kind == NOTHING:
            continue
        change = 0.0
        if entry >= 0:
            slack = -temperature * math.log(uniform(state))
            total += step_to_entry(tour, kind, i, j, k, entry, slack)
            continue
        if kind == SWAP:
            change = swap_change(tour, i, j, k)
        elif kind == REVERSE:
            change = reversal_change(tour, i, j)
        elif kind == CARRY:
            change = carry_change(tour, i, j, k)
        if change > most:
            continue
        slack = -temperature * math.log(uniform(state))
        if kind == SWAP:
            change = commit_swap(tour, i, j, k, change) if change <= slack else 0.0
        elif kind == REVERSE:
            change = commit_reversal(tour, i, j, change, slack) if change <= slack else 0.0
        elif kind == CARRY:
            change = commit_carry(tour, i, j, k, change, slack) if change <= slack else 0.0
        elif kind == INSERT:
            change = try_insertion(tour, i, j, slack)
        total += change
    return total


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
