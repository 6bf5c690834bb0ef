"""The edges and near ports inside a window of a sequence, in numbers of its own.

Crossover takes the best of several sequences, window by window. After a position at which two have
printed the same contours, either may go on: what comes next is a permutation of the same contours
in both, and each has what it needs printed before. So any choice of windows between such positions
breaks no edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s, Ints
from decmcts.compiled import kernel
from decmcts.search.sequence.entries_kernels import point_in, point_out
from decmcts.search.sequence.metric_kernels import Metric, distance


@kernel
def crossed(
    metric: Metric,
    order: Int32s,
    is_reversed: NDArray[np.uint8],
    entry_id: Int32s,
) -> Int32s:
    """Return the number of the sequence to follow at each position, (n,), for least cost.

    Dynamic programme over all m sequences, O(n m^2). On ties the first one is followed.

    Parameters
    ----------
    order, is_reversed, entry_id : (m, n)
        A row for each sequence; the latter two by contour.
    """
    m, n = order.shape
    place = np.empty((m, n), np.int64)
    for s in range(m):
        for k in range(n):
            place[s, order[s, k]] = k
    ahead = np.full((m, m), -1)  # [s, t]: the last place in s of what t has printed
    came = np.zeros((n, m), np.int32)
    best, now = np.zeros(m), np.zeros(m)
    for k in range(1, n):
        for t in range(m):
            into = point_in(n, is_reversed[t], entry_id[t], order[t, k])
            now[t] = np.inf
            for s in range(m):
                ahead[s, t] = max(ahead[s, t], place[s, order[t, k - 1]])
                if ahead[s, t] > k - 1:
                    continue
                out = point_out(n, is_reversed[s], entry_id[s], order[s, k - 1])
                cost = best[s] + distance(metric, out, into)
                if cost < now[t]:
                    now[t], came[k, t] = cost, s
        best[:] = now
    followed = np.empty(n, np.int32)
    one = np.argmin(best)
    for k in range(n - 1, -1, -1):
        followed[k] = one
        one = came[k, one]
    return followed


@kernel
def block_edges(
    pred_offsets: Ints,
    preds: Int32s,
    succ_offsets: Ints,
    succs: Int32s,
    ids: Int32s,
    low: int,
    high: int,
) -> tuple[Ints, Int32s, Ints, Int32s]:
    """Return predecessors and successors in CSR form, by place in `ids`. O(n + edges there).

    Places before `low` and from `high` on are guards, at most one each: the first
    precedes all that nothing inside precedes, the last follows all that nothing inside
    follows.
    """
    k = len(ids)
    local = np.full(len(pred_offsets) - 1, -1, np.int32)
    for x in range(low, high):
        local[ids[x]] = x
    before, after = np.zeros(k + 1, np.int64), np.zeros(k + 1, np.int64)
    for x in range(low, high):
        before[x + 1] = _count(pred_offsets, preds, ids[x], local)
        after[x + 1] = _count(succ_offsets, succs, ids[x], local)
        if before[x + 1] == 0 and low > 0:
            before[x + 1] = 1
            after[1] += 1
        if after[x + 1] == 0 and high < k:
            after[x + 1] = 1
            before[k] += 1
    before, after = np.cumsum(before), np.cumsum(after)
    block_preds, block_succs = np.empty(before[k], np.int32), np.empty(after[k], np.int32)
    first, last = after[0], before[k - 1]
    for x in range(low, high):
        if _fill(pred_offsets, preds, ids[x], local, block_preds, before[x]) == 0 and low > 0:
            block_preds[before[x]] = 0
            block_succs[first] = x
            first += 1
        if _fill(succ_offsets, succs, ids[x], local, block_succs, after[x]) == 0 and high < k:
            block_succs[after[x]] = k - 1
            block_preds[last] = x
            last += 1
    return before, block_preds, after, block_succs


@kernel
def _count(offsets: Ints, others: Int32s, c: int, local: Int32s) -> int:
    """Return how many neighbours of contour c are inside."""
    count = 0
    for e in range(offsets[c], offsets[c + 1]):
        count += int(local[others[e]] >= 0)
    return count


@kernel
def _fill(offsets: Ints, others: Int32s, c: int, local: Int32s, into: Int32s, at: int) -> int:
    """Mutate `into` from `at` on: the neighbours of contour c inside; return how many."""
    count = 0
    for e in range(offsets[c], offsets[c + 1]):
        if local[others[e]] >= 0:
            into[at + count] = local[others[e]]
            count += 1
    return count


@kernel
def block_ports(near: Int32s, rows: Ints, local: Int32s, place: Int32s, k: int) -> Int32s:
    """Return these rows of the near ports in local numbers, (rows, width).

    Contours and entries that are not there (-1 in `local` and `place`) are left out;
    the others are repeated in turn to fill the row, -1 if there are none.
    """
    n, width = len(local), near.shape[1]
    inner = np.full((len(rows), width), -1, np.int32)
    for r in range(len(rows)):
        count = 0
        for x in range(width):
            port = near[rows[r], x]
            there = -1
            if port >= 2 * n:
                there = place[port - 2 * n]
                port = 2 * k + there
            elif port >= 0:
                there = local[port >> 1]
                port = 2 * there + (port & 1)
            if there >= 0:
                inner[r, count] = port
                count += 1
        for x in range(count, width if count else 0):
            inner[r, x] = inner[r, x - count]
    return inner
