"""How often a chain of the dependency graph leaves a set, on bare arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel


@kernel
def most_exits(
    pred_offsets: NDArray[np.int64], preds: NDArray[np.int32], inside: NDArray[np.bool_]
) -> int:
    """Return the most steps from inside to outside along a chain; O(edges).

    Contours are numbered in a linear extension.
    """
    exits = np.zeros(len(inside), np.int64)
    most = 0
    for b in range(len(inside)):
        for e in range(pred_offsets[b], pred_offsets[b + 1]):
            a = preds[e]
            left = exits[a] + (1 if inside[a] and not inside[b] else 0)
            exits[b] = max(exits[b], left)
        most = max(most, exits[b])
    return most
