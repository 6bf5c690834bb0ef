"""Candidate successors: entry ports near an exit port that may directly follow it."""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.compiled import kernel

_MOST_VISITED = 300  # contours looked at around one; farther relatives stay candidates


@kernel
def _mark_relatives(
    c: int,
    stamp: Int32s,
    queue: Int32s,
    offsets: Ints,
    others: Int32s,
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
    found: Ints,
    width: int,
    row_offsets: Ints,
    entry_owner: Int32s,
    reversible: Flags,
    pred_offsets: Ints,
    preds: Int32s,
    succ_offsets: Ints,
    succs: Int32s,
) -> Int32s:
    """Return the first `width` ports of each row of `found` that may directly follow, -1 padded.

    Row q of `found` are ports by distance from exit q: rows 2c and 2c + 1 of contour
    c, or 2n + row_offsets[c] onwards where it has entries; a port of 2n + o is entry
    o. Dropped are the contour itself, its predecessors, contours that must follow it
    only after another, ends of contours that may not be reversed, and more than two ports
    of one contour.
    """
    n = len(reversible)
    near = np.full((len(found), width), -1, np.int32)
    stamp = np.full(n, -1, np.int32)
    queue = np.empty(_MOST_VISITED, np.int32)
    for c in range(n):
        _mark_relatives(c, stamp, queue, pred_offsets, preds, False)
        _mark_relatives(c, stamp, queue, succ_offsets, succs, True)
        first, last = 2 * c, 2 * c + 2
        if row_offsets[c] < row_offsets[c + 1]:
            first, last = 2 * n + row_offsets[c], 2 * n + row_offsets[c + 1]
        for q in range(first, last):
            kept = 0
            for x in range(found.shape[1]):
                port = found[q, x]
                if kept == width or port >= 2 * n + len(entry_owner):
                    break
                d = port >> 1 if port < 2 * n else entry_owner[port - 2 * n]
                if d == c or stamp[d] == c or (port < 2 * n and port & 1 and not reversible[d]):
                    continue
                known = 0
                for y in range(kept):
                    other = near[q, y]
                    known += int(other >= 2 * n and entry_owner[other - 2 * n] == d)
                if known < 2:
                    near[q, kept] = port
                    kept += 1
    return near
