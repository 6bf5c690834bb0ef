"""What every planner promises, whatever it does inside."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.search.baselines.mcts import Mcts
from decmcts.search.planners import PLANNERS, SearchResult, plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem


def run(
    problem: OrderProblem, planner: str, *, iterations: int = 2000, seed: int = 1
) -> SearchResult:
    return plan_order(problem, planner=planner, stopping=Stopping(iterations=iterations), seed=seed)


@pytest.mark.parametrize("planner", PLANNERS)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 40))
def test_result_is_a_linear_extension_no_worse_than_the_source(
    planner: str, seed: int, n: int
) -> None:
    """An order that breaks the graph crashes the head into the print."""
    problem = random_problem(seed, n)
    result = run(problem, planner, iterations=300)
    graph, path = problem.graph, result.toolpath
    assert respects(path.order, graph.succ_offsets, graph.succs)
    assert not (path.reversed & ~problem.reversible[path.order]).any()
    entries = np.where(path.reversed[:, None], problem.end[path.order], problem.start[path.order])
    exits = np.where(path.reversed[:, None], problem.start[path.order], problem.end[path.order])
    travel = float(np.linalg.norm(entries[1:] - exits[:-1], axis=1).sum())
    assert result.cost == pytest.approx(travel)
    assert result.cost <= result.source_cost


def cheapest_by_brute_force(problem: OrderProblem) -> float:
    """Slow oracle: every linear extension, best directions by exhaustive search."""
    n, graph = len(problem), problem.graph
    best = np.inf
    for order in itertools.permutations(range(n)):
        if not respects(np.array(order, np.int32), graph.succ_offsets, graph.succs):
            continue
        choices = [(0, 1) if problem.reversible[c] else (0,) for c in order]
        for directions in itertools.product(*choices):
            travel = 0.0
            for (a, f), (b, g) in itertools.pairwise(zip(order, directions, strict=True)):
                out = problem.start[a] if f else problem.end[a]
                into = problem.end[b] if g else problem.start[b]
                travel += float(np.linalg.norm(into - out))
            best = min(best, travel)
    return best


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["local", "hybrid"])
@pytest.mark.parametrize("seed", range(12))
def test_annealing_finds_the_optimum_of_small_problems(planner: str, seed: int) -> None:
    """Whatever it does on large prints, it must be exact where exactness can be checked."""
    problem = random_problem(seed, 4 + seed % 3, density=0.2)
    assert run(problem, planner, iterations=50_000).cost == pytest.approx(
        cheapest_by_brute_force(problem)
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_mcts_finds_the_optimum_when_every_contour_is_a_cluster(seed: int) -> None:
    """The paper's search converges to the optimum; this is what 'faithful' means."""
    problem = random_problem(seed, 7, density=0.3, reversible=0.0)
    planner = Mcts(labels=lambda graph: np.arange(graph.n, dtype=np.int32))
    incumbent = Incumbent(
        problem,
        clock=lambda: 0.0,
        stopping=Stopping(iterations=20_000),
    )
    planner.plan(incumbent, seed=seed)
    assert incumbent.cost == pytest.approx(cheapest_by_brute_force(problem))


@pytest.mark.parametrize("planner", PLANNERS)
def test_equal_seed_and_iterations_give_equal_results(planner: str) -> None:
    """Results must be repeatable, on slow and fast machines alike."""
    problem = random_problem(11, 30, density=0.1)
    first, second = run(problem, planner), run(problem, planner)
    assert (first.toolpath.order == second.toolpath.order).all()
    assert (first.toolpath.reversed == second.toolpath.reversed).all()
    assert first.iterations == second.iterations
    assert (first.history[:, 1:] == second.history[:, 1:]).all()


@pytest.mark.parametrize("planner", PLANNERS)
def test_asked_to_stop_it_keeps_the_best_so_far(planner: str) -> None:
    """Ctrl-C must end the search at once, with a valid result."""
    problem = random_problem(7, 50, density=0.05)
    result = plan_order(
        problem, planner=planner, stopping=Stopping(seconds=60.0, asked=lambda: True), seed=1
    )
    assert len(result.toolpath) == 50
    assert result.iterations <= 2000


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("n", [0, 1])
def test_empty_and_single_prints_end_at_once(planner: str, n: int) -> None:
    """There is nothing to search; the time limit must not be waited for."""
    result = plan_order(
        random_problem(1, n), planner=planner, stopping=Stopping(seconds=60.0), seed=1
    )
    assert len(result.toolpath) == n
    assert result.cost == 0.0


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_time_limit_is_kept(planner: str) -> None:
    """The clock is an argument: each look at it passes a quarter of a second here."""
    ticks = itertools.count()
    result = plan_order(
        random_problem(9, 40, density=0.1),
        planner=planner,
        stopping=Stopping(seconds=20.0),
        seed=1,
        clock=lambda: next(ticks) * 0.25,
    )
    assert result.history[-1, 0] <= 21.0
    assert next(ticks) <= 90


def test_history_ends_at_the_result_and_only_improves() -> None:
    """The convergence plots are drawn from it."""
    result = run(random_problem(2, 40, density=0.1), "local")
    assert result.history[0].tolist() == [0.0, 0.0, result.source_cost]
    assert result.history[-1, 2] == result.cost
    assert (np.diff(result.history[:, 2]) < 0).all()


def test_layerwise_prints_layer_after_layer() -> None:
    """It is the yardstick for what can be had without looking across layers."""
    problem = random_problem(6, 40, density=0.02)
    result = run(problem, "layerwise")
    assert result.cost < result.source_cost
    assert (np.diff(problem.layer[result.toolpath.order]) >= 0).all()


def test_an_unknown_planner_is_named() -> None:
    """A typing error should not search for a minute."""
    with pytest.raises(ValueError, match="planner 'magic' is unknown, expected one of slicer"):
        plan_order(random_problem(1, 3), planner="magic", stopping=Stopping(seconds=1.0), seed=1)
