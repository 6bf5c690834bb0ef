"""Highly dependent subgraphs: Alg. 1 of Yoo et al. 2020 on the reduced graph.

What the paper leaves open is decided here, so that clusters mean something on
any print:

0. *Islands*: contours tied by PROCESS edges, which the paper does not have (the
   perimeters and the infill of one region of a layer), are one node from the
   start. With `--process-order free` each contour is its own island.
1. *Depth* is the number of edges on the longest path to a node.
2. *Contour clusters* (lines 2-4): two nodes of one depth that share a dependee
   or a depender are compared; dependees and dependers are those of the stored,
   transitively reduced edges, and a side on which neither has any is left out
   of the mean. Those with gamma >= threshold end up together, also through
   others.
3. *Adjacent subgraphs* (lines 5-11): u and v with an edge between them are
   compared by all that they depend on and all that depends on them in the graph
   of the subgraphs, the pair itself left out. Where gamma > threshold v joins u,
   unless that would close a cycle, or the subgraph already holds something at
   v's depth (which then is not highly connected with v). Sweeps repeat until
   nothing changes.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.feasibility.build import closure_of
from decmcts.feasibility.clustering_kernels import (
    Neighbours,
    cluster_depths,
    depths,
    edge_gammas,
    merge_adjacent,
    topological_ranks,
)
from decmcts.feasibility.graph import DependencyGraph, EdgeKind


def cluster_contours(graph: DependencyGraph, *, threshold: float = 0.5) -> Int32s:
    """Return the subgraph of each contour, numbered in a topological order.

    Parameters
    ----------
    graph : DependencyGraph
        Its stored edges must be transitively reduced, as `build_graph` makes them.
    threshold : float
        The paper's Γ, 0..1: subgraphs more connected than this become one.

    Returns
    -------
    Int32s
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
    island = _islands(graph)
    islands = _quotient(graph, island)
    depth = depths(_preds(islands))
    root = cluster_depths(_preds(islands), _succs(islands), depth, threshold)
    labels = _merge(islands, _by_depth(root, depth), depth, threshold)
    return labels[island]


def _islands(graph: DependencyGraph) -> Int32s:
    """Return labels, in topological order, of the contours that PROCESS edges tie.

    Where barriers inside a layer make islands wait for each other in a circle,
    every contour is left alone.
    """
    tied = graph.pairs()[graph.kinds == EdgeKind.PROCESS]
    ones = np.ones(len(tied), np.int8)
    ties = coo_array((ones, (tied[:, 0], tied[:, 1])), shape=(graph.n, graph.n))
    island = connected_components(ties, directed=False)[1].astype(np.int32)
    ranks = _ranks(island[graph.pairs()], int(island.max()) + 1)
    if ranks.min() < 0:
        return np.arange(graph.n, dtype=np.int32)
    return np.asarray(ranks[island])


def _merge(
    graph: DependencyGraph,
    labels: Int32s,
    depth: Int32s,
    threshold: float,
) -> Int32s:
    """Merge adjacent subgraphs, until nothing changes."""
    while True:
        quotient = _quotient(graph, labels)
        first = np.full(quotient.n, graph.n, np.int32)
        last = np.zeros(quotient.n, np.int32)
        np.minimum.at(first, labels, depth)
        np.maximum.at(last, labels, depth)
        group = merge_adjacent(_preds(quotient), first, last, _gammas(quotient), threshold)
        n_groups = int(group.max()) + 1
        if n_groups == quotient.n:
            return labels
        labels = _ranks(group[quotient.pairs()], n_groups)[group][labels]


def _preds(graph: DependencyGraph) -> Neighbours:
    return graph.pred_offsets, graph.preds


def _succs(graph: DependencyGraph) -> Neighbours:
    return graph.succ_offsets, graph.succs


def _by_depth(root: Int32s, depth: Int32s) -> Int32s:
    """Return labels of the sets with these roots, numbered by depth, then first member."""
    n = len(root)
    first = np.full(n, n, np.int64)
    np.minimum.at(first, root, np.arange(n))
    key = depth.astype(np.int64) * (n + 1) + first[root]
    return np.asarray(np.unique(key, return_inverse=True)[1], np.int32)


def _quotient(graph: DependencyGraph, labels: Int32s) -> DependencyGraph:
    n = int(labels.max()) + 1
    return DependencyGraph.from_pairs(n, _between(labels[graph.pairs()], n))


def _between(pairs: Int32s, n: int) -> Int32s:
    """Return the different pairs (m, 2) whose ends differ, sorted."""
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    keys = np.sort(pairs[:, 0].astype(np.int64) * n + pairs[:, 1])  # np.unique is 5x slower
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack([keys // n, keys % n], axis=1).astype(np.int32)


def _ranks(pairs: Int32s, n: int) -> Int32s:
    """Return a topological order of n nodes as (n,) places, -1 on or behind a cycle."""
    pairs = _between(pairs, n)
    offsets = np.searchsorted(pairs[:, 0], np.arange(n + 1))
    waiting = np.bincount(pairs[:, 1], minlength=n)
    return np.asarray(
        topological_ranks((offsets, np.ascontiguousarray(pairs[:, 1])), waiting), np.int32
    )


def _gammas(quotient: DependencyGraph) -> Floats:
    """Return the connectedness of each stored edge of the quotient, (m,)."""
    n = quotient.n
    mirrored = DependencyGraph.from_pairs(n, (n - 1 - quotient.pairs())[:, ::-1])
    after = _ancestor_counts(mirrored)[::-1].copy()
    return np.asarray(edge_gammas(_preds(quotient), _ancestor_counts(quotient), after))


def _ancestor_counts(graph: DependencyGraph) -> Ints:
    """Return how many nodes each node depends on, (n,); takes n² / 8 bytes."""
    return np.asarray(np.bitwise_count(closure_of(graph)).sum(axis=1, dtype=np.int64))
