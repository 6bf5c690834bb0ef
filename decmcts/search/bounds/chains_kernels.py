"""Chains of a dependency graph: the longest, exits of sets, ancestors; on bare arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel

UNRELATED, COVERED, FAR = 0, 1, 2  # what an earlier contour is to a later one


@kernel
def chain_behind(seconds: Floats, succ_offsets: Ints, succs: Int32s) -> Floats:
    """Longest sum of `seconds` along a path from each contour on, its own included, (n,).

    Contours are numbered in a linear extension.
    """
    behind = seconds.copy()
    for i in range(len(seconds) - 1, -1, -1):
        longest = 0.0
        for k in range(succ_offsets[i], succ_offsets[i + 1]):
            longest = max(longest, behind[succs[k]])
        behind[i] += longest
    return behind


@kernel
def most_exits(pred_offsets: Ints, preds: Int32s, inside: Flags) -> int:
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


@kernel
def ancestry(offsets: Ints, earlier: Int32s, pred_offsets: Ints, preds: Int32s) -> NDArray[np.int8]:
    """Tell what contours are to later ones, (m,): UNRELATED, COVERED or FAR.

    Contour b is asked about earlier[offsets[b]:offsets[b + 1]], all of them before it in the
    linear extension. COVERED are predecessors with nothing forced between the two, FAR the
    other ancestors. Walks those ancestors of b that are not before all it is asked about.
    """
    n = len(offsets) - 1
    found = np.zeros(len(earlier), np.int8)
    seen, kind = np.full(n, -1, np.int64), np.zeros(n, np.int8)
    stack = np.empty(n, np.int32)
    for b in range(n):
        if offsets[b] == offsets[b + 1]:
            continue
        low = earlier[offsets[b] : offsets[b + 1]].min()
        seen[b], kind[b], stack[0] = b, UNRELATED, b
        waiting = 1
        while waiting:
            waiting -= 1
            x = stack[waiting]
            reached = COVERED if x == b else FAR
            for k in range(pred_offsets[x], pred_offsets[x + 1]):
                a = preds[k]
                if a < low:
                    continue
                if seen[a] != b:
                    seen[a], kind[a], stack[waiting] = b, reached, a
                    waiting += 1
                elif reached == FAR:
                    kind[a] = FAR
        for k in range(offsets[b], offsets[b + 1]):
            if seen[earlier[k]] == b:
                found[k] = kind[earlier[k]]
    return found
