"""The least travel of a few contours, by dynamic programming over what is printed already.

References
----------
Held & Karp 1962, "A dynamic programming approach to sequencing problems".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel


@kernel
def least_travel(
    lengths: NDArray[np.float64], turns: NDArray[np.bool_], before: NDArray[np.int64]
) -> float:
    """Return the least travel over all linear extensions and directions, mm.

    `lengths` (2n, 2n) are the distances of ports, `before` (n,) the predecessors
    of each contour as bits. O(2ⁿ · n²) time, 2ⁿ · 2n numbers of memory.
    """
    n = len(turns)
    best = np.full((1 << n, 2 * n), np.inf)  # by what is printed, and by the last exit port
    for j in range(n):
        if before[j] == 0:
            best[1 << j, 2 * j + 1] = 0.0
            best[1 << j, 2 * j] = 0.0 if turns[j] else np.inf
    for done in range(1, (1 << n) - 1):
        for j in range(n):
            if (done >> j) & 1 or before[j] & ~done:
                continue
            then = done | (1 << j)
            for a in range(2 * n):
                travel = best[done, a]
                if travel == np.inf:
                    continue
                best[then, 2 * j + 1] = min(best[then, 2 * j + 1], travel + lengths[a, 2 * j])
                if turns[j]:
                    best[then, 2 * j] = min(best[then, 2 * j], travel + lengths[a, 2 * j + 1])
    return float(best[(1 << n) - 1].min())
