"""Longest chain of a dependency graph by weight, on bare arrays."""

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
