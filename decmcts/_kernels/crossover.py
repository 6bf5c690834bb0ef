"""The best of two sequences, stretch by stretch.

After a position at which both have printed the same contours, either may go on:
what comes next is a permutation of the same contours in both, and each has what
it needs printed before. So any choice of stretches between such positions breaks
no edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.metric import Metric, distance
from decmcts._kernels.seats import port_in, port_out


@kernel
def crossed(
    metric: Metric,
    order: NDArray[np.int32],
    flip: NDArray[np.uint8],
    seat: NDArray[np.int32],
    other: NDArray[np.int32],
    other_flip: NDArray[np.uint8],
    other_seat: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """Return the positions at which to print what `other` does, (n,), for least cost.

    Dynamic programme over both sequences, O(n). On ties the first one stays.
    """
    n = len(order)
    place = np.empty(n, np.int64)
    for k in range(n):
        place[order[k]] = k
    came = np.zeros((n, 2), np.bool_)
    best, ahead = np.zeros(2), -1
    for k in range(1, n):
        ahead = max(ahead, place[other[k - 1]])
        out = (port_out(n, flip, seat, order[k - 1]),
               port_out(n, other_flip, other_seat, other[k - 1]))  # fmt: skip
        into = (port_in(n, flip, seat, order[k]), port_in(n, other_flip, other_seat, other[k]))
        stay = best[0] + distance(metric, out[0], into[0])
        go_on = best[1] + distance(metric, out[1], into[1])
        came[k, 1] = True
        if ahead == k - 1:
            back = best[1] + distance(metric, out[1], into[0])
            leave = best[0] + distance(metric, out[0], into[1])
            if back < stay:
                stay, came[k, 0] = back, True
            if leave <= go_on:
                go_on, came[k, 1] = leave, False
        best[0], best[1] = stay, go_on
    taken = np.zeros(n, np.bool_)
    now = n > 0 and best[1] < best[0]
    for k in range(n - 1, -1, -1):
        taken[k] = now
        now = came[k, 1 if now else 0]
    return taken
