"""The planner `hybrid`: what its phases begin with, and what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts._kernels.sequence.seats import visits_cost
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.hybrid.phases import Hybrid, layered_start
from decmcts.search.hybrid.races import Races
from decmcts.search.planners import SearchResult, plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Budget, IterationLimit
from decmcts.search.starts.greedy import Greedy
from decmcts.search.starts.layerwise import layer_runs, nearest_in_layers
from tests.search.problems import random_problem, with_loops


def repeatable(problem: OrderProblem, *, iterations: int) -> SearchResult:
    return plan_order(
        problem, planner="hybrid", time_limit_s=60.0, seed=1, max_iterations=iterations
    )


@pytest.mark.parametrize("loops", [False, True])
def test_hybrid_tries_layers_though_another_start_is_a_little_better(loops: bool) -> None:
    """Annealing within layers ended better there on real prints, and it was never begun."""
    problem = random_problem(4, 60, density=0.02)
    problem = with_loops(problem, 4) if loops else problem
    incumbent = Incumbent(
        problem, clock=lambda: 0.0, budget=Budget(1.0, None), criterion=IterationLimit(1000)
    )
    group = layer_runs(problem.layer)
    order, flip = nearest_in_layers(incumbent, group)
    Greedy().plan(incumbent, seed=0)
    assert (np.diff(group[incumbent.order]) < 0).any()  # greedy's own does not go by layers
    given, near = (order, flip), near_ports(problem)
    layered = layered_start(incumbent, near, *given, promising=100.0)
    assert layered is not None
    assert (layered.order == order).all()
    ratio = layered.cost / incumbent.cost
    assert ratio > 1.0
    assert layered_start(incumbent, near, *given, promising=0.99 * ratio) is None
    if loops:
        assert layered.cost == visits_cost(
            incumbent.metric, order, *problem.visits_for(incumbent.metric, order)
        )
    incumbent.order, incumbent.flip, incumbent.seat = layered.order, layered.flip, layered.seat
    best = layered_start(incumbent, near, *given, promising=0.1)
    assert best is not None
    assert (best.order == incumbent.order).all()


def test_hybrid_says_which_gamma_it_chose() -> None:
    """The paper leaves the choice open; users and benchmarks want to see it."""
    problem = random_problem(3, 60, density=0.05)
    assert 0.0 < repeatable(problem, iterations=2000).notes["gamma"] < 1.0


def test_hybrid_has_no_races_within_a_single_layer() -> None:
    """There they would be races of the whole."""
    problem = random_problem(2, 30)
    problem = replace(problem, layer=np.zeros_like(problem.layer))
    incumbent = Incumbent(
        problem, clock=lambda: 0.0, budget=Budget(1.0, None), criterion=IterationLimit(1000)
    )
    given = nearest_in_layers(incumbent, layer_runs(problem.layer))
    assert layered_start(incumbent, near_ports(problem), *given, promising=9.0) is None


@pytest.mark.slow
@pytest.mark.parametrize("n", [300, 900, 1200])
@pytest.mark.parametrize("loops", [False, True])
def test_threads_do_not_make_hybrid_unrepeatable(n: int, loops: bool) -> None:
    """Two threads share the work; which is faster must not matter. 1200 contours are cut."""
    problem = random_problem(5, n, density=0.01)
    problem = with_loops(problem, 5) if loops else problem
    first = repeatable(problem, iterations=400_000)
    second = repeatable(problem, iterations=400_000)
    assert (first.toolpath.order == second.toolpath.order).all()
    assert (first.history[:, 1:] == second.history[:, 1:]).all()
    assert first.cost < 0.8 * first.source_cost


@pytest.mark.parametrize("always", [10, 100])
def test_hybrid_stops_where_no_travel_is_left(always: int) -> None:
    """Annealing may reach zero where greedy does not; there is no heat below it."""
    start, end = np.zeros((60, 3)), np.zeros((60, 3))
    start[30:, 0] = end[30:, 0] = end[0, 0] = 10.0  # 0 leads from one spot to the other
    graph = DependencyGraph.from_pairs(60, np.empty((0, 2), np.int32))
    problem = OrderProblem(start, end, np.zeros(60, np.bool_), np.zeros(60, np.int32), graph)
    result = plan_order(
        problem,
        planner=Hybrid(races=Races(always=always)),
        time_limit_s=60.0,
        seed=0,
        max_iterations=100_000,
    )
    assert result.cost == 0.0
    assert result.iterations < 100_000
