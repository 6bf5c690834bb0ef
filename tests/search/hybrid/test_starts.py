"""Whether a start that goes by layers is worth annealing within them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.threads import open_threads
from decmcts.search.hybrid.search import HybridSearch, LayeredStart, Starts
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.greedy import layer_runs
from decmcts.search.sequence.problem import OrderProblem
from tests.search.problems import random_problem, started, with_loops


def begun(problem: OrderProblem) -> HybridSearch:
    """A search after its starts."""
    with open_threads(1, 0) as threads:
        search = HybridSearch(started(problem), threads)
    list(Starts().run(search))
    return search


def layered_start(search: HybridSearch, most_cost: float) -> Sequence | None:
    """What is annealed within layers, if anything."""
    search.layered = None
    list(LayeredStart(most_cost).run(search))
    return search.layered


@pytest.mark.parametrize("loops", [False, True])
def test_layers_are_tried_though_another_start_is_a_little_better(loops: bool) -> None:
    """Annealing within layers ended better there on real prints, and it was never begun."""
    problem = random_problem(4, 60, density=0.02)
    problem = with_loops(problem, 4) if loops else problem
    search, group = begun(problem), layer_runs(problem.layer)
    incumbent = search.incumbent
    assert (np.diff(group[incumbent.order]) < 0).any()  # greedy's own does not go by layers
    assert search.by_layers is not None
    order, _ = search.by_layers
    layered = layered_start(search, 100.0)
    assert layered is not None
    assert (layered.order == order).all()
    ratio = layered.cost / incumbent.cost
    assert ratio > 1.0
    assert layered_start(search, 0.99 * ratio) is None
    if loops:
        assert layered.cost == visits_cost(
            incumbent.metric, order, *problem.visits_for(incumbent.metric, order)
        )
    incumbent.order = layered.order
    incumbent.reversed, incumbent.entry_id = layered.reversed, layered.entry_id
    best = layered_start(search, 0.1)
    assert best is not None
    assert (best.order == incumbent.order).all()


def test_there_is_none_within_a_single_layer() -> None:
    """It would be annealing of the whole."""
    problem = random_problem(2, 30)
    problem = replace(problem, layer=np.zeros_like(problem.layer))
    assert layered_start(begun(problem), 9.0) is None
