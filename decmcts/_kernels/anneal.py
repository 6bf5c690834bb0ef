"""Simulated annealing on linear extensions: proposals drawn, judged and applied.

A proposal names a contour near the exit of a random one and makes it follow, by
one of the moves of `decmcts._kernels.moves`, or exchanges two adjacent segments
of log-uniform lengths. Cost comes first (O(1)), feasibility only for proposals
that the Metropolis rule would take.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.moves import (
    Tour,
    apply_swap,
    apply_turn,
    carry_change,
    inner_change,
    swap_allowed,
    swap_change,
    turn_allowed,
    turn_change,
    turned_entry,
)
from decmcts._kernels.random import below, length_up_to, uniform
from decmcts._kernels.sift import try_sift

LONGEST_TURN = 50  # longer segments rarely turn: some edge lies inside
SWAP, TURN, CARRY, SIFT, NOTHING = 0, 1, 2, 3, 4
SIFT_ONE_IN = 16  # a sift costs some twenty exchanges


@kernel
def propose_follow(
    order: NDArray[np.int32],
    position: NDArray[np.int32],
    flip: NDArray[np.uint8],
    turns: NDArray[np.bool_],
    near: NDArray[np.int32],
    state: NDArray[np.uint64],
) -> tuple[int, int, int, int]:
    """Mutate `state`; return a move that lets a near contour follow a random one."""
    n = len(order)
    p = below(state, n)
    c = order[p]
    port = near[2 * c + 1 - flip[c], below(state, near.shape[1])]
    d = port >> 1
    at = position[d]
    if port < 0 or at == p + 1:
        return NOTHING, 0, 0, 0
    wants_turn = flip[d] != port & 1
    if wants_turn or below(state, 4) == 0:
        if port != turned_entry(flip, turns, d):
            return NOTHING, 0, 0, 0
        if p < at <= p + LONGEST_TURN and below(state, 2) == 0:
            return TURN, p + 1, at + 1, 0
        room = at - p if at > p else at + 1
        first = at + 1 - length_up_to(state, min(room, LONGEST_TURN))
        return TURN if first == p + 1 else CARRY, first, at + 1, p
    if below(state, SIFT_ONE_IN) == 0:
        return SIFT, p, at, 0
    room = n - at if at > p else p - at
    length = length_up_to(state, room)
    if at > 0 and below(state, 2) == 0:
        left_alone = order[at - 1]
        partner = near[2 * left_alone + 1 - flip[left_alone], below(state, near.shape[1])]
        gap = position[partner >> 1] - at
        if partner >= 0 and 0 < gap <= room and flip[partner >> 1] == partner & 1:
            length = gap
    if at > p:
        return SWAP, p + 1, at, at + length
    return SWAP, at, at + length, p + 1


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
    """Mutate the tour if carrying is allowed and within slack; return the change."""
    metric, order, flip, after, turns = tour.metric, tour.order, tour.flip, tour.after, tour.turns
    change += inner_change(metric, order, flip, after, turns, i, k)
    if change > slack or not turn_allowed(tour, i, k):
        return 0.0
    if p < i:
        if not swap_allowed(tour, p + 1, i, k):
            return 0.0
        apply_swap(tour, p + 1, i, k)
        apply_turn(tour, p + 1, p + 1 + k - i)
    else:
        if not swap_allowed(tour, i, k, p + 1):
            return 0.0
        apply_swap(tour, i, k, p + 1)
        apply_turn(tour, p + 1 - (k - i), p + 1)
    return change


@kernel
def anneal(
    tour: Tour, state: NDArray[np.uint64], temperature: float, proposals: int
) -> tuple[float, int]:
    """Mutate the tour by `proposals` Metropolis steps; return (cost change, steps taken).

    `temperature` is in mm.
    """
    metric, order, position, flip = tour.metric, tour.order, tour.position, tour.flip
    after, turns, near, n = tour.after, tour.turns, tour.near, len(tour.order)
    total, taken = 0.0, 0
    for _ in range(proposals):
        slack = -temperature * math.log(uniform(state))
        if below(state, 8) == 0:
            kind, i, j, k = propose_any(n, state)
        else:
            kind, i, j, k = propose_follow(order, position, flip, turns, near, state)
        change = 0.0
        if kind == SWAP:
            change = swap_change(metric, order, flip, after, i, j, k)
            change = commit_swap(tour, i, j, k, change) if change <= slack else 0.0
        elif kind == TURN:
            change = turn_change(metric, order, flip, after, turns, i, j)
            change = commit_turn(tour, i, j, change, slack) if change <= slack else 0.0
        elif kind == CARRY:
            change = carry_change(metric, order, flip, after, turns, i, j, k)
            change = commit_carry(tour, i, j, k, change, slack) if change <= slack else 0.0
        elif kind == SIFT:
            change = try_sift(tour, i, j, slack)
        if change != 0.0:
            total += change
            taken += 1
    return total, taken
