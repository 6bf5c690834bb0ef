"""The least travel, exactly: dynamic programming over what may be printed already.

What a sequence may have printed at some time is an order ideal of the dependency
graph: a set that has the predecessors of all its contours. Layers wait for those
under them, so there are few ideals where layers have few contours, however many
layers there are. For each ideal and each way to print its last contour the least
travel so far is kept.

Contours are numbered in a linear extension. An ideal is kept as the first contour
it lacks and 64 bits from there on, so each contour may be overtaken only by the
next `WINDOW - 1`; `reaches` tells whether that leaves anything out.

References
----------
Held & Karp 1962, "A dynamic programming approach to sequencing problems"; Schrage &
Baker 1978, "Dynamic programming solution of sequencing problems with precedence
constraints" (over ideals instead of all sets).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.metric import distance
from decmcts._kernels.pricing import Ways

WINDOW = 64
_ONE = np.uint64(1)
_LAST = np.uint64(WINDOW - 1)
_HALF = np.uint64(32)
_SPREAD = 7919


class Rules(NamedTuple):
    """Which contour may follow on an ideal."""

    reach: NDArray[np.int64]  # (n,) last contour that may be printed before each, or itself
    needed: NDArray[np.uint64]  # (n,) predecessors: bit 63 is the contour before, and so on down
    slack: float  # by how much a detour may be shorter than the direct travel; infinity: no limit


class Ideals(NamedTuple):
    """Room for ideals, level by level, and for their ends: a last contour and where it came from.

    The ends of ideal i are begin[i]:begin[i + 1]; those of ideals in the making stand
    in `fresh`, by the ideal they extend, until they are sorted.
    """

    lacks: NDArray[np.int32]  # (ideals,) first contour not printed
    bits: NDArray[np.uint64]  # (ideals,) bit k: contour `lacks` + k is printed
    begin: NDArray[np.int32]  # (ideals + 1,) first end of each
    contour: NDArray[np.int32]  # (ends,) printed last
    parent: NDArray[np.int32]  # (ends,) ideal before that
    base: NDArray[np.int64]  # (ends,) first entry of `travel`, one for each way of the contour
    travel: NDArray[np.float64]  # (travels,) least travel that leads there
    fresh: NDArray[np.int32]  # (ends, 3) contour, parent, ideal
    slots: NDArray[np.int32]  # hash table of ideals of the level in the making; others are free


class Stand(NamedTuple):
    """How far the ideals have been made."""

    level: int  # contours printed in the newest ideals
    first: int  # the first of these
    ideals: int  # all
    travels: int
    full: bool  # there was no room for the next level, or it has too many ends


@kernel
def reaches(
    pred_offsets: NDArray[np.int64], preds: NDArray[np.int32]
) -> tuple[NDArray[np.int64], bool]:
    """Return the last contour that may be printed before each, or itself, (n,), and success.

    Without success some contour may be overtaken by one that is `WINDOW` or more behind.
    O(n + edges) but for the windows looked through.
    """
    n = len(pred_offsets) - 1
    latest = np.full(n + 1, n, np.int64)  # of all contours from here on: the first latest pred
    for j in range(n - 1, -1, -1):
        own = -1
        for e in range(pred_offsets[j], pred_offsets[j + 1]):
            own = max(own, preds[e])
        latest[j] = min(latest[j + 1], own)
    reach, after = np.empty(n, np.int64), np.zeros(n, np.bool_)
    for f in range(n):
        after[f] = True
        last, j = f, f + 1
        while j < n and latest[j] <= last:  # else all from here on follow on f
            for e in range(pred_offsets[j], pred_offsets[j + 1]):
                after[j] |= preds[e] >= f and after[preds[e]]
            if not after[j]:
                last = j
                if last - f >= WINDOW:
                    return reach, False
            j += 1
        after[f:j] = False
        reach[f] = last
    return reach, True


@kernel
def needs(pred_offsets: NDArray[np.int64], preds: NDArray[np.int32]) -> NDArray[np.uint64]:
    """Return the predecessors of each contour among the 64 before it, as bits, (n,)."""
    n = len(pred_offsets) - 1
    needed = np.zeros(n, np.uint64)
    for j in range(n):
        for e in range(pred_offsets[j], pred_offsets[j + 1]):
            if j - preds[e] <= WINDOW:
                needed[j] |= _ONE << np.uint64(WINDOW - (j - preds[e]))
    return needed


@kernel
def _slot_of(ideals: Ideals, oldest: int, lacks: int, bits: np.uint64) -> int:
    """Return the slot of an ideal not older than `oldest`, or the free slot for it."""
    size = len(ideals.slots)
    mixed = np.int64((bits ^ (bits >> _HALF)) % np.uint64(size))
    slot = (mixed + lacks * _SPREAD) % size
    while True:
        i = ideals.slots[slot]
        if i < oldest or (ideals.lacks[i] == lacks and ideals.bits[i] == bits):
            return int(slot)
        slot = (slot + 1) % size


@kernel
def _extend(ideals: Ideals, rules: Rules, at: Stand, widest: int) -> tuple[int, int]:
    """Mutate the ideals: add those of the next level; return (ideals, fresh ends), or -1 twice."""
    top, made = at.ideals, 0
    most = min(len(ideals.lacks), at.ideals + len(ideals.slots) // 2)
    room = min(widest, len(ideals.contour) - ideals.begin[at.ideals])
    for i in range(at.first, at.ideals):
        lacks, bits = ideals.lacks[i], ideals.bits[i]
        for j in range(lacks, rules.reach[lacks] + 1):
            k = np.uint64(j - lacks)
            if (bits >> k) & _ONE or (k > 0 and (rules.needed[j] >> (_LAST - k + _ONE)) & ~bits):
                continue
            then, following = bits | (_ONE << k), lacks
            while then & _ONE:
                then >>= _ONE
                following += 1
            slot = _slot_of(ideals, at.ideals, following, then)
            if ideals.slots[slot] < at.ideals:
                if top == most:
                    return -1, -1
                ideals.slots[slot] = top
                ideals.lacks[top], ideals.bits[top] = following, then
                top += 1
            if made == room:
                return -1, -1
            ideals.fresh[made, 0] = j
            ideals.fresh[made, 1] = i
            ideals.fresh[made, 2] = ideals.slots[slot]
            made += 1
    return top, made


@kernel
def _sort(ideals: Ideals, ways: Ways, at: Stand, top: int, made: int) -> int:
    """Mutate the ideals: give fresh ends their place; return travels with theirs, or -1.

    `fresh` then has the place of each instead of the ideal.
    """
    begin, travels = ideals.begin, at.travels
    first = begin[at.ideals]
    begin[at.ideals + 1 : top + 1] = 0
    for e in range(made):
        begin[ideals.fresh[e, 2] + 1] += 1
    for i in range(at.ideals, top):
        begin[i + 1] += begin[i]
    for e in range(made):
        i = ideals.fresh[e, 2]
        place = begin[i]
        begin[i] += 1
        ideals.contour[place], ideals.parent[place] = ideals.fresh[e, 0], ideals.fresh[e, 1]
        ideals.fresh[e, 2] = place
    for i in range(top, at.ideals, -1):
        begin[i] = begin[i - 1]
    begin[at.ideals] = first
    for e in range(first, first + made):
        ideals.base[e] = travels
        c = ideals.contour[e]
        travels += ways.offsets[c + 1] - ways.offsets[c]
    return int(travels) if travels <= len(ideals.travel) else -1


@kernel
def _gather(
    ideals: Ideals,
    ways: Ways,
    slack: float,
    i: int,
    port: NDArray[np.int64],
    travel: NDArray[np.float64],
) -> int:
    """Write where the head may stand after ideal i, and the least travel; return how many.

    Left out is what a travel from another of them reaches no later: whatever follows
    costs no less from there.
    """
    count = 0
    for e in range(ideals.begin[i], ideals.begin[i + 1]):
        w = ways.offsets[ideals.contour[e]]
        for k in range(ways.offsets[ideals.contour[e] + 1] - w):
            port[count], travel[count] = ways.out[w + k], ideals.travel[ideals.base[e] + k]
            count += 1
    kept = 0
    while slack < np.inf and kept < count:
        best = kept
        for k in range(kept + 1, count):
            if travel[k] < travel[best]:
                best = k
        port[kept], port[best] = port[best], port[kept]
        travel[kept], travel[best] = travel[best], travel[kept]
        left = kept + 1
        for k in range(kept + 1, count):
            reached = travel[kept] + distance(ways.metric, port[kept], port[k]) + slack
            if travel[k] < reached:
                port[left], travel[left] = port[k], travel[k]
                left += 1
        count = left
        kept += 1
    return count


@kernel
def _price(
    ideals: Ideals,
    ways: Ways,
    rules: Rules,
    made: int,
    port: NDArray[np.int64],
    travel: NDArray[np.float64],
) -> None:
    """Mutate the ideals: give the fresh ends their travel."""
    parent, count = -1, 0
    for e in range(made):
        c, i, place = ideals.fresh[e, 0], ideals.fresh[e, 1], ideals.fresh[e, 2]
        if i != parent:
            parent, count = i, _gather(ideals, ways, rules.slack, i, port, travel)
        base, w = ideals.base[place], ways.offsets[c]
        for k in range(ways.offsets[c + 1] - w):
            least = np.inf if count > 0 else 0.0
            for o in range(count):
                least = min(least, travel[o] + distance(ways.metric, port[o], ways.into[w + k]))
            ideals.travel[base + k] = least


@kernel
def make_ideals(
    ideals: Ideals, ways: Ways, rules: Rules, at: Stand, quota: int, widest: int
) -> Stand:
    """Mutate the ideals: make level after level, until about `quota` ends or the last level.

    Ideal 0, with nothing printed and no end, must be there. A level has `widest` ends at most.
    """
    until = ideals.begin[at.ideals] + quota
    port, travel = np.empty(len(ways.into), np.int64), np.empty(len(ways.into))
    while at.level < len(rules.reach) and not at.full and ideals.begin[at.ideals] < until:
        top, made = _extend(ideals, rules, at, widest)
        travels = _sort(ideals, ways, at, top, made) if made >= 0 else -1
        if travels < 0:
            return Stand(at.level, at.first, at.ideals, at.travels, True)
        _price(ideals, ways, rules, made, port, travel)
        at = Stand(at.level + 1, at.ideals, top, travels, False)
    return at


@kernel
def trace(
    ideals: Ideals, ways: Ways, last: int
) -> tuple[float, NDArray[np.int32], NDArray[np.int64]]:
    """Return the least travel to an ideal, the contours on the way and their ways, by position."""
    lacks, bits = ideals.lacks[last], ideals.bits[last]
    n = int(lacks)
    while bits:
        n += int(bits & _ONE)
        bits >>= _ONE
    order, way = np.empty(n, np.int32), np.empty(n, np.int64)
    i, goal, least = last, -1, 0.0
    for position in range(n - 1, -1, -1):
        best, found = np.inf, -1
        for e in range(ideals.begin[i], ideals.begin[i + 1]):
            w = ways.offsets[ideals.contour[e]]
            for k in range(ways.offsets[ideals.contour[e] + 1] - w):
                cost = ideals.travel[ideals.base[e] + k]
                if goal >= 0:
                    cost += distance(ways.metric, ways.out[w + k], goal)
                if cost < best:
                    best, found = cost, e
                    way[position] = w + k
        if goal < 0:
            least = best
        order[position], i = ideals.contour[found], ideals.parent[found]
        goal = ways.into[way[position]]
    return least, order, way
