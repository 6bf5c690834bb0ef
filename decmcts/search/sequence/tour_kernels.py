"""Whether a sequence keeps precedence, and the longest travel there can be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel
from decmcts.search.sequence.metric_kernels import distance


@kernel
def respects(
    order: NDArray[np.int32], succ_offsets: NDArray[np.int64], succs: NDArray[np.int32]
) -> bool:
    """Say whether `order` is a permutation that breaks no edge."""
    n = len(succ_offsets) - 1
    position = np.full(n, -1, np.int64)
    for k in range(len(order)):
        if order[k] < 0 or order[k] >= n or position[order[k]] >= 0:
            return False
        position[order[k]] = k
    if len(order) != n:
        return False
    for a in range(n):
        for e in range(succ_offsets[a], succ_offsets[a + 1]):
            if position[succs[e]] < position[a]:
                return False
    return True


@kernel
def longest_hop(points: NDArray[np.float64], reversible: NDArray[np.bool_]) -> float:
    """Return the longest travel from an exit of one contour to an entry of another, mm.

    Pairs are tried from the farthest from the centre inwards and cut off by the
    triangle inequality: near linear on real prints, O(n²) at worst.
    """
    n = len(reversible)
    centre = np.array([points[:, 0].mean(), points[:, 1].mean(), points[:, 2].mean()])
    radius = np.sqrt(((points - centre) ** 2).sum(axis=1))
    outward = np.argsort(-radius)
    longest = 0.0
    for x in range(2 * n):
        a = outward[x]
        if a % 2 == 0 and not reversible[a // 2]:
            continue
        for y in range(2 * n):
            b = outward[y]
            if radius[a] + radius[b] <= longest:
                break
            if a // 2 != b // 2 and (b % 2 == 0 or reversible[b // 2]):
                longest = max(longest, distance(points, a, b))
    return longest
