"""Nearest-neighbour lists for local search: which contours may well follow which."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts._kernels.nearby import keep_possible
from decmcts.search.problem import OrderProblem

LAYER_STRETCH = 20.0  # heights count this much more: most contours far above or below must wait


def near_ports(problem: OrderProblem, *, width: int = 10, pool: int = 40) -> NDArray[np.int32]:
    """Return for each port up to `width` entry ports near it, (2n, width), -1 padded.

    Port 2c is the start of contour c and 2c + 1 its end. The lists are drawn from
    the `pool` nearest; contours that precedence keeps from following are left out.
    """
    n = len(problem)
    if problem.costs is not None:
        return _cheap_successors(problem, width)
    if n == 0:
        return np.full((0, width), -1, np.int32)
    ports = problem.ports() * np.array([1.0, 1.0, LAYER_STRETCH])
    usable = np.ones(2 * n, np.bool_)
    usable[1::2] = problem.reversible
    ids = np.flatnonzero(usable)
    k = min(pool, len(ids))
    _, index = cKDTree(ports[ids]).query(ports, k=np.arange(1, k + 1))
    graph = problem.graph
    return keep_possible(
        ids[index],
        width,
        problem.reversible,
        graph.pred_offsets,
        graph.preds,
        graph.succ_offsets,
        graph.succs,
    )


def _cheap_successors(problem: OrderProblem, width: int) -> NDArray[np.int32]:
    """Return the cheapest possible successors of each node by bare costs, as entry ports."""
    n, graph = len(problem), problem.graph
    assert problem.costs is not None
    costs = problem.costs.copy()
    np.fill_diagonal(costs, np.inf)
    found = 2 * np.argsort(costs, axis=1, kind="stable")[:, : max(n - 1, 1)]
    return keep_possible(
        np.repeat(found, 2, axis=0),
        width,
        problem.reversible,
        graph.pred_offsets,
        graph.preds,
        graph.succ_offsets,
        graph.succs,
    )
