"""Nearest feasible neighbour, optionally within a window of a per-contour key.

The ready contours (all predecessors printed) are few on a print, one layer or
so per tower, so a linear scan over them beats a spatial index.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.search.sequence.metric_kernels import Metric, distance


@kernel
def _release(
    c: int,
    waiting: Int32s,
    ready: Int32s,
    n_ready: int,
    succ_offsets: Ints,
    succs: Int32s,
) -> int:
    """Mutate `waiting` and `ready` for the printing of `c`; return the new ready count."""
    for e in range(succ_offsets[c], succ_offsets[c + 1]):
        b = succs[e]
        waiting[b] -= 1
        if waiting[b] == 0:
            ready[n_ready] = b
            n_ready += 1
    return n_ready


@kernel
def nearest_ready(
    metric: Metric,
    reversible: Flags,
    ready: Int32s,
    n_ready: int,
    at: int,
    key: Floats,
    limit: float,
) -> tuple[int, int, float]:
    """Return slot in `ready`, direction and distance of the nearest to port `at`; slot -1: none.

    Only contours with key <= limit count; without a limit `key` may be empty. At -1 all are
    near. Equal distances go to the lower contour id, so the result does not depend on the order
    of `ready`.
    """
    slot, is_reversed, shortest = -1, 0, np.inf
    for k in range(n_ready):
        c = ready[k]
        if limit < np.inf and key[c] > limit:
            continue
        for f in range(2 if reversible[c] else 1):
            d = 0.0 if at < 0 else distance(metric, at, 2 * c + f)
            if d < shortest or (d == shortest and c < ready[slot]):
                slot, is_reversed, shortest = k, f, d
    return slot, is_reversed, shortest


@kernel
def greedy_order(
    metric: Metric,
    reversible: Flags,
    pred_offsets: Ints,
    succ_offsets: Ints,
    succs: Int32s,
    key: Floats,
    by_key: Ints,
    buffer: float,
    slab: float,
) -> tuple[Int32s, NDArray[np.uint8]]:
    """Return the order and directions of the nearest-feasible rule within a buffer.

    Only contours are candidates whose key is at most `buffer` above the lowest
    key not yet printed, that lowest key rounded down to a multiple of `slab`
    when slab > 0. If the dependency graph leaves none of them, all ready ones are.
    `by_key` sorts the contours by key.
    """
    n = len(reversible)
    order, is_reversed = np.empty(n, np.int32), np.zeros(n, np.uint8)
    waiting = np.diff(pred_offsets).astype(np.int32)
    ready = np.empty(n, np.int32)
    n_ready, at, low = 0, -1, 0
    for c in range(n):
        if waiting[c] == 0:
            ready[n_ready] = c
            n_ready += 1
    for k in range(n):
        while waiting[by_key[low]] < 0:
            low += 1
        floor = key[by_key[low]]
        if slab > 0.0:
            floor = np.floor(floor / slab) * slab
        slot, f, _ = nearest_ready(metric, reversible, ready, n_ready, at, key, floor + buffer)
        if slot < 0:
            slot, f, _ = nearest_ready(metric, reversible, ready, n_ready, at, key, np.inf)
        c = ready[slot]
        ready[slot] = ready[n_ready - 1]
        waiting[c] = -1
        n_ready = _release(c, waiting, ready, n_ready - 1, succ_offsets, succs)
        order[k], is_reversed[c] = c, f
        at = 2 * c + 1 - f
    return order, is_reversed
