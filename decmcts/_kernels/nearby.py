"""Candidate successors: entry ports near an exit port that may directly follow it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel

_MOST_VISITED = 300  # contours looked at around one; farther relatives stay candidates


@kernel
def _mark_relatives(
    c: int,
    stamp: NDArray[np.int32],
    queue: NDArray[np.int32],
    offsets: NDArray[np.int64],
    others: NDArray[np.int32],
    skip_first: bool,
) -> None:
    """Mutate `stamp`: set it to c for relatives of c in one direction, nearest first.

    With `skip_first` the direct relatives stay unmarked unless they are also
    relatives of relatives.
    """
    queue[0] = c
    head, tail = 0, 1
    while head < tail:
        a = queue[head]
        for e in range(offsets[a], offsets[a + 1]):
            b = others[e]
            if stamp[b] == c:
                continue
            if head > 0 or not skip_first:
                stamp[b] = c
            if tail < _MOST_VISITED:
                queue[tail] = b
                tail += 1
        head += 1


@kernel
def keep_possible(
    found: NDArray[np.int64],
    width: int,
    turns: NDArray[np.bool_],
    pred_offsets: NDArray[np.int64],
    preds: NDArray[np.int32],
    succ_offsets: NDArray[np.int64],
    succs: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Return the first `width` ports of each row of `found` that may directly follow, -1 padded.

    Row q of `found` (2n, k) are ports by distance from port q. Dropped are the
    contour itself, its predecessors, contours that must follow it only after
    another, and ends of contours that may not turn.
    """
    n = len(turns)
    near = np.full((2 * n, width), -1, np.int32)
    stamp = np.full(n, -1, np.int32)
    queue = np.empty(_MOST_VISITED, np.int32)
    for c in range(n):
        _mark_relatives(c, stamp, queue, pred_offsets, preds, False)
        _mark_relatives(c, stamp, queue, succ_offsets, succs, True)
        for q in range(2 * c, 2 * c + 2):
            kept = 0
            for x in range(found.shape[1]):
                port = found[q, x]
                d = port >> 1
                if port >= 2 * n or d == c or stamp[d] == c or (port & 1 and not turns[d]):
                    continue
                if kept < width:
                    near[q, kept] = port
                    kept += 1
    return near
