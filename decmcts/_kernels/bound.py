"""Longest chains of a dependency graph, on bare arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel


@kernel
def longest_chain(
    seconds: NDArray[np.float64], pred_offsets: NDArray[np.int64], preds: NDArray[np.int32]
) -> float:
    """Largest sum of `seconds` along a path; contours are numbered in a linear extension."""
    end = np.zeros(len(seconds))
    longest = 0.0
    for i in range(len(seconds)):
        ready = 0.0
        for k in range(pred_offsets[i], pred_offsets[i + 1]):
            ready = max(ready, end[preds[k]])
        end[i] = ready + seconds[i]
        longest = max(longest, end[i])
    return longest


@kernel
def chain_behind(
    seconds: NDArray[np.float64], succ_offsets: NDArray[np.int64], succs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Longest sum of `seconds` along a path from each contour on, its own included, (n,)."""
    behind = seconds.copy()
    for i in range(len(seconds) - 1, -1, -1):
        longest = 0.0
        for k in range(succ_offsets[i], succ_offsets[i + 1]):
            longest = max(longest, behind[succs[k]])
        behind[i] += longest
    return behind
