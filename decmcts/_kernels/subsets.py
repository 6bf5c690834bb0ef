"""The least travel of a few contours, by dynamic programming over what is printed already.

References
----------
Held & Karp 1962, "A dynamic programming approach to sequencing problems".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.pricing import Ways, way_cost


@kernel
def least_travel(ways: Ways, before: NDArray[np.int64]) -> float:
    """Return the least travel over all linear extensions and ways to print each contour.

    Each way has one pair of points. `before` (n,) holds the predecessors of each
    contour as bits. O(2ⁿ · w²) time for w ways in all, 2ⁿ · w numbers of memory.
    """
    n, count = len(before), len(ways.pairs) - 1
    owner = np.empty(count, np.int64)
    for c in range(n):
        owner[ways.offsets[c] : ways.offsets[c + 1]] = c
    cost = np.empty((count, count))
    for a in range(count):
        for b in range(count):
            cost[a, b] = way_cost(ways, a, b)
    best = np.full((1 << n, count), np.inf)  # by what is printed, and by the last way
    for b in range(count):
        if before[owner[b]] == 0:
            best[1 << owner[b], b] = 0.0
    for done in range(1, (1 << n) - 1):
        for a in range(count):
            travel = best[done, a]
            if travel == np.inf:
                continue
            for b in range(count):
                j = owner[b]
                if not ((done >> j) & 1 or before[j] & ~done):
                    then = done | (1 << j)
                    best[then, b] = min(best[then, b], travel + cost[a, b])
    return float(best[(1 << n) - 1].min())
