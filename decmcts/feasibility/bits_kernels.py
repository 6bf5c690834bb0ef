"""Sets as rows of 64-bit words: counting, and closures too large to keep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel


@kernel
def count_bits(word: np.uint64) -> int:
    """Return the number of set bits."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def count_common(one: NDArray[np.uint64], other: NDArray[np.uint64]) -> int:
    """Return how many bits two rows share."""
    total = 0
    for w in range(len(one)):
        total += count_bits(one[w] & other[w])
    return total


@kernel
def add_ancestor_counts(
    pred_offsets: NDArray[np.int64],
    preds: NDArray[np.int32],
    first: int,
    rows: NDArray[np.uint64],
    counts: NDArray[np.int64],
) -> None:
    """Add to `counts` each node's ancestors among first..first + 64 * columns of `rows`.

    Leaves those ancestors as bits in `rows`, one row for each node from `first` on.
    """
    for b in range(first, len(counts)):
        row = rows[b - first]
        row[:] = np.uint64(0)
        for e in range(pred_offsets[b], pred_offsets[b + 1]):
            a = preds[e] - first
            if a < 0:
                continue
            for w in range(len(row)):
                row[w] |= rows[a, w]
            if a < 64 * len(row):
                row[a // 64] |= np.uint64(1) << np.uint64(a % 64)
        counts[b] += count_common(row, row)
