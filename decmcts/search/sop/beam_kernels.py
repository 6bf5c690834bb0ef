"""Forward beam search over linear extensions, one level at a time.

A state is a beginning of a sequence: the set of nodes placed and the last of
them. Of states with equal set and last node only the cheapest is kept. Costs are
given reduced by potentials (never negative), so that the reduced cost of a
beginning plus a constant is a lower bound on every sequence it begins, and also
a fair measure between beginnings of unlike sets.

References
----------
Libralesso, Bouhassoun, Cambazard & Jost 2020, "Tree search for the sequential
ordering problem" (forward branching, prefix dominance, doubling width).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel

_EMPTY = np.int64(-1)
_ONE = np.uint64(1)
_UNIT = 2.0**-53


class BeamProblem(NamedTuple):
    """The problem as the beam needs it."""

    costs: Floats  # (n, n) reduced costs, >= 0
    needed: NDArray[np.uint64]  # (n, words) bits of the nodes that must come before each
    succ_offsets: Ints  # (n + 1,) of the reduced precedence
    succs: Int32s  # (m,)
    words_of: NDArray[np.uint64]  # (n, 2) random words: of a node in a set, of a last node


class Level(NamedTuple):
    """The states with equally many nodes placed."""

    last: Int32s  # (width,)
    cost: Floats  # (width,)
    mixed: NDArray[np.uint64]  # (width,) exclusive or of the random words of the set
    placed: NDArray[np.uint64]  # (width, words) the set
    ready: NDArray[np.uint64]  # (width, words) nodes that may come next


class Children(NamedTuple):
    """Candidates for the next level; room for several times the width."""

    parent: Int32s  # (room,)
    node: Int32s  # (room,)
    cost: Floats  # (room,)
    key: NDArray[np.uint64]  # (room,) identifies set and last node
    table: Ints  # (slots,) hash table of children, a power of two


class Expansion(NamedTuple):
    """How far the children of a level have been made."""

    state: int  # the next one to make children of
    kept: int  # children
    limit: float  # rank from which none is kept for want of width, infinity while there is room
    seen: int  # children looked at


@kernel
def lowest_bit(word: np.uint64) -> int:
    """Return the index of the lowest set bit of a word that is not 0."""
    index = 0
    if word & np.uint64(0xFFFFFFFF) == 0:
        word >>= np.uint64(32)
        index = 32
    if word & np.uint64(0xFFFF) == 0:
        word >>= np.uint64(16)
        index += 16
    if word & np.uint64(0xFF) == 0:
        word >>= np.uint64(8)
        index += 8
    while word & _ONE == 0:
        word >>= _ONE
        index += 1
    return index


@kernel
def rank(cost: float, key: np.uint64, noise: float) -> float:
    """Return what children are sorted by: the cost, ties (up to `noise`) broken by the key."""
    return cost + noise * _UNIT * float(key >> np.uint64(11))


@kernel
def _slot_of(children: Children, key: np.uint64) -> np.int64:
    """Return the slot of the child with this key, or the free slot for it."""
    mask = len(children.table) - 1
    slot = np.int64(key & np.uint64(mask))
    while children.table[slot] != _EMPTY and children.key[children.table[slot]] != key:
        slot = (slot + 1) & mask
    return slot


@kernel
def _offer(
    children: Children, count: int, parent: int, node: int, cost: float, key: np.uint64
) -> int:
    """Mutate the children: add one, or improve the one with equal key; return the count."""
    slot = _slot_of(children, key)
    at = children.table[slot]
    if at == _EMPTY:
        at = count
        children.table[slot] = at
        children.key[at] = key
        count += 1
    elif children.cost[at] <= cost:
        return count
    children.parent[at] = parent
    children.node[at] = node
    children.cost[at] = cost
    return count


@kernel
def keep_best(children: Children, count: int, width: int, noise: float) -> tuple[int, float]:
    """Mutate the children: keep the `width` best; return (count, rank from which none is kept)."""
    if count <= width:
        return count, np.inf
    ranks = np.empty(count)
    for c in range(count):
        ranks[c] = rank(children.cost[c], children.key[c], noise)
    limit = np.partition(ranks, width)[width]
    children.table[:] = _EMPTY
    kept = 0
    for c in range(count):
        if ranks[c] < limit:
            children.parent[kept] = children.parent[c]
            children.node[kept] = children.node[c]
            children.cost[kept] = children.cost[c]
            children.key[kept] = children.key[c]
            children.table[_slot_of(children, children.key[c])] = kept
            kept += 1
    return kept, limit


@kernel
def breed(
    rules: BeamProblem,
    level: Level,
    children: Children,
    at: Expansion,
    width: int,
    below: float,
    noise: float,
    quota: int,
) -> Expansion:
    """Mutate `children`: go on with the children of a level that cost less than `below`.

    Begins where `at` stands and ends after about `quota` children, or with the last state.
    """
    costs, words_of, room = rules.costs, rules.words_of, len(children.cost)
    p, count, limit, seen = at.state, at.kept, at.limit, 0
    while p < len(level.last) and seen < quota:
        row = costs[level.last[p]]
        for w in range(level.ready.shape[1]):
            word = level.ready[p, w]
            while word != 0:
                node = 64 * w + lowest_bit(word)
                word &= word - _ONE
                seen += 1
                cost = level.cost[p] + row[node]
                if cost >= limit or cost >= below:
                    continue
                key = level.mixed[p] ^ words_of[node, 0] ^ words_of[node, 1]
                if rank(cost, key, noise) >= limit:
                    continue
                count = _offer(children, count, p, node, cost, key)
                if count == room:
                    count, limit = keep_best(children, count, width, noise)
        p += 1
    return Expansion(p, count, limit, at.seen + seen)


@kernel
def descend_to(
    rules: BeamProblem, level: Level, children: Children, count: int, following: Level
) -> None:
    """Mutate `following`: the states that the first `count` children stand for."""
    for c in range(count):
        p, node = children.parent[c], children.node[c]
        bit = _ONE << np.uint64(node & 63)
        following.last[c] = node
        following.cost[c] = children.cost[c]
        following.mixed[c] = level.mixed[p] ^ rules.words_of[node, 0]
        placed, ready = following.placed[c], following.ready[c]
        for w in range(len(placed)):
            placed[w] = level.placed[p, w]
            ready[w] = level.ready[p, w]
        placed[node >> 6] |= bit
        ready[node >> 6] &= ~bit
        for e in range(rules.succ_offsets[node], rules.succ_offsets[node + 1]):
            b = rules.succs[e]
            free = True
            for w in range(len(placed)):
                if rules.needed[b, w] & ~placed[w] != 0:
                    free = False
                    break
            if free:
                ready[b >> 6] |= _ONE << np.uint64(b & 63)
