"""Whether moves on a sequence leave enough time between contours that lie on each other.

A contour takes as long wherever it is printed, so a move changes when the contours it
moves begin and nothing else. A path of edges leads from each contour to those over it, so
no move puts one past the other. An exchange or a reversal can break a lag only between a
contour that moved and one that did not. Such a pair lies on both sides of an end of the
rearranged window, so only contours within the longest lag of that end are looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel

SHORT_S = 1e-6  # rounding


class LagState(NamedTuple):
    """What must pass between contours, and when each begins; without `under`, nothing."""

    under_offsets: Ints  # (n + 1,)
    under: Int32s  # (m,) those under b: under[under_offsets[b]:under_offsets[b + 1]]
    under_s: Floats  # (m,) b begins no sooner than this after the end of each
    over_offsets: Ints  # (n + 1,) the same pairs, by the contour below
    over: Int32s  # (m,)
    over_s: Floats  # (m,)
    longest: float  # of `under_s`
    seconds: Floats  # (n,) from the begin of each to that of the next
    begin: Floats  # (n,) by contour; written


@kernel
def retime(lags: LagState, order: Int32s, i: int, k: int) -> None:
    """Mutate `lags.begin`: when the contours at [i, k) begin. O(k - i)."""
    if len(lags.under) == 0:
        return
    now = begins_at(lags, order, i - 1) + lags.seconds[order[i - 1]] if i > 0 else 0.0
    for p in range(i, k):
        lags.begin[order[p]] = now
        now += lags.seconds[order[p]]


@kernel
def begins_at(lags: LagState, order: Int32s, p: int) -> float:
    """Return when the contour at p begins; for p = n when all is done."""
    if p < len(order):
        return float(lags.begin[order[p]])
    return float(lags.begin[order[p - 1]] + lags.seconds[order[p - 1]])


@kernel
def follows_too_soon(lags: LagState, position: Int32s, c: int, begin: float, first: int) -> bool:
    """Say whether c, beginning then, comes too soon after something before position `first`."""
    for e in range(lags.under_offsets[c], lags.under_offsets[c + 1]):
        a = lags.under[e]
        ended = lags.begin[a] + lags.seconds[a]
        if position[a] < first and begin - ended < lags.under_s[e] - SHORT_S:
            return True
    return False


@kernel
def precedes_too_late(lags: LagState, position: Int32s, c: int, end: float, last: int) -> bool:
    """Say whether c, ending then, comes too late for something at position `last` or behind."""
    for e in range(lags.over_offsets[c], lags.over_offsets[c + 1]):
        b = lags.over[e]
        if position[b] >= last and lags.begin[b] - end < lags.over_s[e] - SHORT_S:
            return True
    return False


@kernel
def swap_keeps(lags: LagState, order: Int32s, position: Int32s, i: int, j: int, k: int) -> bool:
    """Say whether exchanging [i, j) and [j, k) keeps all lags with what lies outside."""
    if len(lags.under) == 0:
        return True
    opens, middle = begins_at(lags, order, i), begins_at(lags, order, j)
    closes = begins_at(lags, order, k)
    for p in range(j, k):
        begin = lags.begin[order[p]] - (middle - opens)
        if begin - opens >= lags.longest:
            break
        if follows_too_soon(lags, position, order[p], begin, i):
            return False
    for p in range(j - 1, i - 1, -1):
        c = order[p]
        end = lags.begin[c] + lags.seconds[c] + (closes - middle)
        if closes - end >= lags.longest:
            break
        if precedes_too_late(lags, position, c, end, k):
            return False
    return True


@kernel
def reversal_keeps(lags: LagState, order: Int32s, position: Int32s, i: int, k: int) -> bool:
    """Say whether reversing [i, k), nothing in which is related, keeps all lags."""
    if len(lags.under) == 0:
        return True
    opens, closes = begins_at(lags, order, i), begins_at(lags, order, k)
    for p in range(k - 1, i - 1, -1):
        c = order[p]
        begin = opens + closes - (lags.begin[c] + lags.seconds[c])
        if begin - opens >= lags.longest:
            break
        if follows_too_soon(lags, position, c, begin, i):
            return False
    for p in range(i, k):
        end = opens + closes - lags.begin[order[p]]
        if closes - end >= lags.longest:
            break
        if precedes_too_late(lags, position, order[p], end, k):
            return False
    return True


@kernel
def rearranging_keeps(
    lags: LagState,
    order: Int32s,
    position: Int32s,
    wanted: Int32s,
    first: int,
    last: int,
) -> bool:
    """Say whether `wanted`, another order of [first, last), keeps all lags. O(last - first).

    Mutates `lags.begin` to that of `wanted` if it does.
    """
    if len(lags.under) == 0:
        return True
    now = begins_at(lags, order, first)
    for x in range(last - first):
        c = wanted[x]
        end = now + lags.seconds[c]
        # What is under c and in the window has its new time already.
        if follows_too_soon(lags, position, c, now, last) or precedes_too_late(
            lags, position, c, end, last
        ):
            retime(lags, order, first, last)
            return False
        lags.begin[c] = now
        now = end
    return True


@kernel
def keeps_all(
    order: Int32s,
    offsets: Ints,
    under: Int32s,
    under_s: Floats,
    seconds: Floats,
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
