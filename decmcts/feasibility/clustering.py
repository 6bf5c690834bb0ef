"""Highly dependent subgraphs: Alg. 1 of Yoo et al. 2020 on the reduced graph.

What the paper leaves open is decided here, so that clusters mean something on
any print:

1. *Depth* of a contour is the number of edges on the longest path to it.
2. *Contour clusters* (lines 2-4): two contours of one depth that share a
   dependee or a depender are compared; dependees and dependers are those of the
   stored, transitively reduced edges, and a side on which neither has any is
   left out of the mean. Those with gamma >= threshold end up together, also
   through others.
3. *Adjacent subgraphs* (lines 5-11): u and v with an edge between them are
   compared by all that they depend on and all that depends on them in the
   graph of the subgraphs, the pair itself left out. Where gamma > threshold v
   joins u, unless that would close a cycle, or the subgraph already holds
   something at v's depth (both would then have been one contour cluster were
   they highly connected). Sweeps repeat until nothing changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.clustering import (
    Neighbours,
    add_ancestor_counts,
    cluster_depths,
    depths,
    edge_gammas,
    merge_adjacent,
    topological_ranks,
)
from decmcts.feasibility.graph import DependencyGraph

ROWS_BYTES = 256 * 2**20  # memory of the bit rows that count ancestors


def cluster_contours(graph: DependencyGraph, *, threshold: float = 0.5) -> NDArray[np.int32]:
    """Return the subgraph of each contour, numbered in a topological order.

    Parameters
    ----------
    graph : DependencyGraph
        Its stored edges must be transitively reduced, as `build_graph` makes them.
    threshold : float
        The paper's Γ, 0..1: subgraphs at least this connected become one.

    Returns
    -------
    NDArray[np.int32]
        (n,) labels from 0; the quotient has no cycle and every edge between two
        subgraphs goes from the lower to the higher label.

    Raises
    ------
    ValueError
        If `threshold` is outside 0..1.

    References
    ----------
    Yoo et al. 2020, Sec. III-B, Eq. 4 and Alg. 1.
    """
    if not 0.0 <= threshold <= 1.0:
        raise ValueError(f"threshold is {threshold}, it must be within 0..1")
    if graph.n == 0:
        return np.empty(0, np.int32)
    depth = depths((graph.pred_offsets, graph.preds))
    labels = _contour_clusters(graph, depth, threshold)
    while True:
        quotient = _quotient(graph, labels)
        first = np.full(quotient.n, graph.n, np.int32)
        last = np.zeros(quotient.n, np.int32)
        np.minimum.at(first, labels, depth)
        np.maximum.at(last, labels, depth)
        group = merge_adjacent(_preds(quotient), first, last, _gammas(quotient), threshold)
        merged = _in_topological_order(quotient, group)
        if int(merged.max()) + 1 == quotient.n:
            return labels
        labels = merged[labels]


def _preds(graph: DependencyGraph) -> Neighbours:
    return graph.pred_offsets, graph.preds


def _contour_clusters(
    graph: DependencyGraph, depth: NDArray[np.int32], threshold: float
) -> NDArray[np.int32]:
    """Return the contour clusters of all depths, numbered by depth, then first contour."""
    root = cluster_depths(_preds(graph), (graph.succ_offsets, graph.succs), depth, threshold)
    first = np.full(graph.n, graph.n, np.int64)
    np.minimum.at(first, root, np.arange(graph.n))
    key = depth.astype(np.int64) * (graph.n + 1) + first[root]
    return np.asarray(np.unique(key, return_inverse=True)[1], np.int32)


def _quotient(graph: DependencyGraph, labels: NDArray[np.int32]) -> DependencyGraph:
    pairs = labels[graph.pairs()]
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    return DependencyGraph.from_pairs(int(labels.max()) + 1, pairs)


def _gammas(quotient: DependencyGraph) -> NDArray[np.float64]:
    n = quotient.n
    mirrored = DependencyGraph.from_pairs(n, (n - 1 - quotient.pairs())[:, ::-1])
    return np.asarray(
        edge_gammas(
            _preds(quotient), _ancestor_counts(quotient), _ancestor_counts(mirrored)[::-1].copy()
        )
    )


def _ancestor_counts(graph: DependencyGraph) -> NDArray[np.int64]:
    """Return how many nodes each node depends on, (n,); at most ROWS_BYTES of memory."""
    n_words = -(-graph.n // 64)
    columns = max(1, min(n_words, ROWS_BYTES // (8 * graph.n)))
    counts = np.zeros(graph.n, np.int64)
    for first in range(0, n_words, columns):
        width = min(columns, n_words - first)
        rows = np.empty((graph.n - first * 64, width), np.uint64)
        add_ancestor_counts(_preds(graph), first * 64, rows, counts)
    return counts


def _in_topological_order(quotient: DependencyGraph, group: NDArray[np.int32]) -> NDArray[np.int32]:
    """Renumber groups so that every edge between two of them ascends."""
    n = int(group.max()) + 1
    pairs = group[quotient.pairs()]
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    offsets = np.searchsorted(pairs[:, 0], np.arange(n + 1))
    waiting = np.bincount(pairs[:, 1], minlength=n)
    rank = topological_ranks((offsets, np.ascontiguousarray(pairs[:, 1])), waiting)
    assert rank.min() >= 0, "merging closed a cycle"
    return np.asarray(rank[group])
