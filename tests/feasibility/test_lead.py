"""The limit to how far a part runs ahead, against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.feasibility.build import closure_of
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.feasibility.rules import limit_lead

NOTHING = np.empty((0, 2), np.int32)


def before(graph: DependencyGraph) -> np.ndarray:
    bits = np.unpackbits(closure_of(graph).view(np.uint8), axis=1, bitorder="little")
    return bits[:, : graph.n].astype(bool)


@pytest.mark.parametrize("layers", [0, 1, 2, 5])
@pytest.mark.parametrize("n", [60, 400])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_runs_further_ahead(layers: int, n: int, seed: int) -> None:
    """All of layer L comes before all of layer L + N + 1; layers may be missing or of any size.

    On small layers nothing else is asked; on large ones the edges stay few.
    """
    rng = np.random.default_rng(seed)
    layer = np.sort(rng.choice(np.arange(30), 12, replace=False)[rng.integers(0, 12, n)])
    rank = np.unique(layer, return_inverse=True)[1]
    own = np.sort(rng.integers(0, n, (n // 2, 2)), axis=1)
    own = own[(own[:, 0] < own[:, 1]) & (rank[own[:, 0]] == rank[own[:, 1]])]
    on = [(int(rng.choice(np.flatnonzero(rank == rank[b] - 1))), b) for b in range(n) if rank[b]]
    pairs = np.unique(np.concatenate([own, on]), axis=0).astype(np.int32)
    bare = DependencyGraph.from_pairs(n, pairs)
    graph = limit_lead(bare, layer.astype(np.int32), layers=layers)
    due = rank[:, None] > rank[None, :] + layers
    known = before(bare)
    assert (before(graph) >= (due | known)).all()
    if n == 60:
        np.testing.assert_array_equal(before(graph), closed(due | known))
    assert graph.n_edges <= 10 * n
    assert set(graph.kinds.tolist()) <= {EdgeKind.LEAD, EdgeKind.GEOMETRY}


@pytest.mark.parametrize("layers", [0, 1, 3])
def test_what_rests_on_nothing_is_limited_too(layers: int) -> None:
    """A part that begins in mid-air, on nothing of the layer below it, waits all the same."""
    layer = np.repeat(np.arange(8), 3).astype(np.int32)
    graph = limit_lead(DependencyGraph.from_pairs(24, NOTHING), layer, layers=layers)
    assert (before(graph) >= (layer[:, None] > layer[None, :] + layers)).all()


def closed(relation: np.ndarray) -> np.ndarray:
    for k in range(len(relation)):
        relation |= relation[:, k, None] & relation[None, k]
    return relation


def test_up_to_the_limit_the_order_is_free() -> None:
    """Two towers of ten layers, four ahead: each waits only where the other is due."""
    layer = np.repeat(np.arange(10), 2).astype(np.int32)
    towers = np.array([(c, c + 2) for c in range(18)], np.int32)
    graph = limit_lead(DependencyGraph.from_pairs(20, towers), layer, layers=4)
    first, second = 2 * np.arange(10), 2 * np.arange(10) + 1
    relation = before(graph)
    assert not relation[first[4], second[0]]  # the first tower may be at layer 4 ...
    assert relation[first[5], second[0]]  # ... but not at 5 before the second has layer 0
    assert not relation[second[4], first[0]]
    assert relation[second[5], first[0]]


def test_objects_printed_one_by_one_are_limited_each_for_itself() -> None:
    """The source must stay a solution: going down again is its own order, no mistake."""
    layer = np.array([0, 1, 2, 0, 1, 2], np.int32)
    graph = limit_lead(DependencyGraph.from_pairs(6, NOTHING), layer, layers=0)
    assert graph.pairs().tolist() == [[0, 1], [1, 2], [3, 4], [4, 5]]


def test_an_edge_that_is_there_keeps_its_kind() -> None:
    """The reason shown is the one that can not be negotiated."""
    known = DependencyGraph.from_pairs(2, np.array([[0, 1]], np.int32))
    graph = limit_lead(known, np.array([0, 1], np.int32), layers=0)
    assert graph.kinds.tolist() == [EdgeKind.GEOMETRY]


def test_the_smallest_prints_and_a_negative_limit() -> None:
    """One spiral contour has nothing to run ahead of."""
    for n in (0, 1):
        graph = DependencyGraph.from_pairs(n, NOTHING)
        assert limit_lead(graph, np.zeros(n, np.int32), layers=0).n_edges == 0
    with pytest.raises(ValueError, match="-1 layers"):
        limit_lead(DependencyGraph.from_pairs(1, NOTHING), np.zeros(1, np.int32), layers=-1)
