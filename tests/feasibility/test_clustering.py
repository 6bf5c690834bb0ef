"""Highly dependent subgraphs: the paper's properties and its formula."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.clustering import _islands, cluster_contours
from decmcts.feasibility.clustering_kernels import connectedness, mark_neighbours, merge_adjacent
from decmcts.feasibility.graph import DependencyGraph, EdgeKind


def graph_of(n: int, *pairs: tuple[int, int]) -> DependencyGraph:
    return DependencyGraph.from_pairs(n, np.array(pairs, np.int32).reshape(-1, 2))


def gamma(graph: DependencyGraph, i: int, j: int) -> float:
    preds = (graph.pred_offsets, graph.preds)
    succs = (graph.succ_offsets, graph.succs)
    dependee_of, depender_of = np.full((2, graph.n), -1, np.int32)
    mark_neighbours(preds, i, dependee_of)
    mark_neighbours(succs, i, depender_of)
    return float(connectedness(preds, succs, i, j, dependee_of, depender_of))


def assert_topological(graph: DependencyGraph, labels: NDArray[np.int32]) -> None:
    """Ascending labels along every edge: the quotient can't have a cycle."""
    np.testing.assert_array_equal(np.unique(labels), np.arange(labels.max() + 1))
    before, after = labels[graph.pairs()].T
    assert (before <= after).all()


@pytest.mark.parametrize(
    ("pairs", "expected"),
    [
        # i = 3, j = 4 share all three dependees and the only depender: fully connected
        ([(0, 3), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 5), (4, 5)], 1.0),
        # 2 of 3 dependees, 1 of 2 dependers: mean(2/3, 1/2)
        ([(0, 3), (1, 3), (2, 3), (0, 4), (1, 4), (3, 5), (4, 5), (4, 6)], 7 / 12),
        # common dependee, other dependers: mean(1, 0)
        ([(0, 3), (0, 4), (3, 5), (4, 6)], 0.5),
        # neither has a dependee: that side says nothing
        ([(3, 5), (4, 5), (4, 6)], 0.5),
        # one has a depender, the other none
        ([(0, 3), (0, 4), (3, 5)], 0.5),
        # nothing in common
        ([(0, 3), (1, 4), (3, 5), (4, 6)], 0.0),
    ],
)
def test_gamma_by_hand(pairs: list[tuple[int, int]], expected: float) -> None:
    """Eq. 4 of the paper on graphs small enough to count."""
    graph = graph_of(7, *pairs)
    assert gamma(graph, 3, 4) == pytest.approx(expected)
    assert gamma(graph, 4, 3) == pytest.approx(expected)


def towers(oracle: Any, n_towers: int, gap: float, n_layers: int) -> tuple[Any, NDArray[np.int_]]:
    polylines = [
        [(gap * t, 0.0, 0.2 * k), (gap * t + 1, 0.0, 0.2 * k), (gap * t + 1, 1.0, 0.2 * k)]
        for k in range(1, n_layers + 1)
        for t in range(n_towers)
    ]
    return oracle.make_contours(polylines), np.tile(np.arange(n_towers), n_layers)


def test_far_towers_are_one_cluster_each(oracle: Any) -> None:
    """What the paper draws for its four nuts: each part is one macro-action."""
    contours, tower = towers(oracle, 4, 40.0, 30)
    graph = build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0)
    labels = cluster_contours(graph)
    assert labels.max() + 1 == 4
    assert len(set(zip(labels.tolist(), tower.tolist(), strict=True))) == 4


def test_towers_are_cut_by_the_height_of_the_head(oracle: Any) -> None:
    """Above 5 mm this head is wide: no tower may run ahead further, so none is one cluster."""
    head = oracle.head_of((0.0, [oracle.box(-7, -7, 7, 7)]), (5.0, [oracle.box(-99, -9, 99, 9)]))
    low, _ = towers(oracle, 3, 40.0, 25)
    assert cluster_contours(build_graph(low, [head], clearance_mm=0.0)).max() + 1 == 3
    high, tower = towers(oracle, 3, 40.0, 100)
    graph = build_graph(high, [head], clearance_mm=0.0)
    labels = cluster_contours(graph)
    assert_topological(graph, labels)
    for label in range(labels.max() + 1):
        assert len(set(tower[labels == label])) == 1
    assert 6 <= labels.max() + 1 <= 15  # 20 mm high, 5 to 10 mm a cluster


@pytest.mark.parametrize("per_layer", [1, 4])
def test_fully_dependent_stack_is_one_cluster(per_layer: int) -> None:
    """Each layer waits for all of the one below: nothing to decide between."""
    pairs = [
        (layer * per_layer + i, (layer + 1) * per_layer + j)
        for layer in range(9)
        for i in range(per_layer)
        for j in range(per_layer)
    ]
    assert set(cluster_contours(graph_of(10 * per_layer, *pairs))) == {0}


