"""The loops of Alg. 1 on plain arrays: depths, merging without cycles.

All graphs here are CSR with nodes numbered in a topological order: every
predecessor of a node is smaller than the node. What the numbers mean and which
choices the paper leaves open stands in `decmcts.feasibility.clustering`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel

NONE = -1
SEARCH_LIMIT = 1_000  # links looked at before a merge counts as closing a cycle

Neighbours = tuple[Ints, Int32s]  # offsets (n + 1,), neighbours (m,)


@kernel
def depths(preds: Neighbours) -> Int32s:
    """Return the edges on the longest path from a root to each node."""
    depth = np.zeros(len(preds[0]) - 1, np.int32)
    for b in range(len(depth)):
        for e in range(preds[0][b], preds[0][b + 1]):
            depth[b] = max(depth[b], depth[preds[1][e]] + 1)
    return depth


class Groups(NamedTuple):
    """Groups of nodes as they grow, with the edges between them."""

    of: Int32s  # (n_nodes,) group of each node, NONE until it has one
    deepest: Int32s  # (n_nodes,) depth of each group's last node
    latest: Int32s  # (n_nodes,) newest link into each group
    older: Int32s  # (n_edges,) next older link into the same group
    source: Int32s  # (n_edges,) group the link comes from
    seen: Ints  # (n_nodes,) stamp of the last search that met the group
    used: Ints  # (3,) groups, links, searches


@kernel
def link(groups: Groups, before: int, after: int) -> None:
    """Note that group `before` precedes group `after`, once; in place."""
    at = groups.latest[after]
    while at != NONE:
        if groups.source[at] == before:
            return
        at = groups.older[at]
    at = groups.used[1]
    groups.source[at] = before
    groups.older[at] = groups.latest[after]
    groups.latest[after] = at
    groups.used[1] = at + 1


@kernel
def reaches_back(groups: Groups, target: int, preds: Neighbours, v: int, stack: Int32s) -> bool:
    """Tell whether v depends on group `target` through another group.

    Says yes as well when the search grows beyond SEARCH_LIMIT links: then the
    merge is left to a later round or undone, and no cycle slips through.
    """
    groups.used[2] += 1
    stamp = groups.used[2]
    size = 0
    for e in range(preds[0][v], preds[0][v + 1]):
        group = groups.of[preds[1][e]]
        if group != target and groups.seen[group] != stamp:
            groups.seen[group] = stamp
            stack[size] = group
            size += 1
    steps = 0
    while size > 0:
        size -= 1
        at = groups.latest[stack[size]]
        while at != NONE:
            steps += 1
            before = groups.source[at]
            if before == target or steps > SEARCH_LIMIT:
                return True
            if groups.seen[before] != stamp:
                groups.seen[before] = stamp
                stack[size] = before
                size += 1
            at = groups.older[at]
    return False


@kernel
def choose_group(
    groups: Groups,
    preds: Neighbours,
    v: int,
    first_depth: int,
    gammas: Floats,
    threshold: float,
    stack: Int32s,
) -> int:
    """Return the group of v's best connected dependee that v may join, or NONE."""
    refused = np.inf
    while True:
        best = NONE
        for e in range(preds[0][v], preds[0][v + 1]):
            open_ = threshold < gammas[e] < refused
            if open_ and (best == NONE or gammas[e] > gammas[best]):
                best = e
        if best == NONE:
            return NONE
        for e in range(preds[0][v], preds[0][v + 1]):
            group = groups.of[preds[1][e]]
            if (
                gammas[e] == gammas[best]
                and groups.deepest[group] < first_depth
                and not reaches_back(groups, group, preds, v, stack)
            ):
                return int(group)
        refused = gammas[best]


@kernel
def merge_adjacent(
    preds: Neighbours,
    first_depth: Int32s,
    last_depth: Int32s,
    gammas: Floats,
    threshold: float,
) -> Int32s:
    """Return the group of each node after one sweep of merging along edges, ids from 0."""
    n = len(first_depth)
    m = len(preds[1])
    none = np.full(n, NONE, np.int32)
    groups = Groups(
        none,
        np.zeros(n, np.int32),
        none.copy(),
        np.empty(m, np.int32),
        np.empty(m, np.int32),
        np.zeros(n, np.int64),
        np.zeros(3, np.int64),
    )
    stack = np.empty(n, np.int32)
    for v in range(n):
        group = choose_group(groups, preds, v, first_depth[v], gammas, threshold, stack)
        if group == NONE:
            group = groups.used[0]
            groups.used[0] += 1
        groups.of[v] = group
        groups.deepest[group] = last_depth[v]
        for e in range(preds[0][v], preds[0][v + 1]):
            if groups.of[preds[1][e]] != group:
                link(groups, groups.of[preds[1][e]], group)
    return groups.of


@kernel
def topological_ranks(succs: Neighbours, waiting: Ints) -> Int32s:
    """Return each node's place in a topological order, NONE for nodes on or behind a cycle.

    `waiting` counts each node's predecessors and is used up.
    """
    n = len(waiting)
    rank = np.full(n, NONE, np.int32)
    queue = np.empty(n, np.int32)
    size = 0
    for a in range(n):
        if waiting[a] == 0:
            queue[size] = a
            size += 1
    done = 0
    while done < size:
        a = queue[done]
        rank[a] = done
        done += 1
        for e in range(succs[0][a], succs[0][a + 1]):
            waiting[succs[1][e]] -= 1
            if waiting[succs[1][e]] == 0:
                queue[size] = succs[1][e]
                size += 1
    return rank
