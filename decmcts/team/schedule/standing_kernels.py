"""When the actions of a joint plan begin and end, with what stopping costs, on bare arrays."""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.compiled import kernel

UNKNOWN = -1.0


@kernel
def begin_of(
    a: int,
    free: float,
    offsets: Ints,
    after: Ints,
    passing: Floats,
    begin: Floats,
) -> float:
    """When an action may begin that is `free` to from then on; UNKNOWN: not all is timed yet."""
    for e in range(offsets[a], offsets[a + 1]):
        if begin[after[e]] == UNKNOWN:
            return UNKNOWN
        free = max(free, begin[after[e]] + passing[e])
    return free


@kernel
def times_with_stops(
    first: Ints,
    offsets: Ints,
    after: Ints,
    passing: Floats,
    stops: Floats,
    seconds: Floats,
) -> Floats:
    """When each action begins at the earliest, (n,); UNKNOWN where the waits have a cycle.

    Head h has the actions first[h] to first[h + 1] - 1. Action a waits for `after` (m,), its rows
    offsets[a] to offsets[a + 1] - 1, until `passing` (m,) seconds behind their begins. Behind that,
    and behind the action before, it stands for `stops` (n,) seconds. Complexity O(n + m) times
    the number of heads: a head is looked at again when another one has gone on.
    """
    begin = np.full(len(seconds), UNKNOWN)
    todo = first[:-1].copy()
    moved = True
    while moved:
        moved = False
        for h in range(len(todo)):
            while todo[h] < first[h + 1]:
                a = todo[h]
                free = begin[a - 1] + seconds[a - 1] if a > first[h] else 0.0
                at = begin_of(a, free, offsets, after, passing, begin)
                if at == UNKNOWN:
                    break
                begin[a] = at + stops[a]
                todo[h] = a + 1
                moved = True
    return begin
