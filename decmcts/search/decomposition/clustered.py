"""A problem as clusters of contours that depend on much the same others, for tree search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from decmcts._kernels.trees.rollout import Clustered, Rollout
from decmcts.search.sequence.problem import OrderProblem


def clustered_problem(problem: OrderProblem, labels: NDArray[np.int32]) -> Clustered:
    """Join a problem with the cluster of each contour.

    Clusters that depend on each other in a cycle could never be printed one
    after the other; they become one cluster.
    """
    labels = _without_cycles(problem, labels)
    graph, n_clusters = problem.graph, int(labels.max(initial=-1)) + 1
    pairs = labels[graph.pairs()]
    outer = pairs[pairs[:, 0] != pairs[:, 1], 1]
    sizes = np.bincount(labels, minlength=n_clusters)
    return Clustered(
        problem.metric(),
        problem.reversible,
        graph.pred_offsets,
        graph.succ_offsets,
        graph.succs,
        labels,
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        np.argsort(labels, kind="stable").astype(np.int32),
        np.bincount(outer, minlength=n_clusters).astype(np.int32),
    )


def _without_cycles(problem: OrderProblem, labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return labels 0..h - 1 whose cluster graph has no cycle, by merging those on one."""
    ids, dense = np.unique(labels, return_inverse=True)
    pairs = dense[problem.graph.pairs()]
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(ids), len(ids)))
    _, component = connected_components(links, directed=True, connection="strong")
    return np.ascontiguousarray(component[dense], np.int32)


def fresh_rollout(clustered: Clustered) -> Rollout:
    """Return working arrays for rollouts of a problem."""
    n, n_clusters = len(clustered.label), len(clustered.outer_preds)
    return Rollout(
        np.zeros(n, np.int32),
        np.zeros(n, np.uint8),
        np.zeros(n, np.int32),
        np.zeros(n_clusters, np.int32),
        np.zeros(n_clusters, np.int32),
        np.zeros(n, np.int32),
        np.zeros(3, np.int64),
        np.zeros(1),
    )
