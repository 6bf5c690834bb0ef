"""Tiny problems: searching them compiles the kernels that a real search needs."""

from __future__ import annotations

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.sequence.problem import OrderProblem, Seams


def row_of(n: int, *, loops: bool = False) -> OrderProblem:
    """Return `n` contours in a row; the last one lies above and depends on the first.

    With `loops` each may be entered at either of its two ends.
    """
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    start[-1, 2] = 0.2
    graph = DependencyGraph.from_pairs(n, np.array([[0, n - 1]], np.int32))
    layer = (start[:, 2] > 0.0).astype(np.int32)
    end, either = start[::-1].copy(), np.ones(n, np.bool_)
    if not loops:
        return OrderProblem(start, end, either, layer, graph)
    ends = np.stack([start, end], axis=1).reshape(-1, 3)
    seams = Seams(2 * np.arange(n + 1), ends, ends.copy(), np.tile([0, 1], n).astype(np.int32))
    return OrderProblem(start, start.copy(), ~either, layer, graph, seams=seams)
