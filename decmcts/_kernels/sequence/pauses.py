"""Whether moves on a sequence leave enough time between contours that lie on each other.

A contour takes as long wherever it is printed, so a move changes when the contours it
moves begin and nothing else. A path of edges leads from each contour to those over it,
so the two never pass each other, and what an exchange or a turn brings too near to each
other is one that moved and one that did not, next to an end of the stretch that is
rearranged: only what begins or ends within the longest pause of it is looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.sequence.lend import lent

SHORT_S = 1e-6  # rounding


class Pauses(NamedTuple):
    """What must pass between contours, and when each begins; without `under`, nothing."""

    under_offsets: NDArray[np.int64]  # (n + 1,)
    under: NDArray[np.int32]  # (m,) those under b: under[under_offsets[b]:under_offsets[b + 1]]
    under_s: NDArray[np.float64]  # (m,) b begins no sooner than this after the end of each
    over_offsets: NDArray[np.int64]  # (n + 1,) the same pairs, by the contour below
    over: NDArray[np.int32]  # (m,)
    over_s: NDArray[np.float64]  # (m,)
    longest: float  # of `under_s`
    seconds: NDArray[np.float64]  # (n,) from the begin of each to that of the next
    begin: NDArray[np.float64]  # (n,) by contour; written


@kernel
def lent_pauses(pauses: Pauses) -> Pauses:
    """Return the pauses with arrays that are not counted; valid while `pauses` lives."""
    return Pauses(
        lent(pauses.under_offsets),
        lent(pauses.under),
        lent(pauses.under_s),
        lent(pauses.over_offsets),
        lent(pauses.over),
        lent(pauses.over_s),
        pauses.longest,
        lent(pauses.seconds),
        lent(pauses.begin),
    )


@kernel
def retime(pauses: Pauses, order: NDArray[np.int32], i: int, k: int) -> None:
    """Mutate `pauses.begin`: when the contours at [i, k) begin. O(k - i)."""
    if len(pauses.under) == 0:
        return
    now = begins_at(pauses, order, i - 1) + pauses.seconds[order[i - 1]] if i > 0 else 0.0
    for p in range(i, k):
        pauses.begin[order[p]] = now
        now += pauses.seconds[order[p]]


@kernel
def begins_at(pauses: Pauses, order: NDArray[np.int32], p: int) -> float:
    """Return when the contour at p begins; for p = n when all is done."""
    if p < len(order):
        return float(pauses.begin[order[p]])
    return float(pauses.begin[order[p - 1]] + pauses.seconds[order[p - 1]])


@kernel
def follows_too_soon(
    pauses: Pauses, position: NDArray[np.int32], c: int, begin: float, first: int
) -> bool:
    """Say whether c, beginning then, comes too soon after something ahead of position `first`."""
    for e in range(pauses.under_offsets[c], pauses.under_offsets[c + 1]):
        a = pauses.under[e]
        ended = pauses.begin[a] + pauses.seconds[a]
        if position[a] < first and begin - ended < pauses.under_s[e] - SHORT_S:
            return True
    return False


@kernel
def precedes_too_late(
    pauses: Pauses, position: NDArray[np.int32], c: int, end: float, last: int
) -> bool:
    """Say whether c, ending then, comes too late for something at position `last` or behind."""
    for e in range(pauses.over_offsets[c], pauses.over_offsets[c + 1]):
        b = pauses.over[e]
        if position[b] >= last and pauses.begin[b] - end < pauses.over_s[e] - SHORT_S:
            return True
    return False


@kernel
def swap_keeps(
    pauses: Pauses,
    order: NDArray[np.int32],
    position: NDArray[np.int32],
    i: int,
    j: int,
    k: int,
) -> bool:
    """Say whether exchanging [i, j) and [j, k) keeps all pauses with what lies outside."""
    if len(pauses.under) == 0:
        return True
    opens, middle = begins_at(pauses, order, i), begins_at(pauses, order, j)
    closes = begins_at(pauses, order, k)
    for p in range(j, k):
        begin = pauses.begin[order[p]] - (middle - opens)
        if begin - opens >= pauses.longest:
            break
        if follows_too_soon(pauses, position, order[p], begin, i):
            return False
    for p in range(j - 1, i - 1, -1):
        c = order[p]
        end = pauses.begin[c] + pauses.seconds[c] + (closes - middle)
        if closes - end >= pauses.longest:
            break
        if precedes_too_late(pauses, position, c, end, k):
            return False
    return True


@kernel
def turn_keeps(
    pauses: Pauses, order: NDArray[np.int32], position: NDArray[np.int32], i: int, k: int
) -> bool:
    """Say whether reversing [i, k), nothing in which is related, keeps all pauses."""
    if len(pauses.under) == 0:
        return True
    opens, closes = begins_at(pauses, order, i), begins_at(pauses, order, k)
    for p in range(k - 1, i - 1, -1):
        c = order[p]
        begin = opens + closes - (pauses.begin[c] + pauses.seconds[c])
        if begin - opens >= pauses.longest:
            break
        if follows_too_soon(pauses, position, c, begin, i):
            return False
    for p in range(i, k):
        end = opens + closes - pauses.begin[order[p]]
        if closes - end >= pauses.longest:
            break
        if precedes_too_late(pauses, position, order[p], end, k):
            return False
    return True


@kernel
def rearranging_keeps(
    pauses: Pauses,
    order: NDArray[np.int32],
    position: NDArray[np.int32],
    wanted: NDArray[np.int32],
    first: int,
    last: int,
) -> bool:
    """Say whether `wanted`, another order of [first, last), keeps all pauses. O(last - first).

    Mutates `pauses.begin` to that of `wanted` if it does.
    """
    if len(pauses.under) == 0:
        return True
    now = begins_at(pauses, order, first)
    for x in range(last - first):
        c = wanted[x]
        end = now + pauses.seconds[c]
        # What is under c and in the window has its new time already.
        if follows_too_soon(pauses, position, c, now, last) or precedes_too_late(
            pauses, position, c, end, last
        ):
            retime(pauses, order, first, last)
            return False
        pauses.begin[c] = now
        now = end
    return True


@kernel
def keeps_all(
    order: NDArray[np.int32],
    offsets: NDArray[np.int64],
    under: NDArray[np.int32],
    under_s: NDArray[np.float64],
    seconds: NDArray[np.float64],
) -> bool:
    """Say whether no contour of a sequence begins too soon after one that lies under it."""
    now = 0.0
    ended = np.full(len(order), -np.inf)
    for p in range(len(order)):
        b = order[p]
        for e in range(offsets[b], offsets[b + 1]):
            if now - ended[under[e]] < under_s[e] - SHORT_S:
                return False
        now += seconds[b]
        ended[b] = now
    return True
