"""Simulated annealing of bare sequences: a cost matrix and precedence, nothing else.

Nodes have no direction and no entries, so a proposal costs six looks at the
matrix, and precedence is asked only of those that the Metropolis rule would take.
Three kinds of proposal, by `Shares`: a near node is made to follow a random one, by
exchange of two adjacent segments; the segment between the two is reversed; and two
adjacent segments of log-uniform lengths change places, wherever they lie.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.random_kernels import below, length_up_to, uniform
from decmcts.search.sequence.moves_kernels import edge_inside, edge_leads, exchange, reverse

LONGEST_REVERSAL = 50  # nodes; in longer segments some edge lies nearly always
REACH = 1.0  # temperatures by which a new step may cost more than the one it replaces


class Shares(NamedTuple):
    """Which proposals are drawn how often; what is left are exchanges anywhere."""

    follow: float
    reverse: float


class Bare(NamedTuple):
    """A sequence of nodes and all that moves on it need, as arrays; node 0 first, n − 1 last."""

    costs: Floats  # (n, n) from row to column
    near: Int32s  # (n, k) nodes that may directly follow, -1 padded
    pred_offsets: Ints  # (n + 1,)
    preds: Int32s  # (m,)
    succ_offsets: Ints  # (n + 1,)
    succs: Int32s  # (m,)
    order: Int32s  # (n,)
    position: Int32s  # (n,) inverse of order
    scratch: Int32s  # (n,)


@kernel
def anneal_bare(
    bare: Bare,
    shares: Shares,
    state: NDArray[np.uint64],
    temperature: float,
    proposals: int,
    first: int,
    last: int,
) -> float:
    """Mutate sequence and `state` by `proposals` Metropolis steps; return the cost change.

    Only nodes between the positions `first` and `last` are moved.
    """
    costs, near, order, position = bare.costs, bare.near, bare.order, bare.position
    succ_offsets, succs, scratch = bare.succ_offsets, bare.succs, bare.scratch
    pred_offsets, preds = bare.pred_offsets, bare.preds
    total, longest = 0.0, math.log(last - first + 1.0)
    if last - first < 3:
        return 0.0
    for _ in range(proposals):
        kind = uniform(state)
        if kind < shares.reverse:
            p = first + below(state, last - first)
            d = near[order[p], below(state, near.shape[1])]
            if d < 0:
                continue
            i, k = p + 1, position[d] + 1
            if k < i + 2 or k > i + LONGEST_REVERSAL or k > last:
                continue
            change = _reversal_change(costs, order, i, k, -temperature * math.log(uniform(state)))
            if change == math.inf or edge_inside(order, position, succ_offsets, succs, i, k):
                continue
            reverse(order, position, i, k)
            total += change
            continue
        kind -= shares.reverse
        if kind < shares.follow:
            i, j, k = _follow(costs, near, order, position, first, last, REACH * temperature, state)
        else:
            j = first + 1 + below(state, last - first)
            i = j - int(math.exp(uniform(state) * longest))
            k = j + int(math.exp(uniform(state) * longest))
        if i <= first or j <= i or k <= j or k > last:
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
    costs: Floats,
    near: Int32s,
    order: Int32s,
    position: Int32s,
    first: int,
    last: int,
    reach: float,
    state: NDArray[np.uint64],
) -> tuple[int, int, int]:
    """Mutate `state`; return an exchange that lets a near node follow a random one.

    It is of [i, j) and [j, k). The third cut is drawn, or lies where what the exchange
    leaves alone finds a near node too. (0, 0, 0) for none.
    """
    p = first + below(state, last - first)
    c = order[p]
    d = near[c, below(state, near.shape[1])]
    if d < 0:
        return 0, 0, 0
    at = position[d]
    if at == p + 1 or at <= first or at > last or costs[c, d] - costs[c, order[p + 1]] > reach:
        return 0, 0, 0
    draw = uniform(state)
    if at > p and draw < 0.25:
        return p + 1 - length_up_to(state, p - first), p + 1, at
    if draw < 0.6:
        if at > p:
            return p + 1, at, at + length_up_to(state, last - at)
        return at, at + length_up_to(state, p - at), p + 1
    other = near[order[at - 1], below(state, near.shape[1])]
    if other < 0:
        return 0, 0, 0
    if at > p:
        return p + 1, at, position[other]
    return at, position[other], p + 1


@kernel
def _exchange_change(costs: Floats, order: Int32s, i: int, j: int, k: int) -> float:
    """Return the cost change of exchanging [i, j) and [j, k), neither at an end. O(1)."""
    before, first, middle, right = order[i - 1], order[i], order[j - 1], order[j]
    last, beyond = order[k - 1], order[k]
    added = costs[before, right] + costs[last, first] + costs[middle, beyond]
    return float(added - costs[before, first] - costs[middle, right] - costs[last, beyond])


@kernel
def _reversal_change(costs: Floats, order: Int32s, i: int, k: int, slack: float) -> float:
    """Return the cost change of reversing [i, k), inf if that is above `slack`. O(k - i)."""
    before, first, last, beyond = order[i - 1], order[i], order[k - 1], order[k]
    change = costs[before, last] + costs[first, beyond] - costs[before, first] - costs[last, beyond]
    if change > slack:
        return math.inf
    for p in range(i, k - 1):
        change += costs[order[p + 1], order[p]] - costs[order[p], order[p + 1]]
    return float(change) if change <= slack else math.inf
