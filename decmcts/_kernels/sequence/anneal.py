"""Simulated annealing on linear extensions: proposals drawn, judged and applied.

A proposal names a contour near the exit of a random one and makes it follow, by
one of the moves of `decmcts._kernels.sequence.moves`, or exchanges two adjacent segments
of log-uniform lengths. Cost comes first (O(1)), feasibility only for proposals
that the Metropolis rule would take.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.random import below, length_up_to, uniform
from decmcts._kernels.sequence.lend import lent
from decmcts._kernels.sequence.metric import Metric, distance
from decmcts._kernels.sequence.moves import (
    Tour,
    apply_swap,
    apply_turn,
    carry_change,
    inner_change,
    is_unrelated,
    leave,
    lent_tour,
    swap_allowed,
    swap_change,
    turn_allowed,
    turn_change,
    turned_entry,
)
from decmcts._kernels.sequence.pauses import turn_keeps
from decmcts._kernels.sequence.seats import contour_of, near_row, seat_change, settle, sit, slide
from decmcts._kernels.sequence.sift import try_sift

LONGEST_TURN = 50  # longer segments rarely turn: some edge lies inside
SWAP, TURN, CARRY, SIFT, NOTHING, SEAT = 0, 1, 2, 3, 4, 5
SIFT_ONE_IN = 16  # a sift costs some twenty exchanges
ANY_ONE_IN = 16  # proposals that heed no distance
SETTLE_ONE_IN = 16  # where contours may be entered at several places
SLIDE_ONE_IN = 4  # of these
REACH = 1.0  # temperatures by which a new travel may be longer than the one it replaces
MOST = 16.0  # temperatures; no step of such a cost is ever taken


@kernel
def propose_follow(
    metric: Metric,
    order: NDArray[np.int32],
    position: NDArray[np.int32],
    flip: NDArray[np.uint8],
    after: NDArray[np.float64],
    turns: NDArray[np.bool_],
    near: NDArray[np.int32],
    seat: NDArray[np.int32],
    seat_row: NDArray[np.int32],
    seat_owner: NDArray[np.int32],
    reach: float,
    state: NDArray[np.uint64],
) -> tuple[int, int, int, int, int]:
    """Mutate `state`; return a move that lets a near contour follow a random one.

    The last number is the option the contour takes for that, -1 if none.

    The new travel may be longer than the one it replaces by `reach` at most. That
    loses nothing: of the travels a cheap move adds, one is about as short as the
    one that left the same contour, and every one of them has its proposal.
    """
    n = len(order)
    p = below(state, n)
    c = order[p]
    if turns[c] and below(state, 4) == 0:
        port = near[2 * c + flip[c], below(state, near.shape[1])]
        if port < 0 or port >= 2 * n:
            return NOTHING, 0, 0, 0, -1
        at = position[port >> 1]
        if at <= p or at > p + LONGEST_TURN or flip[port >> 1] != port & 1:
            return NOTHING, 0, 0, 0, -1
        if distance(metric, 2 * c + flip[c], port) - after[order[at - 1]] > reach:
            return NOTHING, 0, 0, 0, -1
        return TURN, p, at, 0, -1
    port = near[near_row(flip, seat, seat_row, c), below(state, near.shape[1])]
    if port < 0:
        return NOTHING, 0, 0, 0, -1
    d, option = contour_of(port, n, seat_owner), -1
    at = position[d]
    if port >= 2 * n:
        option = port - 2 * n
        if distance(metric, leave(flip, c), 2 * n + 2 * option) - after[c] > reach:
            return NOTHING, 0, 0, 0, -1
        if option == seat[d]:
            option = -1
        elif at == p + 1:
            return SEAT, at, 0, 0, option
        port = 2 * d
    elif distance(metric, leave(flip, c), port) - after[c] > reach:
        return NOTHING, 0, 0, 0, -1
    if at == p + 1:
        return NOTHING, 0, 0, 0, -1
    wants_turn = flip[d] != port & 1
    if wants_turn or (option < 0 and below(state, 4) == 0):
        if port != turned_entry(flip, turns, d):
            return NOTHING, 0, 0, 0, -1
        if p < at <= p + LONGEST_TURN and below(state, 2) == 0:
            return TURN, p + 1, at + 1, 0, -1
        room = at - p if at > p else at + 1
        first = at + 1 - length_up_to(state, min(room, LONGEST_TURN))
        return TURN if first == p + 1 else CARRY, first, at + 1, p, -1
    if below(state, SIFT_ONE_IN) == 0:
        return SIFT, p, at, 0, option
    if at > p and below(state, 4) == 0:
        return SWAP, p + 1 - length_up_to(state, p + 1), p + 1, at, option
    room = n - at if at > p else p - at
    length = length_up_to(state, room)
    if at > 0 and below(state, 2) == 0:
        left_alone = order[at - 1]
        row = near_row(flip, seat, seat_row, left_alone)
        partner = near[row, below(state, near.shape[1])]
        if partner >= 0:
            gap = position[contour_of(partner, n, seat_owner)] - at
            fits = partner >= 2 * n or flip[partner >> 1] == partner & 1
            if fits and 0 < gap <= room:
                length = gap
    if at > p:
        return SWAP, p + 1, at, at + length, option
    return SWAP, at, at + length, p + 1, option


@kernel
def propose_any(n: int, state: NDArray[np.uint64]) -> tuple[int, int, int, int]:
    """Mutate `state`; return a turn or an exchange of adjacent segments anywhere."""
    i = below(state, n)
    if below(state, 4) == 0:
        return TURN, i, i + length_up_to(state, min(n - i, LONGEST_TURN)), 0
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
def commit_turn(tour: Tour, i: int, k: int, change: float, slack: float) -> float:
    """Mutate the tour if turning is allowed and within slack; return the change."""
    metric, order, flip, after, turns = tour.metric, tour.order, tour.flip, tour.after, tour.turns
    change += inner_change(metric, order, flip, after, turns, i, k)
    if change > slack or not turn_allowed(tour, i, k):
        return 0.0
    apply_turn(tour, i, k)
    return change


@kernel
def commit_carry(tour: Tour, i: int, k: int, p: int, change: float, slack: float) -> float:
    """Mutate the tour if carrying is allowed and within slack; return the change.

    Pauses must be kept by the exchange alone too, before the segment is turned.
    """
    metric, order, flip, after, turns = tour.metric, tour.order, tour.flip, tour.after, tour.turns
    change += inner_change(metric, order, flip, after, turns, i, k)
    if change > slack or not is_unrelated(tour, i, k):
        return 0.0
    if p < i:
        left, middle, right, to = p + 1, i, k, p + 1
    else:
        left, middle, right, to = i, k, p + 1, p + 1 - (k - i)
    if not swap_allowed(tour, left, middle, right):
        return 0.0
    apply_swap(tour, left, middle, right)
    if not turn_keeps(tour.pauses, order, tour.position, to, to + k - i):
        apply_swap(tour, left, left + right - middle, right)
        return 0.0
    apply_turn(tour, to, to + k - i)
    return change


@kernel
def step_to_seat(tour: Tour, kind: int, i: int, j: int, k: int, option: int, slack: float) -> float:
    """Mutate the tour by a move for which a contour takes an option; return the change.

    0 if refused; then nothing has changed.
    """
    d = tour.seat_owner[option]
    old = tour.seat[d]
    extra = seat_change(tour, tour.position[d], option)
    if kind == SEAT:
        if extra > slack:
            return 0.0
        sit(tour, i, option)
        return extra
    sit(tour, tour.position[d], option)
    if kind == SIFT:
        c = tour.order[i]
        change = extra + try_sift(tour, i, j, slack - extra)
        if tour.position[d] == tour.position[c] + 1:
            return change
    else:
        change = extra + swap_change(tour.metric, tour.order, tour.flip, tour.after, i, j, k)
        if change <= slack and swap_allowed(tour, i, j, k):
            apply_swap(tour, i, j, k)
            return change
    sit(tour, tour.position[d], old)
    return 0.0


@kernel
def anneal(
    tour: Tour, state: NDArray[np.uint64], temperature: float, proposals: int
) -> tuple[float, int]:
    """Mutate the tour by `proposals` Metropolis steps; return (cost change, steps taken).

    `temperature` is in the metric's unit.
    """
    tour, state = lent_tour(tour), lent(state)
    metric, order, position, flip = tour.metric, tour.order, tour.position, tour.flip
    after, turns, near, n = tour.after, tour.turns, tour.near, len(tour.order)
    seat, seat_row, seat_owner = tour.seat, tour.seat_row, tour.seat_owner
    total, taken, reach, most = 0.0, 0, REACH * temperature, MOST * temperature
    for _ in range(proposals):
        option = -1
        if below(state, ANY_ONE_IN) == 0:
            kind, i, j, k = propose_any(n, state)
        elif len(seat_owner) > 0 and below(state, SETTLE_ONE_IN) == 0:
            i = below(state, n)
            if below(state, SLIDE_ONE_IN) > 0:
                total += settle(tour, i)
            elif seat[order[i]] >= 0:
                first, last = tour.seat_offsets[order[i]], tour.seat_offsets[order[i] + 1]
                option, ahead = first + below(state, last - first), below(state, 2) == 0
                slack = -temperature * math.log(uniform(state))
                total += slide(tour, i, option, ahead, slack)
            continue
        else:
            kind, i, j, k, option = propose_follow(
                metric, order, position, flip, after, turns, near, seat, seat_row, seat_owner,
                reach, state,
            )  # fmt: skip
        if kind == NOTHING:
            continue
        change = 0.0
        if option >= 0:
            slack = -temperature * math.log(uniform(state))
            change = step_to_seat(tour, kind, i, j, k, option, slack)
            total += change
            taken += int(change != 0.0)
            continue
        if kind == SWAP:
            change = swap_change(metric, order, flip, after, i, j, k)
        elif kind == TURN:
            change = turn_change(metric, order, flip, after, turns, i, j)
        elif kind == CARRY:
            change = carry_change(metric, order, flip, after, turns, i, j, k)
        if change > most:
            continue
        slack = -temperature * math.log(uniform(state))
        if kind == SWAP:
            change = commit_swap(tour, i, j, k, change) if change <= slack else 0.0
        elif kind == TURN:
            change = commit_turn(tour, i, j, change, slack) if change <= slack else 0.0
        elif kind == CARRY:
            change = commit_carry(tour, i, j, k, change, slack) if change <= slack else 0.0
        elif kind == SIFT:
            change = try_sift(tour, i, j, slack)
        if change != 0.0:
            total += change
            taken += 1
    return total, taken
