"""Monte Carlo tree search over clusters, the tree a struct of arrays.

A node is the print after one more cluster; what is printed by then is replayed
from the root, which costs no more than the rollout itself. One iteration is
select, expand, roll out, back up; there is no object per node.

References
----------
Yoo et al. 2020, Sec. III-A; Browne et al. 2012, "A Survey of Monte Carlo Tree
Search Methods", Alg. 2; Auer et al. 2002 (UCB1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.random import below, uniform
from decmcts._kernels.trees.rollout import (
    NOWHERE,
    PORT,
    READY,
    Clustered,
    Rollout,
    nearest_cluster,
    print_cluster,
    reset,
)

ROOT = 0
NO_NODE = -1
NO_CLUSTER = -1


class Tree(NamedTuple):
    """Nodes 0..size - 1 of `capacity`; children of a node are a linked list."""

    parent: NDArray[np.int32]  # (capacity,) NO_NODE at the root
    cluster: NDArray[np.int32]  # (capacity,) printed last; NO_CLUSTER at the root
    first_child: NDArray[np.int32]  # (capacity,)
    sibling: NDArray[np.int32]  # (capacity,) next child of the same parent
    n_children: NDArray[np.int32]  # (capacity,)
    visits: NDArray[np.int64]  # (capacity,)
    reward: NDArray[np.float64]  # (capacity,) sum over visits, each in 0..1
    size: NDArray[np.int64]  # (1,)


def new_tree(capacity: int) -> Tree:
    """Return a tree of one node, the root."""
    empty = np.full((5, capacity), NO_NODE, np.int32)
    empty[4] = 0
    visits, reward = np.zeros(capacity, np.int64), np.zeros(capacity)
    return Tree(
        empty[0].copy(),
        empty[1].copy(),
        empty[2].copy(),
        empty[3].copy(),
        empty[4].copy(),
        visits,
        reward,
        np.ones(1, np.int64),
    )


def with_room(tree: Tree, more: int, most: int) -> Tree:
    """Return a tree with room for so many `more` nodes: itself, or a larger copy.

    It never gets larger than `most` nodes; a full one goes on without growing.
    """
    size, capacity = int(tree.size[0]), len(tree.parent)
    if capacity >= most or size + more <= capacity:
        return tree
    larger = new_tree(min(2 * capacity + more, most))
    for name in Tree._fields[:-1]:
        getattr(larger, name)[:size] = getattr(tree, name)[:size]
    larger.size[0] = size
    return larger


@kernel
def select(tree: Tree, node: int, exploration: float) -> int:
    """Return the child with the highest upper confidence bound (UCB1); first wins ties."""
    log_visits = math.log(tree.visits[node])
    best, highest = NO_NODE, -np.inf
    child = tree.first_child[node]
    while child != NO_NODE:
        visits = tree.visits[child]
        bound = tree.reward[child] / visits + exploration * math.sqrt(log_visits / visits)
        if bound > highest:
            best, highest = child, bound
        child = tree.sibling[child]
    return best


@kernel
def expand(tree: Tree, node: int, cluster: int) -> int:
    """Mutate the tree: add the child of `node` that prints `cluster`; return it."""
    child = tree.size[0]
    tree.size[0] += 1
    tree.parent[child] = node
    tree.cluster[child] = cluster
    tree.sibling[child] = tree.first_child[node]
    tree.first_child[node] = child
    tree.n_children[node] += 1
    return int(child)


@kernel
def backup(tree: Tree, node: int, reward: float) -> None:
    """Mutate the tree: count `reward` for `node` and all its ancestors."""
    while node != NO_NODE:
        tree.visits[node] += 1
        tree.reward[node] += reward
        node = tree.parent[node]


@kernel
def untried(
    tree: Tree,
    node: int,
    rollout: Rollout,
    tried: NDArray[np.bool_],
    state: NDArray[np.uint64],
) -> int:
    """Mutate `state`; return a random ready cluster that is no child of `node` yet."""
    child = tree.first_child[node]
    while child != NO_NODE:
        tried[tree.cluster[child]] = True
        child = tree.sibling[child]
    left = below(state, rollout.tally[READY] - tree.n_children[node])
    found = NO_CLUSTER
    for k in range(rollout.tally[READY]):
        h = rollout.ready[k]
        if tried[h]:
            tried[h] = False
        elif left == 0:
            found, left = h, left - 1
        else:
            left -= 1
    return found


@kernel
def simulate(
    tree: Tree,
    clustered: Clustered,
    rollout: Rollout,
    tried: NDArray[np.bool_],
    state: NDArray[np.uint64],
    exploration: float,
    longest: float,
    nearest: float,
) -> None:
    """Mutate the tree by one iteration; `rollout` then holds its complete sequence.

    The reward is (longest - T) / longest for the travel T of the sequence. With chance `nearest`
    a rollout goes on with the nearest cluster instead of a random one.
    """
    reset(clustered, rollout)
    node = ROOT
    while rollout.tally[READY] > 0 and tree.n_children[node] == rollout.tally[READY]:
        node = select(tree, node, exploration)
        print_cluster(clustered, rollout, tree.cluster[node])
    if rollout.tally[READY] > 0 and tree.size[0] < len(tree.parent):
        h = untried(tree, node, rollout, tried, state)
        node = expand(tree, node, h)
        print_cluster(clustered, rollout, h)
    while rollout.tally[READY] > 0:
        stands = rollout.tally[PORT] != NOWHERE
        if nearest > 0.0 and stands and uniform(state) < nearest:
            h = nearest_cluster(clustered, rollout)
        else:
            h = rollout.ready[below(state, rollout.tally[READY])]
        print_cluster(clustered, rollout, h)
    reward = (longest - rollout.travel[0]) / longest if longest > 0.0 else 1.0
    backup(tree, node, reward)


@kernel
def simulate_many(
    tree: Tree,
    clustered: Clustered,
    rollout: Rollout,
    tried: NDArray[np.bool_],
    state: NDArray[np.uint64],
    exploration: float,
    longest: float,
    nearest: float,
    iterations: int,
    order: NDArray[np.int32],
    is_reversed: NDArray[np.uint8],
    best: float,
) -> float:
    """Mutate the tree by `iterations`; leave the best in `order`, `is_reversed`; return its T.

    Sequences no better than `best` are not kept.
    """
    for _ in range(iterations):
        simulate(tree, clustered, rollout, tried, state, exploration, longest, nearest)
        if rollout.travel[0] < best:
            best = rollout.travel[0]
            order[:] = rollout.order
            is_reversed[:] = rollout.reversed
    return best
