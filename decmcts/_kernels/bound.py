"""Longest chains and the work behind each contour of a dependency graph, on bare arrays."""

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


BLOCK = 64  # words of 64 contours handled at once; bounds the memory


@kernel
def work_behind(
    seconds: NDArray[np.float64], succ_offsets: NDArray[np.int64], succs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Sum of `seconds` over all that must come after each contour, (n,); O(n² / 64) words."""
    n = len(seconds)
    behind = np.zeros(n)
    for first in range(0, n, 64 * BLOCK):
        width = min(BLOCK, (n - first + 63) // 64)
        sums = byte_sums(seconds, first, width)
        bits = np.zeros((n, width), np.uint64)
        for i in range(n - 1, -1, -1):
            for k in range(succ_offsets[i], succ_offsets[i + 1]):
                s = succs[k]
                for w in range(width):
                    bits[i, w] |= bits[s, w]
                at = s - first
                if 0 <= at < 64 * width:
                    bits[i, at // 64] |= np.uint64(1) << np.uint64(at % 64)
            behind[i] += weigh(bits[i], sums)
    return behind


@kernel
def byte_sums(seconds: NDArray[np.float64], first: int, width: int) -> NDArray[np.float64]:
    """Sum of `seconds` for every value of every byte of a block, (8·width, 256)."""
    sums = np.zeros((8 * width, 256))
    for byte in range(8 * width):
        for value in range(256):
            for bit in range(8):
                contour = first + 8 * byte + bit
                if (value >> bit) & 1 and contour < len(seconds):
                    sums[byte, value] += seconds[contour]
    return sums


@kernel
def weigh(words: NDArray[np.uint64], sums: NDArray[np.float64]) -> float:
    """Sum of what the set bits stand for."""
    total = 0.0
    for w in range(len(words)):
        word = words[w]
        byte = 8 * w
        while word != np.uint64(0):
            total += sums[byte, np.int64(word & np.uint64(255))]
            word >>= np.uint64(8)
            byte += 1
    return total
