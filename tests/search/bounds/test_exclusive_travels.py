"""No order may use two of some exclusive travels, or the bound would be wrong."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from decmcts.feasibility.build import closure_of
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.bounds.exclusive_travels import ExclusiveTravels, find_exclusive_travels
from decmcts.search.bounds.pricing_kernels import cover_mask


def exclusive_of(graph: DependencyGraph, **limits: int) -> ExclusiveTravels:
    """Exclusive travels of a graph, as the relaxation asks for them."""
    rows = closure_of(graph)
    kept = cover_mask(rows, graph.pred_offsets, graph.preds)
    heads = np.repeat(np.arange(graph.n), np.diff(graph.pred_offsets))[kept]
    offsets = np.searchsorted(heads, np.arange(graph.n + 1))
    return find_exclusive_travels(rows, offsets, graph.preds[kept], **limits)


def layered(layers: int, each: int) -> DependencyGraph:
    """Layers of which each must lie before the next begins."""
    n = layers * each
    pairs = [(a, b) for b in range(n) for a in range(b) if a // each < b // each]
    return DependencyGraph.from_pairs(n, np.array(pairs, np.int32))


def nearly_layered(seed: int) -> DependencyGraph:
    """Six contours in three layers, some of which are free of some of the layer below."""
    rng = np.random.default_rng(seed)
    layer = np.sort(rng.integers(0, 3, 6))
    wanted = (layer[:, None] < layer[None, :]) & (rng.random((6, 6)) < 0.85)
    return DependencyGraph.from_pairs(6, np.argwhere(wanted).astype(np.int32))


def test_every_order_passes_at_most_once() -> None:
    """The claim itself, over all linear extensions of small graphs."""
    seen = tight = 0
    for seed in range(40):
        graph = nearly_layered(seed)
        found = exclusive_of(graph)
        seen += found.count
        for order in itertools.permutations(range(6)):
            place = np.argsort(order)
            if all(place[a] < place[b] for a, b in graph.pairs()):
                steps = np.array(order[:-1]) * 6 + np.array(order[1:])
                used = found.of.T @ np.isin(found.keys, steps).astype(float)
                assert used.max(initial=0.0) <= 1.0
                tight += int(used.sum())
    assert seen > 20
    assert tight > 100


def test_layers_in_series_are_passed_once_each() -> None:
    """Layers that are neighbours are one set; contours between are a bend each."""
    found = exclusive_of(layered(4, 3))
    assert sorted(found.of.sum(axis=0)) == [6.0] * 6 + [9.0] * 3
    assert {(k // 12 // 3, k % 12 // 3) for k in found.keys} == {(0, 1), (1, 2), (2, 3)}


def test_a_chain_has_no_exclusive_travels() -> None:
    """Sets of one contour say no more than that it is left once."""
    assert exclusive_of(layered(5, 1)).count == 0
    assert exclusive_of(layered(2, 1)).count == 0
    assert exclusive_of(DependencyGraph.from_pairs(3, np.empty((0, 2), np.int32))).count == 0


@pytest.mark.parametrize("limit, most", [("most_members", 20), ("most_looks", 50)])
def test_search_ends_at_its_limits(limit: str, most: int) -> None:
    """Memory and time stay bounded on dense graphs; fewer sets are still valid ones."""
    assert 0 < exclusive_of(layered(6, 3), **{limit: most}).count < 17
