"""The loops of Alg. 1 on plain arrays: depths, connectedness, merging without cycles.

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


@kernel
def root_of(parent: Int32s, i: int) -> int:
    """Return the representative of i's set, halving the path on the way."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def count_marked(neighbours: Neighbours, j: int, mark: Int32s, i: int) -> int:
    """Count the neighbours of j that carry the mark i."""
    common = 0
    for e in range(neighbours[0][j], neighbours[0][j + 1]):
        common += mark[neighbours[1][e]] == i
    return common


@kernel
def mean_of_terms(
    common_dependees: float, most_dependees: float, common_dependers: float, most_dependers: float
) -> float:
    """Return gamma from the sizes of the common sets and of the larger single sets.

    A side on which neither has anyone says nothing and is left out of the mean.
    """
    if most_dependees == 0 and most_dependers == 0:
        return 1.0
    if most_dependees == 0:
        return common_dependers / most_dependers
    if most_dependers == 0:
        return common_dependees / most_dependees
    return (common_dependees / most_dependees + common_dependers / most_dependers) / 2


@kernel
def mark_neighbours(neighbours: Neighbours, i: int, mark: Int32s) -> None:
    """Put the mark i on the neighbours of i."""
    for e in range(neighbours[0][i], neighbours[0][i + 1]):
        mark[neighbours[1][e]] = i


@kernel
def connectedness(
    preds: Neighbours,
    succs: Neighbours,
    i: int,
    j: int,
    dependee_of: Int32s,
    depender_of: Int32s,
) -> float:
    """Return gamma_ij; the two arrays carry the mark i on i's dependees and dependers."""
    dependees = max(preds[0][i + 1] - preds[0][i], preds[0][j + 1] - preds[0][j])
    dependers = max(succs[0][i + 1] - succs[0][i], succs[0][j + 1] - succs[0][j])
    return mean_of_terms(
        count_marked(preds, j, dependee_of, i),
        dependees,
        count_marked(succs, j, depender_of, i),
        dependers,
    )


@kernel
def siblings(
    through: Neighbours,
    back: Neighbours,
    i: int,
    depth: Int32s,
    seen: Int32s,
    found: Int32s,
    count: int,
) -> int:
    """Add to `found` the j < i of i's depth that share a neighbour of `through`.

    `back` holds the same edges from the other side. Marks them in `seen`; returns
    the new number found.
    """
    for e in range(through[0][i], through[0][i + 1]):
        shared = through[1][e]
        for f in range(back[0][shared], back[0][shared + 1]):
            j = back[1][f]
            if j >= i:
                break
            if depth[j] == depth[i] and seen[j] != i:
                seen[j] = i
                found[count] = j
                count += 1
    return count


@kernel
def cluster_depths(preds: Neighbours, succs: Neighbours, depth: Int32s, threshold: float) -> Int32s:
    """Return a representative for each node: highly connected nodes of a depth share one."""
    n = len(depth)
    parent = np.arange(n).astype(np.int32)
    dependee_of = np.full(n, NONE, np.int32)
    depender_of = np.full(n, NONE, np.int32)
    seen = np.full(n, NONE, np.int32)
    found = np.empty(n, np.int32)
    for i in range(n):
        mark_neighbours(preds, i, dependee_of)
        mark_neighbours(succs, i, depender_of)
        count = siblings(preds, succs, i, depth, seen, found, 0)
        count = siblings(succs, preds, i, depth, seen, found, count)
        for j in found[:count]:
            mine, other = root_of(parent, i), root_of(parent, j)
            if mine == other:
                continue
            if connectedness(preds, succs, i, j, dependee_of, depender_of) >= threshold:
                parent[other] = mine
    for i in range(n):
        parent[i] = root_of(parent, i)
    return parent


@kernel
def edge_gammas(preds: Neighbours, ancestors: Ints, descendants: Ints) -> Floats:
    """Return gamma of each edge (u, v) from all dependees and dependers but the pair itself.

    v has all of u's dependees and u all of v's dependers, so the common sets are
    u's dependees and v's dependers.
    """
    gammas = np.empty(len(preds[1]))
    for v in range(len(ancestors)):
        for e in range(preds[0][v], preds[0][v + 1]):
            u = preds[1][e]
            gammas[e] = mean_of_terms(
                ancestors[u], ancestors[v] - 1, descendants[v], descendants[u] - 1
            )
    return gammas


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
