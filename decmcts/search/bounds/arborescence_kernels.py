"""The cheapest arborescence: Edmonds' algorithm with mergeable heaps, on bare arrays.

Arcs are given by head, in one run per node; nodes are 0..n-1 and the root is n.
Every node may also hang from the root directly, at its price in `escape` (infinite:
it may not); such an arc has the number m + node. O(m log n).

References
----------
Tarjan 1977, "Finding optimum branchings"; Gabow, Galil, Spencer & Tarjan 1986.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.compiled import kernel

NONE = -1


class Heaps(NamedTuple):
    """Skew heaps of arcs; what is owed to all below an arc is kept at it."""

    key: Floats  # (m + n,) weight, after all that was subtracted above
    owed: Floats  # (m + n,) still to be added to the children
    left: Ints  # (m + n,)
    right: Ints  # (m + n,)


class DisjointSets(NamedTuple):
    """Contracted nodes: union by size with a history, so that joins can be undone."""

    parent: Ints  # (n + 1,) NONE at a group's representative
    size: Ints  # (n + 1,)
    joined: Ints  # (n + 1,) representatives that were joined, oldest first
    used: Ints  # (1,) length of `joined`


class Cycles(NamedTuple):
    """The contracted cycles, oldest first."""

    group: Ints  # (n,) representative after the contraction
    joins: Ints  # (n,) length of `DisjointSets.joined` before it
    first: Ints  # (n + 1,) where its arcs begin in `arcs`
    arcs: Ints  # (2n,)
    used: Ints  # (1,)


@kernel
def settle(heaps: Heaps, a: int) -> None:
    """Mutate `heaps`: hand what a owes to its children."""
    owed = heaps.owed[a]
    if owed != 0.0:
        for child in (heaps.left[a], heaps.right[a]):
            if child != NONE:
                heaps.key[child] += owed
                heaps.owed[child] += owed
        heaps.owed[a] = 0.0


@kernel
def meld(heaps: Heaps, a: int, b: int) -> int:
    """Mutate `heaps`: join two heaps and return the top."""
    if a == NONE or b == NONE:
        return b if a == NONE else a
    if heaps.key[a] > heaps.key[b]:
        a, b = b, a
    top = a
    settle(heaps, a)
    while True:
        rest = heaps.right[a]
        heaps.right[a] = heaps.left[a]
        if rest == NONE:
            heaps.left[a] = b
            return top
        if heaps.key[rest] > heaps.key[b]:
            rest, b = b, rest
        settle(heaps, rest)
        heaps.left[a] = rest
        a = rest


@kernel
def pop(heaps: Heaps, a: int) -> int:
    """Mutate `heaps`: remove the top a and return the new one."""
    settle(heaps, a)
    return meld(heaps, heaps.left[a], heaps.right[a])


@kernel
def find(groups: DisjointSets, node: int) -> int:
    """Return the representative of the group of a node."""
    while groups.parent[node] != NONE:
        node = groups.parent[node]
    return node


@kernel
def join(groups: DisjointSets, one: int, other: int) -> bool:
    """Mutate `groups`: join two groups; returns whether they were two."""
    one, other = find(groups, one), find(groups, other)
    if one == other:
        return False
    if groups.size[one] < groups.size[other]:
        one, other = other, one
    groups.parent[other] = one
    groups.size[one] += groups.size[other]
    groups.joined[groups.used[0]] = other
    groups.used[0] += 1
    return True


@kernel
def undo_joins(groups: DisjointSets, joins: int) -> None:
    """Mutate `groups`: undo all joins but the first `joins`."""
    while groups.used[0] > joins:
        groups.used[0] -= 1
        other = groups.joined[groups.used[0]]
        groups.size[groups.parent[other]] -= groups.size[other]
        groups.parent[other] = NONE


@kernel
def heap_arcs(offsets: Ints, weight: Floats, escape: Floats, heaps: Heaps, top: Ints) -> None:
    """Fill `heaps` and `top` with the arcs into each node that cost less than its escape."""
    m = len(weight)
    heaps.key[:m] = weight
    heaps.key[m:] = escape
    for j in range(len(escape)):
        heap = m + j if escape[j] < np.inf else NONE
        for e in range(offsets[j], offsets[j + 1]):
            if weight[e] < escape[j]:
                heap = meld(heaps, heap, e)
        top[j] = heap


@kernel
def cheapest_into(heaps: Heaps, groups: DisjointSets, top: Ints, tail: Ints, group: int) -> int:
    """Take the cheapest arc from outside into a group off its heap and return it, or NONE.

    What stays on the heap is from now on what choosing it instead would cost more.
    """
    arc = top[group]
    while arc != NONE:
        top[group] = pop(heaps, arc)
        if find(groups, tail[arc]) != group:
            break
        arc = top[group]
    rest = top[group]
    if arc != NONE and rest != NONE:
        weight = heaps.key[arc]
        heaps.key[rest] -= weight
        heaps.owed[rest] -= weight
    return int(arc)


@kernel
def contract(
    heaps: Heaps,
    groups: DisjointSets,
    cycles: Cycles,
    top: Ints,
    path: Ints,
    taken: Ints,
    length: int,
    group: int,
) -> int:
    """Mutate all: make the end of `path`, from `group` on, one group.

    Returns the remaining length of the path; the new group is that of `group`.
    """
    at, end, heap = cycles.used[0], length, NONE
    cycles.joins[at] = groups.used[0]
    while True:
        length -= 1
        heap = meld(heaps, heap, top[path[length]])
        if not join(groups, group, path[length]):
            break
    cycles.group[at] = find(groups, group)
    top[cycles.group[at]] = heap
    stop = cycles.first[at] + end - length
    cycles.arcs[cycles.first[at] : stop] = taken[length:end]
    cycles.first[at + 1] = stop
    cycles.used[0] += 1
    return length


@kernel
def expand(groups: DisjointSets, cycles: Cycles, into: Ints, head: Ints) -> None:
    """Mutate `into`: resolve the arcs into contracted groups to arcs into each node."""
    for at in range(cycles.used[0] - 1, -1, -1):
        undo_joins(groups, cycles.joins[at])
        entered = into[cycles.group[at]]
        for x in range(cycles.first[at], cycles.first[at + 1]):
            arc = cycles.arcs[x]
            into[find(groups, head[arc])] = arc
        into[find(groups, head[entered])] = entered


@kernel
def grow(
    heaps: Heaps,
    groups: DisjointSets,
    cycles: Cycles,
    top: Ints,
    tail: Ints,
    head: Ints,
    into: Ints,
) -> bool:
    """Mutate all: choose an arc into each group until all hang from the root."""
    n = len(top) - 1
    seen = np.full(n + 1, NONE, np.int64)
    path, taken = np.empty(n + 1, np.int64), np.empty(n + 1, np.int64)
    seen[n] = n
    for start in range(n):
        group, length = find(groups, start), 0
        while seen[group] == NONE:
            arc = cheapest_into(heaps, groups, top, tail, group)
            if arc == NONE:
                return False
            path[length], taken[length] = group, arc
            length += 1
            seen[group] = start
            group = find(groups, tail[arc])
            if seen[group] == start:
                length = contract(heaps, groups, cycles, top, path, taken, length, group)
                group = find(groups, group)
                seen[group] = NONE
        for x in range(length):
            into[find(groups, head[taken[x]])] = taken[x]
    return True


@kernel
def cheapest_arborescence(offsets: Ints, tails: Ints, weight: Floats, escape: Floats) -> Ints:
    """Return the arc into each node of the cheapest arborescence, (n,); (0,) if there is none."""
    n, m = len(escape), len(weight)
    head, tail = np.empty(m + n, np.int64), np.empty(m + n, np.int64)
    tail[:m] = tails
    tail[m:] = n
    for j in range(n):
        head[offsets[j] : offsets[j + 1]] = j
        head[m + j] = j
    links = np.full((2, m + n), NONE, np.int64)
    heaps = Heaps(np.empty(m + n), np.zeros(m + n), links[0], links[1])
    top = np.full(n + 1, NONE, np.int64)
    heap_arcs(offsets, weight, escape, heaps, top)
    groups = DisjointSets(
        np.full(n + 1, NONE, np.int64),
        np.ones(n + 1, np.int64),
        np.empty(n + 1, np.int64),
        np.zeros(1, np.int64),
    )
    cycles = Cycles(
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.zeros(n + 1, np.int64),
        np.empty(2 * n + 2, np.int64),
        np.zeros(1, np.int64),
    )
    into = np.full(n + 1, NONE, np.int64)
    if not grow(heaps, groups, cycles, top, tail, head, into):
        return np.empty(0, np.int64)
    expand(groups, cycles, into, head)
    return into[:n]
