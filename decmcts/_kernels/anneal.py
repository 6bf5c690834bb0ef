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
    swap_allowed,
    swap_change,
    turn_allowed,
    turn_change,
)
from decmcts._kernels.random import below, length_up_to, uniform

LONGEST_TURN = 50  # longer segments rarely turn: some edge lies inside


@kernel
def try_swap(tour: Tour, i: int, j: int, k: int, slack: float) -> float:
    """Mutate the tour if the swap costs at most `slack`; return the change, 0 if refused."""
    change = swap_change(tour, i, j, k)
    if change > slack or not swap_allowed(tour, i, j, k):
        return 0.0
    apply_swap(tour, i, j, k)
    return change


@kernel
def try_turn(tour: Tour, i: int, k: int, slack: float) -> float:
    """Mutate the tour if turning costs at most `slack`; return the change, 0 if refused."""
    change = turn_change(tour, i, k)
    if change > slack or not turn_allowed(tour, i, k):
        return 0.0
    apply_turn(tour, i, k)
    return change


@kernel
def try_follow(tour: Tour, p: int, port: int, state: NDArray[np.uint64], slack: float) -> float:
    """Mutate the tour: let the contour of `port` follow position p; return the change."""
    d = port >> 1
    at = tour.position[d]
    if at == p:
        return 0.0
    n = len(tour.order)
    turned = tour.flip[d] != port & 1
    near_turn = p < at <= p + LONGEST_TURN
    if near_turn and (turned or (at > p + 1 and below(state, 4) == 0)):
        return try_turn(tour, p + 1, at + 1, slack)
    if turned or at == p + 1:
        return 0.0
    if at > p:
        return try_swap(tour, p + 1, at, at + length_up_to(state, n - at), slack)
    return try_swap(tour, at, at + length_up_to(state, p - at), p + 1, slack)


@kernel
def try_random(tour: Tour, state: NDArray[np.uint64], slack: float) -> float:
    """Mutate the tour: turn a short segment or exchange two adjacent ones; return the change."""
    n = len(tour.order)
    i = below(state, n)
    if below(state, 4) == 0:
        return try_turn(tour, i, i + length_up_to(state, min(n - i, LONGEST_TURN)), slack)
    if i == 0:
        return 0.0
    left = length_up_to(state, i)
    return try_swap(tour, i - left, i, i + length_up_to(state, n - i), slack)


@kernel
def anneal(
    tour: Tour, state: NDArray[np.uint64], temperature: float, proposals: int
) -> tuple[float, int]:
    """Mutate the tour by `proposals` Metropolis steps; return (cost change, steps taken).

    `temperature` is in mm.
    """
    n, width = tour.near.shape[0] // 2, tour.near.shape[1]
    total, taken = 0.0, 0
    for _ in range(proposals):
        slack = -temperature * math.log(uniform(state))
        change = 0.0
        if width == 0 or below(state, 8) == 0:
            change = try_random(tour, state, slack)
        else:
            p = below(state, n)
            c = tour.order[p]
            port = tour.near[2 * c + 1 - tour.flip[c], below(state, width)]
            if port >= 0:
                change = try_follow(tour, p, port, state, slack)
        if change != 0.0:
            total += change
            taken += 1
    return total, taken
