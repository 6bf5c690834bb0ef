"""Monte Carlo tree search over clusters, the tree a struct of arrays.

A node is the print after one more cluster; what is printed by then is replayed from the root,
which costs no more than the rollout itself. A rollout is a random feasible order of clusters,
each printed greedily: the next contour is the nearest feasible one from where the nozzle stands.
(The paper asks for nothing better there: clusters are those subgraphs "in which optimization of
the toolpath beyond a layer-by-layer solution is not needed".) One iteration is select, expand,
roll out, back up; there is no object per node.

References
----------
Yoo et al. 2020, Sec. III-A (rollouts, Eq. 3) and III-B (clusters); Browne et al. 2012, "A Survey
of Monte Carlo Tree Search Methods", Alg. 2; Auer et al. 2002 (UCB1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.random_kernels import below, uniform
from decmcts.search.sequence.greedy_kernels import nearest_ready
from decmcts.search.sequence.metric_kernels import Metric, distance

ROOT = 0
NO_NODE = -1
NO_CLUSTER = -1
NOWHERE = -1  # the nozzle before the first contour: any start is free
PRINTED, READY, PORT = range(3)  # of `Rollout.tally`


class Clustered(NamedTuple):
    """A print and its clusters; the cluster graph has no cycle."""

    metric: Metric
    reversible: Flags  # (n,)
    pred_offsets: Ints  # (n + 1,)
    succ_offsets: Ints  # (n + 1,)
    succs: Int32s  # (m,)
    label: Int32s  # (n,) cluster of each contour
    member_offsets: Ints  # (h + 1,)
    members: Int32s  # (n,) contours by cluster
    outer_preds: Int32s  # (h,) edges into each cluster from others


class Rollout(NamedTuple):
    """The print as far as one rollout has come; all arrays are mutated by it."""

    order: Int32s  # (n,)
    reversed: NDArray[np.uint8]  # (n,) by contour
    waiting: Int32s  # (n,) predecessors not yet printed
    outer: Int32s  # (h,) edges into each cluster not yet satisfied
    ready: Int32s  # (h,) clusters that may be next, the first tally[READY]
    local: Int32s  # (n,) contours of the open cluster that may be next
    tally: Ints  # (3,) contours PRINTED, clusters READY, PORT the nozzle is at
    travel: Floats  # (1,) in the metric's unit


@kernel
def reset(clustered: Clustered, rollout: Rollout) -> None:
    """Mutate the rollout: nothing is printed yet."""
    n_ready = 0
    for c in range(len(rollout.waiting)):
        rollout.waiting[c] = clustered.pred_offsets[c + 1] - clustered.pred_offsets[c]
    for h in range(len(rollout.outer)):
        rollout.outer[h] = clustered.outer_preds[h]
        if rollout.outer[h] == 0:
            rollout.ready[n_ready] = h
            n_ready += 1
    rollout.tally[PRINTED], rollout.tally[READY], rollout.tally[PORT] = 0, n_ready, NOWHERE
    rollout.travel[0] = 0.0


@kernel
def _release(clustered: Clustered, rollout: Rollout, c: int, n_local: int) -> int:
    """Mutate the rollout for the printing of c; return how many of its cluster may be next."""
    h = clustered.label[c]
    for e in range(clustered.succ_offsets[c], clustered.succ_offsets[c + 1]):
        b = clustered.succs[e]
        g = clustered.label[b]
        rollout.waiting[b] -= 1
        if g != h:
            rollout.outer[g] -= 1
            if rollout.outer[g] == 0:
                rollout.ready[rollout.tally[READY]] = g
                rollout.tally[READY] += 1
        elif rollout.waiting[b] == 0:
            rollout.local[n_local] = b
            n_local += 1
    return n_local


@kernel
def nearest_cluster(clustered: Clustered, rollout: Rollout) -> int:
    """Return the ready cluster with the contour nearest to the nozzle, which stands somewhere."""
    metric, reversible, at = clustered.metric, clustered.reversible, rollout.tally[PORT]
    found, shortest = rollout.ready[0], np.inf
    for k in range(rollout.tally[READY]):
        h = rollout.ready[k]
        for x in range(clustered.member_offsets[h], clustered.member_offsets[h + 1]):
            c = clustered.members[x]
            if rollout.waiting[c] > 0:
                continue
            for f in range(2 if reversible[c] else 1):
                d = distance(metric, at, 2 * c + f)
                if d < shortest or (d == shortest and h < found):
                    found, shortest = h, d
    return int(found)


@kernel
def print_cluster(clustered: Clustered, rollout: Rollout, h: int) -> None:
    """Mutate the rollout: print cluster h, which must be ready, nearest feasible first."""
    metric, reversible, local = clustered.metric, clustered.reversible, rollout.local
    no_key, slot = np.empty(0), 0
    while rollout.ready[slot] != h:
        slot += 1
    rollout.tally[READY] -= 1
    rollout.ready[slot] = rollout.ready[rollout.tally[READY]]
    n_local = 0
    for x in range(clustered.member_offsets[h], clustered.member_offsets[h + 1]):
        if rollout.waiting[clustered.members[x]] == 0:
            local[n_local] = clustered.members[x]
            n_local += 1
    while n_local > 0:
        at = rollout.tally[PORT]
        slot, f, d = nearest_ready(metric, reversible, local, n_local, at, no_key, np.inf)
        c = local[slot]
        local[slot] = local[n_local - 1]
        n_local = _release(clustered, rollout, c, n_local - 1)
        rollout.order[rollout.tally[PRINTED]], rollout.reversed[c] = c, f
        rollout.tally[PRINTED] += 1
        rollout.tally[PORT] = 2 * c + 1 - f
        rollout.travel[0] += d


class ClusterTree(NamedTuple):
    """Nodes 0..size - 1 of `capacity`; children of a node are a linked list."""

    parent: Int32s  # (capacity,) NO_NODE at the root
    cluster: Int32s  # (capacity,) printed last; NO_CLUSTER at the root
    first_child: Int32s  # (capacity,)
    sibling: Int32s  # (capacity,) next child of the same parent
    n_children: Int32s  # (capacity,)
    visits: Ints  # (capacity,)
    reward: Floats  # (capacity,) sum over visits, each in 0..1
    size: Ints  # (1,)


def new_tree(capacity: int) -> ClusterTree:
    """Return a tree of one node, the root; memory is taken as nodes are added."""
    parent, cluster, first_child, sibling = np.empty((4, capacity), np.int32)
    parent[ROOT] = cluster[ROOT] = first_child[ROOT] = NO_NODE
    return ClusterTree(
        parent, cluster, first_child, sibling, np.zeros(capacity, np.int32),
        np.zeros(capacity, np.int64), np.zeros(capacity), np.ones(1, np.int64),
    )  # fmt: skip


@kernel
def select(tree: ClusterTree, node: int, exploration: float) -> int:
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
def expand(tree: ClusterTree, node: int, cluster: int) -> int:
    """Mutate the tree: add the child of `node` that prints `cluster`; return it."""
    child = tree.size[0]
    tree.size[0] += 1
    tree.parent[child] = node
    tree.cluster[child] = cluster
    tree.first_child[child] = NO_NODE
    tree.sibling[child] = tree.first_child[node]
    tree.first_child[node] = child
    tree.n_children[node] += 1
    return int(child)


@kernel
def backup(tree: ClusterTree, node: int, reward: float) -> None:
    """Mutate the tree: count `reward` for `node` and all its ancestors."""
    while node != NO_NODE:
        tree.visits[node] += 1
        tree.reward[node] += reward
        node = tree.parent[node]


@kernel
def untried(
    tree: ClusterTree,
    node: int,
    rollout: Rollout,
    tried: Flags,
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
    tree: ClusterTree,
    clustered: Clustered,
    rollout: Rollout,
    tried: Flags,
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
    tree: ClusterTree,
    clustered: Clustered,
    rollout: Rollout,
    tried: Flags,
    state: NDArray[np.uint64],
    exploration: float,
    longest: float,
    nearest: float,
    iterations: int,
    order: Int32s,
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
