"""Nearest-neighbour lists for local search: which contours may well follow which."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Int32s
from decmcts.search.sequence.neighbours_kernels import keep_possible
from decmcts.search.sequence.problem import OrderProblem

WIDTH, POOL = 10, 40
LAYER_SCALE = 40.0  # heights count this much more: most contours far above or below must wait


def near_ports(problem: OrderProblem) -> Int32s:
    """Return for each exit up to `WIDTH` entry ports near it, (2n + anchors, WIDTH), -1 padded.

    Port 2c is the start of contour c and 2c + 1 its end; 2n + o is entry o of a loop
    that may be entered elsewhere. Of the entries only the anchors are listed, and
    have rows (`Seams.rows`). The lists are drawn from the `POOL` nearest; contours
    that precedence keeps from following are left out.
    """
    n = len(problem)
    if n == 0:
        return np.full((0, WIDTH), -1, np.int32)
    scale, seams = np.array([1.0, 1.0, LAYER_SCALE]), problem.seams
    exits = entries = problem.ports() * scale
    usable = np.ones(2 * n, np.bool_)
    usable[1::2] = problem.reversible
    row_offsets, owner, anchors = np.zeros(n + 1, np.int64), np.empty(0, np.int32), np.arange(0)
    if seams is not None:
        row_offsets, owner, anchors = seams.row_offsets, seams.owner, seams.anchors
        usable &= np.repeat(np.diff(row_offsets) == 0, 2)
        exits = np.concatenate([exits, seams.leave[anchors] * scale])
        entries = np.concatenate([entries, seams.enter * scale])
    ids = np.concatenate([np.flatnonzero(usable), 2 * n + anchors])
    k = min(POOL, len(ids))
    _, index = cKDTree(entries[ids]).query(exits, k=np.arange(1, k + 1), workers=2)
    graph = problem.graph
    return keep_possible(
        ids[index],
        WIDTH,
        row_offsets,
        owner,
        problem.reversible,
        graph.pred_offsets,
        graph.preds,
        graph.succ_offsets,
        graph.succs,
    )
