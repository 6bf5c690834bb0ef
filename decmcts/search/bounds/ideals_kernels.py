"""The least travel, exactly: dynamic programming over what may be printed already.

What a sequence may have printed at some time is an order ideal of the dependency
graph: a set that has the predecessors of all its contours. Layers wait for those
under them, so there are few ideals where layers have few contours, however many
layers there are. For each ideal and each choice to print its last contour the least
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

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.search.bounds.pricing_kernels import NONE, Choices
from decmcts.search.sequence.metric_kernels import distance

WINDOW = 64
_ONE = np.uint64(1)
_WIDTH = np.uint64(WINDOW)
_HALF = np.uint64(32)
_SPREAD = 7919
NOWHERE = np.uint64(2**64 - 1)
"""Bits of an ideal that is given up; no other has them all, as its first contour is lacking."""


class IdealRules(NamedTuple):
    """Which contour may follow on an ideal."""

    reach: Ints  # (n,) last contour that may be printed before each, or itself
    needed: NDArray[np.uint64]  # (n,) predecessors: bit 63 is the contour before, and so on down
    slack: float  # by how much a detour may cost less than the direct travel; may be infinite


class Ideals(NamedTuple):
    """Room for ideals, level by level, and for steps, each of which adds a contour to one.

    The steps from ideal i are begin[i]:begin[i + 1]; those that lead to it are linked.
    """

    lacks: Int32s  # (ideals,) first contour not printed
    bits: NDArray[np.uint64]  # (ideals,) bit k: contour `lacks` + k is printed
    begin: Int32s  # (ideals + 1,) first step from each
    newest: Int32s  # (ideals,) last step that leads there, NONE if none
    ports: Int32s  # (ideals,) choices of all the contours of these steps together
    older: Int32s  # (steps,) the one that leads to the same before that, NONE if none
    contour: Int32s  # (steps,) printed
    base: Ints  # (steps + 1,) first entry of `travel`, one a choice of the contour
    travel: Floats  # (travels,) least until a step's end; infinite: given up
    slots: Int32s  # hash table of ideals of the level in the making; others are free


class Frontier(NamedTuple):
    """How far the ideals have been made."""

    level: int  # contours printed in the newest ideals
    first: int  # the first of these
    ideals: int  # all
    travels: int
    full: bool  # there was no room for the next level, or it has too many steps


@kernel
def reset(ideals: Ideals) -> Frontier:
    """Mutate the ideals: nothing but the one with nothing printed; return where that stands."""
    ideals.slots[:] = -1
    ideals.lacks[0] = ideals.begin[0] = ideals.ports[0] = ideals.base[0] = 0
    ideals.bits[0], ideals.newest[0] = 0, NONE
    return Frontier(0, 0, 1, 0, False)


@kernel
def reaches(pred_offsets: Ints, preds: Int32s) -> tuple[Ints, bool]:
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
def needs(pred_offsets: Ints, preds: Int32s) -> NDArray[np.uint64]:
    """Return the predecessors of each contour among the `WINDOW` before it, as bits, (n,)."""
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
def extend(
    ideals: Ideals, choices: Choices, rules: IdealRules, at: Frontier, widest: int
) -> Frontier:
    """Mutate the ideals: add those of the next level, and the steps to them."""
    top, travels, step = at.ideals, at.travels, ideals.begin[at.first]
    most = min(len(ideals.lacks), at.ideals + len(ideals.slots) // 2)
    room = min(step + widest, len(ideals.contour))
    for i in range(at.first, at.ideals):
        lacks, bits = ideals.lacks[i], ideals.bits[i]
        if bits == NOWHERE:
            ideals.begin[i + 1] = step
            continue
        for j in range(lacks, rules.reach[lacks] + 1):
            k = np.uint64(j - lacks)
            if (bits >> k) & _ONE or (k > 0 and (rules.needed[j] >> (_WIDTH - k)) & ~bits):
                continue
            then, following = bits | (_ONE << k), lacks
            while then & _ONE:
                then >>= _ONE
                following += 1
            slot = _slot_of(ideals, at.ideals, following, then)
            if ideals.slots[slot] < at.ideals:
                if top == most:
                    return Frontier(at.level, at.first, at.ideals, at.travels, True)
                ideals.slots[slot] = top
                ideals.lacks[top], ideals.bits[top] = following, then
                ideals.newest[top], ideals.ports[top] = NONE, 0
                top += 1
            count = choices.offsets[j + 1] - choices.offsets[j]
            if step == room or travels + count > len(ideals.travel):
                return Frontier(at.level, at.first, at.ideals, at.travels, True)
            child = ideals.slots[slot]
            ideals.contour[step], ideals.base[step] = j, travels
            ideals.older[step], ideals.newest[child] = ideals.newest[child], step
            ideals.ports[child] += count
            step += 1
            travels += count
            ideals.base[step] = travels
        ideals.begin[i + 1] = step
    return Frontier(at.level + 1, at.ideals, top, travels, False)


@kernel
def make_ideals(
    ideals: Ideals, choices: Choices, rules: IdealRules, at: Frontier, quota: int, widest: int
) -> Frontier:
    """Mutate the ideals: make level after level, until about `quota` steps or the last level.

    A level has `widest` steps at most.
    """
    until = ideals.begin[at.first] + quota
    while at.level < len(rules.reach) and not at.full and ideals.begin[at.first] < until:
        at = extend(ideals, choices, rules, at, widest)
    return at


@kernel
def _gather(
    ideals: Ideals,
    choices: Choices,
    slack: float,
    i: int,
    port: Ints,
    travel: Floats,
) -> int:
    """Write where the head may stand after ideal i, and the least travel; return how many.

    Left out is what a travel from another of them reaches no later: whatever follows
    costs no less from there.
    """
    count, e = 0, ideals.newest[i]
    while e != NONE:
        w = choices.offsets[ideals.contour[e]]
        for k in range(choices.offsets[ideals.contour[e] + 1] - w):
            port[count], travel[count] = choices.out[w + k], ideals.travel[ideals.base[e] + k]
            count += int(travel[count] < np.inf)
        e = ideals.older[e]
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
            reached = travel[kept] + distance(choices.metric, port[kept], port[k]) + slack
            if travel[k] < reached:
                port[left], travel[left] = port[k], travel[k]
                left += 1
        count = left
        kept += 1
    return count


@kernel
def price_steps(ideals: Ideals, choices: Choices, rules: IdealRules, first: int, last: int) -> None:
    """Mutate the ideals: give the steps from ideals first:last their travel, all before known."""
    port, travel = np.empty(len(choices.into), np.int64), np.empty(len(choices.into))
    for i in range(first, last):
        count = _gather(ideals, choices, rules.slack, i, port, travel)
        for e in range(ideals.begin[i], ideals.begin[i + 1]):
            w = choices.offsets[ideals.contour[e]]
            for k in range(choices.offsets[ideals.contour[e] + 1] - w):
                least = 0.0 if ideals.newest[i] == NONE else np.inf
                for o in range(count):
                    least = min(
                        least, travel[o] + distance(choices.metric, port[o], choices.into[w + k])
                    )
                ideals.travel[ideals.base[e] + k] = least


@kernel
def trace(ideals: Ideals, choices: Choices, last: int) -> tuple[float, Int32s, Ints]:
    """Return the least travel to the last ideal, the contours on the way and their choices."""
    n = int(ideals.lacks[last])
    order, choice = np.empty(n, np.int32), np.empty(n, np.int64)
    i, goal, least = last, -1, 0.0
    for position in range(n - 1, -1, -1):
        best, found, e = np.inf, NONE, ideals.newest[i]
        while e != NONE:
            w = choices.offsets[ideals.contour[e]]
            for k in range(choices.offsets[ideals.contour[e] + 1] - w):
                cost = ideals.travel[ideals.base[e] + k]
                if goal >= 0:
                    cost += distance(choices.metric, choices.out[w + k], goal)
                if found == NONE or cost < best:
                    best, found = cost, e
                    choice[position] = w + k
            e = ideals.older[e]
        if goal < 0:
            least = best
        order[position] = ideals.contour[found]
        goal = choices.into[choice[position]]
        i = int(np.searchsorted(ideals.begin[: i + 1], found, side="right")) - 1
    return least, order, choice
