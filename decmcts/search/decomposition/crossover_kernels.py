"""The best of several sequences, window by window.

After a position at which two have printed the same contours, either may go on: what
comes next is a permutation of the same contours in both, and each has what it needs
printed before. So any choice of windows between such positions breaks no edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel
from decmcts.search.sequence.entries_kernels import point_in, point_out
from decmcts.search.sequence.metric_kernels import Metric, distance


@kernel
def crossed(
    metric: Metric,
    order: NDArray[np.int32],
    is_reversed: NDArray[np.uint8],
    entry_id: NDArray[np.int32],
) -> NDArray[np.int32]:
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