def test_towers_on_one_base_stay_apart() -> None:
    """A common base must not glue what stands on it into one cluster."""
    n = 20
    chains = [(k, k + 2) for k in range(1, n - 2)]
    labels = cluster_contours(graph_of(n, (0, 1), (0, 2), *chains))
    assert set(labels[5::2]).isdisjoint(labels[6::2])
    assert len(set(labels[5::2])) == len(set(labels[6::2])) == 1


@pytest.mark.parametrize("threshold", [0.0, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("seed", range(8))
def test_quotient_never_has_a_cycle(seed: int, threshold: float) -> None:
    """A cycle between subgraphs would leave a planner without any order at all."""
    rng = np.random.default_rng(seed)
    n = 60
    pairs = np.sort(rng.integers(0, n, (int(rng.integers(20, 150)), 2)), axis=1)
    pairs = np.unique(pairs[(pairs[:, 0] != pairs[:, 1])], axis=0).astype(np.int32)
    kinds = rng.choice([EdgeKind.GEOMETRY, EdgeKind.PROCESS], len(pairs), p=[0.9, 0.1])
    graph = DependencyGraph.from_pairs(n, pairs, kinds.astype(np.uint8))
    assert_topological(graph, cluster_contours(graph, threshold=threshold))


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided", "hollow"])
def test_quotient_of_a_print_has_no_cycle(oracle: Any, head: str) -> None:
    """The same on graphs of the kind that matters, with process and state edges."""
    contours = oracle.random_print(3, n_layers=60, per_layer=12, span=120.0)
    graph = build_graph(contours, [oracle.heads[head]], clearance_mm=0.3)
    labels = cluster_contours(graph)
    assert_topological(graph, labels)
    assert labels.max() + 1 < graph.n


def test_higher_threshold_never_merges_what_it_forbids() -> None:
    """With Γ = 1 only what shares everything on its depth stays together."""
    labels = cluster_contours(graph_of(4, (0, 1), (0, 2), (1, 3), (2, 3)), threshold=1.0)
    assert labels.tolist() == [0, 1, 1, 2]


def test_merge_that_closes_a_cycle_is_refused() -> None:
    """0 and 2 are highly connected, but 1 must come between them."""
    graph = graph_of(3, (0, 1), (0, 2), (1, 2))
    depth = np.arange(3, dtype=np.int32)
    only_far = np.array([0.0, 0.9, 0.0])  # of edges (0, 1), (0, 2), (1, 2)
    group = merge_adjacent((graph.pred_offsets, graph.preds), depth, depth, only_far, 0.5)
    assert group[0] != group[2]


def test_process_edges_tie_islands() -> None:
    """Perimeters and infill of one region go together, as a person would have it."""
    pairs = np.array([[0, 1], [2, 3], [1, 4], [3, 4]], np.int32)
    kinds = np.array([EdgeKind.PROCESS] * 2 + [EdgeKind.GEOMETRY] * 2, np.uint8)
    graph = DependencyGraph.from_pairs(5, pairs, kinds)
    assert _islands(graph).tolist() == [0, 0, 1, 1, 2]


def test_islands_in_a_circle_are_left_alone() -> None:
    """A barrier inside a layer can make two islands wait for each other."""
    pairs = np.array([[0, 2], [1, 3], [0, 3], [1, 2]], np.int32)
    kinds = np.array([EdgeKind.PROCESS] * 2 + [EdgeKind.STATE] * 2, np.uint8)
    assert _islands(DependencyGraph.from_pairs(4, pairs, kinds)).tolist() == [0, 1, 2, 3]


def test_small_inputs_and_bad_threshold() -> None:
    """Nothing, one contour, contours without any edge, and a typo."""
    assert len(cluster_contours(graph_of(0))) == 0
    assert cluster_contours(graph_of(1)).tolist() == [0]
    assert sorted(cluster_contours(graph_of(3)).tolist()) == [0, 1, 2]
    with pytest.raises(ValueError, match=r"threshold is 1\.5"):
        cluster_contours(graph_of(1), threshold=1.5)


@pytest.mark.slow
def test_many_that_rest_on_one_take_no_memory_for_each_pair() -> None:
    """Thousands of parts on one raft: a table of their pairs had gigabytes."""
    star = np.array([(0, k) for k in range(1, 3000)], np.int32)
    tracemalloc.start()
    try:
        labels = cluster_contours(DependencyGraph.from_pairs(3000, star))
        assert tracemalloc.get_traced_memory()[1] < 32e6
    finally:
        tracemalloc.stop()
    assert not labels.any()
