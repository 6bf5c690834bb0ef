"""Simulated annealing of bare sequences: a cost matrix and precedence, nothing else.

Nodes have no direction and no entries, so a proposal costs six looks at the
matrix, and precedence is asked only of those that the Metropolis rule would take.
Four kinds of proposal, by `Shares`: a near node is made to follow a random one,
by exchange of two adjacent segments; the segment between the two is reversed; two
adjacent segments between steps that are hops change places; and so do two of
log-uniform lengths, wherever they lie.
A hop is a step longer than those to near nodes: on a print, to another part.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.random import below, uniform
from decmcts._kernels.sequence.moves import edge_inside, edge_leads, exchange, reverse

LONGEST_REVERSAL = 50  # nodes; in longer segments some edge lies nearly always
HOPS_STAY = 4  # proposals a node after which hops are looked for again
REACH = 1.0  # temperatures by which a new step may cost more than the one it replaces


class Shares(NamedTuple):
    """Which proposals are drawn how often; what is left are exchanges anywhere."""

    follow: float
    reverse: float
    hop: float


class Bare(NamedTuple):
    """A sequence of nodes and all that moves on it need, as arrays; node 0 first, n − 1 last."""

    costs: NDArray[np.float64]  # (n, n) from row to column
    near: NDArray[np.int32]  # (n, k) nodes that may directly follow, -1 padded
    hop_cost: NDArray[np.float64]  # (n,) a step from a node that costs more is a hop
    pred_offsets: NDArray[np.int64]  # (n + 1,)
    preds: NDArray[np.int32]  # (m,)
    succ_offsets: NDArray[np.int64]  # (n + 1,)
    succs: NDArray[np.int32]  # (m,)
    order: NDArray[np.int32]  # (n,)
    position: NDArray[np.int32]  # (n,) inverse of order
    scratch: NDArray[np.int32]  # (n,)
    hops: NDArray[np.int32]  # (n,) scratch: the positions after hops


@kernel
def anneal_bare(
    bare: Bare, shares: Shares, state: NDArray[np.uint64], temperature: float, proposals: int
) -> float:
    """Mutate sequence and `state` by `proposals` Metropolis steps; return the cost change.

    The first node and the last one stay where they are.
    """
    costs, near, order, position = bare.costs, bare.near, bare.order, bare.position
    succ_offsets, succs, scratch = bare.succ_offsets, bare.succs, bare.scratch
    pred_offsets, preds = bare.pred_offsets, bare.preds
    n, total, longest = len(order), 0.0, math.log(len(order) + 1.0)
    if n < 4:
        return 0.0
    hops, count = bare.hops, 0
    for proposal in range(proposals):
        if proposal % (HOPS_STAY * n) == 0 and shares.hop > 0.0:
            count = _find_hops(costs, bare.hop_cost, order, hops)
        kind = uniform(state)
        if kind < shares.reverse:
            p = below(state, n - 1)
            d = near[order[p], below(state, near.shape[1])]
            if d < 0:
                continue
            i, k = p + 1, position[d] + 1
            if k < i + 2 or k > i + LONGEST_REVERSAL or k == n:
                continue
            change = _reversal_change(costs, order, i, k, -temperature * math.log(uniform(state)))
            if change == math.inf or edge_inside(order, position, succ_offsets, succs, i, k):
                continue
            reverse(order, position, i, k)
            total += change
            continue
        kind -= shares.reverse
        if kind < shares.follow:
            i, j, k = _follow(costs, near, order, position, REACH * temperature, state)
        elif kind < shares.follow + shares.hop:
            i, j, k = _between_hops(hops, count, n, state)
        else:
            j = 1 + below(state, n - 1)
            i = j - int(math.exp(uniform(state) * longest))
            k = j + int(math.exp(uniform(state) * longest))
        if i < 1 or j <= i or k <= j or k > n - 1:
            continue
        change = _exchange_change(costs, order, i, j, k)
        if change > 0.0 and change > -temperature * math.log(uniform(state)):
            continue
        if edge_leads(order, position, pred_offsets, preds, succ_offsets, succs, i, j, k):
            continue
        exchange(order, position, scratch, i, j, k)
        total += change
    return total


@kernel
def _follow(
    costs: NDArray[np.float64],
    near: NDArray[np.int32],
    order: NDArray[np.int32],
    position: NDArray[np.int32],
    reach: float,
    state: NDArray[np.uint64],
) -> tuple[int, int, int]:
    """Mutate `state`; return an exchange that lets a near node follow a random one.

    It is of [i, j) and [j, k). The third cut is drawn, or lies where what the exchange
    leaves alone finds a near node too. (0, 0, 0) for none.
    """
    n = len(order)
    p = below(state, n - 1)
    c = order[p]
    d = near[c, below(state, near.shape[1])]
    if d < 0:
        return 0, 0, 0
    at = position[d]
    if at == p + 1 or at == 0 or costs[c, d] - costs[c, order[p + 1]] > reach:
        return 0, 0, 0
    draw = uniform(state)
    if at > p and draw < 0.25:
        return p + 1 - _length(p + 1, state), p + 1, at
    if draw < 0.6:
        if at > p:
            return p + 1, at, at + _length(n - at, state)
        return at, at + _length(p - at, state), p + 1
    other = near[order[at - 1], below(state, near.shape[1])]
    if other < 0:
        return 0, 0, 0
    if at > p:
        return p + 1, at, position[other]
    return at, position[other], p + 1


@kernel
def _find_hops(
    costs: NDArray[np.float64],
    hop_cost: NDArray[np.float64],
    order: NDArray[np.int32],
    hops: NDArray[np.int32],
) -> int:
    """Fill in the positions that are reached by a hop, in rising order; return how many. O(n)."""
    count = 0
    for p in range(1, len(order) - 1):
        if costs[order[p - 1], order[p]] > hop_cost[order[p - 1]]:
            hops[count] = p
            count += 1
    return count


@kernel
def _between_hops(
    hops: NDArray[np.int32], count: int, n: int, state: NDArray[np.uint64]
) -> tuple[int, int, int]:
    """Mutate `state`; return an exchange with cuts at two hops, (0, 0, 0) for none.

    The third cut lies before the two, beyond them, at a third hop or between them.
    """
    if count < 2:
        return 0, 0, 0
    a = below(state, count - 1)
    b = a + _length(count - 1 - a, state)
    first, second = hops[a], hops[b]
    draw = uniform(state)
    if draw < 0.3:
        return first - _length(first - 1, state), first, second
    if draw < 0.6:
        return first, second, second + _length(n - second, state)
    if draw < 0.8 and b + 1 < count:
        return first, second, hops[b + 1 + below(state, count - b - 1)]
    return first, first + 1 + below(state, max(second - first - 1, 1)), second


@kernel
def _length(longest: int, state: NDArray[np.uint64]) -> int:
    """Mutate `state`; return a log-uniform length in 1..longest, 0 if that is 0."""
    return min(longest, int(math.exp(uniform(state) * math.log(longest + 1.0))))


@kernel
def _exchange_change(
    costs: NDArray[np.float64], order: NDArray[np.int32], i: int, j: int, k: int
) -> float:
    """Return the cost change of exchanging [i, j) and [j, k), neither at an end. O(1)."""
    before, first, middle, right = order[i - 1], order[i], order[j - 1], order[j]
    last, beyond = order[k - 1], order[k]
    added = costs[before, right] + costs[last, first] + costs[middle, beyond]
    return float(added - costs[before, first] - costs[middle, right] - costs[last, beyond])


@kernel
def _reversal_change(
    costs: NDArray[np.float64], order: NDArray[np.int32], i: int, k: int, slack: float
) -> float:
    """Return the cost change of reversing [i, k), inf if that is above `slack`. O(k - i)."""
    before, first, last, beyond = order[i - 1], order[i], order[k - 1], order[k]
    change = costs[before, last] + costs[first, beyond] - costs[before, first] - costs[last, beyond]
    if change > slack:
        return math.inf
    for p in range(i, k - 1):
        change += costs[order[p + 1], order[p]] - costs[order[p], order[p + 1]]
    return float(change) if change <= slack else math.inf
