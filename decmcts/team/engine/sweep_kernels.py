"""An order of contours group by group, within a group always the nearest next."""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel


@kernel
def not_before(group: Ints, pred_offsets: Ints, preds: Int32s) -> None:
    """Move each contour to the group of the last that must come before it, if that is later."""
    for c in range(len(group)):  # numbered so that what comes before has a lower number
        for k in range(pred_offsets[c], pred_offsets[c + 1]):
            group[c] = max(group[c], group[preds[k]])


@kernel
def with_stragglers(
    natural: Ints,
    group: Ints,
    head: Ints,
    eligible: Flags,
    pred_offsets: Ints,
    preds: Int32s,
) -> Flags:
    """Give what was moved to a later group to the head it waited for, if that may print it.

    Parameters
    ----------
    natural, group : (n,) groups before and after `not_before`
    head : (n,) who prints each; changed
    eligible : (n, heads) who may print each

    Returns
    -------
    Flags
        Which contours should come first in their groups: those that were moved, as they lie
        where the heads have been already, and what must be printed before them, (n,).
    """
    first = group > natural
    for c in range(len(group)):
        for k in range(pred_offsets[c], pred_offsets[c + 1]):
            before = preds[k]
            if first[c] and group[before] == group[c] and eligible[c, head[before]]:
                head[c] = head[before]
    for c in range(len(group) - 1, -1, -1):
        for k in range(pred_offsets[c], pred_offsets[c + 1]):
            if first[c] and group[preds[k]] == group[c]:
                first[preds[k]] = True
    return first


@kernel
def nearest_by_group(
    group: Ints,
    head: Ints,
    ends: Floats,
    reversible: Flags,
    at: Floats,
    pred_offsets: Ints,
    preds: Int32s,
) -> tuple[Int32s, Flags]:
    """Return an order of all contours, and which of them run reversed, (n,) each.

    Parameters
    ----------
    group : (n,) groups follow one another by number; nothing has to come before a lower one
    head : (n,) who prints each
    ends : (n, 2, 3) where each begins and ends as sliced, mm
    at : (heads, 3) where the heads are; changed
    """
    n = len(group)
    members = np.argsort(group, kind="mergesort")
    order, backwards = np.empty(n, np.int32), np.zeros(n, np.bool_)
    printed = np.zeros(n, np.bool_)
    i = 0
    while i < n:
        j = i
        while j < n and group[members[j]] == group[members[i]]:
            j += 1
        for turn in range(i, j):
            best, best_d, best_k, best_back = -1, np.inf, -1, False
            for k in range(turn, j):
                c = members[k]
                free = True
                for e in range(pred_offsets[c], pred_offsets[c + 1]):
                    free = free and printed[preds[e]]
                if not free:
                    continue
                for side in range(2 if reversible[c] else 1):
                    d = 0.0
                    for axis in range(3):
                        d += (ends[c, side, axis] - at[head[c], axis]) ** 2
                    if d < best_d:
                        best, best_d, best_k, best_back = c, d, k, side == 1
            order[turn], backwards[turn], printed[best] = best, best_back, True
            members[best_k] = members[turn]
            members[turn] = best
            at[head[best]] = ends[best, 0 if best_back else 1]
        i = j
    return order, backwards
