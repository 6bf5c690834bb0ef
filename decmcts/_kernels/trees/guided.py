"""Tree search over clusters that leans on the order of clusters in a good sequence.

Where the paper's rollouts draw the next cluster at random, these take the one
the guide prints first, and stray from it now and then; nodes get children in the
guide's order, more as they are visited more often (progressive widening). What a
rollout finds is improved elsewhere and comes back as the next guide.

References
----------
Coulom 2007, "Computing Elo ratings of move patterns in the game of Go"
(progressive widening); Yoo et al. 2020, Sec. III-A (tree and clusters).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.random import below, uniform
from decmcts._kernels.trees.rollout import READY, Clustered, Rollout, print_cluster, reset
from decmcts._kernels.trees.tree import NO_CLUSTER, NO_NODE, ROOT, Tree, backup, expand, select


@kernel
def cluster_ranks(
    position: NDArray[np.int32], label: NDArray[np.int32], n_clusters: int
) -> NDArray[np.float64]:
    """Return the mean position of each cluster's contours in a sequence, (n_clusters,)."""
    rank, size = np.zeros(n_clusters), np.zeros(n_clusters)
    for c in range(len(label)):
        rank[label[c]] += position[c]
        size[label[c]] += 1.0
    return rank / size


@kernel
def guided_cluster(
    rollout: Rollout,
    rank: NDArray[np.float64],
    tried: NDArray[np.bool_],
    stray: float,
    state: NDArray[np.uint64],
) -> int:
    """Mutate `state`; return the ready cluster of lowest rank, or with chance `stray` any.

    Clusters marked in `tried` are passed over; NO_CLUSTER if that leaves none.
    """
    if uniform(state) < stray:
        h = rollout.ready[below(state, rollout.tally[READY])]
        if not tried[h]:
            return int(h)
    found = NO_CLUSTER
    for k in range(rollout.tally[READY]):
        h = rollout.ready[k]
        if not tried[h] and (found == NO_CLUSTER or rank[h] < rank[found]):
            found = h
    return int(found)


@kernel
def widen(
    tree: Tree,
    node: int,
    rollout: Rollout,
    rank: NDArray[np.float64],
    tried: NDArray[np.bool_],
    stray: float,
    state: NDArray[np.uint64],
) -> int:
    """Mutate the tree and `state`: add the guide's next child of `node`; return it."""
    child = tree.first_child[node]
    while child != NO_NODE:
        tried[tree.cluster[child]] = True
        child = tree.sibling[child]
    h = guided_cluster(rollout, rank, tried, stray, state)
    child = tree.first_child[node]
    while child != NO_NODE:
        tried[tree.cluster[child]] = False
        child = tree.sibling[child]
    return expand(tree, node, h)


@kernel
def guided_rollout(
    tree: Tree,
    clustered: Clustered,
    rollout: Rollout,
    rank: NDArray[np.float64],
    tried: NDArray[np.bool_],
    stray: float,
    exploration: float,
    reference: float,
    state: NDArray[np.uint64],
) -> None:
    """Mutate the tree by one iteration; `rollout` then holds its complete sequence.

    The reward is reference / T for the travel T, at most 1. `tried` is all False.
    """
    reset(clustered, rollout)
    node = ROOT
    while rollout.tally[READY] > 0:
        children = tree.n_children[node]
        wanted = min(rollout.tally[READY], 1 + int(math.sqrt(tree.visits[node])))
        if children < wanted:
            break
        node = select(tree, node, exploration)
        print_cluster(clustered, rollout, tree.cluster[node])
    if rollout.tally[READY] > 0 and tree.size[0] < len(tree.parent):
        node = widen(tree, node, rollout, rank, tried, stray, state)
        print_cluster(clustered, rollout, tree.cluster[node])
    while rollout.tally[READY] > 0:
        h = guided_cluster(rollout, rank, tried, stray, state)
        print_cluster(clustered, rollout, h)
    travel = rollout.travel[0]
    backup(tree, node, min(1.0, reference / travel) if travel > 0.0 else 1.0)


@kernel
def explore(
    tree: Tree,
    clustered: Clustered,
    rollout: Rollout,
    rank: NDArray[np.float64],
    stray: float,
    exploration: float,
    reference: float,
    iterations: int,
    state: NDArray[np.uint64],
    order: NDArray[np.int32],
    is_reversed: NDArray[np.uint8],
    best: float,
) -> float:
    """Mutate the tree by `iterations`; leave the best in `order`, `is_reversed`; return its T.

    Sequences no better than `best` are not kept.
    """
    tried = np.zeros(len(rank), np.bool_)
    for _ in range(iterations):
        guided_rollout(tree, clustered, rollout, rank, tried, stray, exploration, reference, state)
        if rollout.travel[0] < best:
            best = rollout.travel[0]
            order[:] = rollout.order
            is_reversed[:] = rollout.reversed
    return best
