"""What every planner promises, whatever it does inside."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts._kernels.seats import visits_cost
from decmcts._kernels.tour import respects
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.greedy import Greedy
from decmcts.search.hybrid import Hybrid, layered_start
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import anneal_pieces, anneal_rivals
from decmcts.search.layerwise import layer_runs, nearest_in_layers
from decmcts.search.mcts import Mcts
from decmcts.search.neighbours import near_ports
from decmcts.search.pieces import Sequence
from decmcts.search.planners import PLANNERS, SearchResult, plan_order
from decmcts.search.problem import OrderProblem
from decmcts.search.stopping import Budget, IterationLimit
from tests.search.problems import random_problem, with_loops


def run(
    problem: OrderProblem, planner: str, *, iterations: int = 2000, seed: int = 1
) -> SearchResult:
    return plan_order(
        problem, planner=planner, time_limit_s=60.0, seed=seed, max_iterations=iterations
    )


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
        for flips in itertools.product(*choices):
            travel = 0.0
            for (a, f), (b, g) in itertools.pairwise(zip(order, flips, strict=True)):
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
@pytest.mark.parametrize("n", [300, 900, 1200])
@pytest.mark.parametrize("loops", [False, True])
def test_threads_do_not_make_hybrid_unrepeatable(n: int, loops: bool) -> None:
    """Two threads share the work; which is faster must not matter. 1200 contours are cut."""
    problem = random_problem(5, n, density=0.01)
    problem = with_loops(problem, 5) if loops else problem
    first = run(problem, "hybrid", iterations=400_000)
    second = run(problem, "hybrid", iterations=400_000)
    assert (first.toolpath.order == second.toolpath.order).all()
    assert (first.history[:, 1:] == second.history[:, 1:]).all()
    assert first.cost < 0.8 * first.source_cost


def test_hybrid_without_trees_stops_where_no_travel_is_left() -> None:
    """Annealing within layers of a large print may end there."""
    problem = random_problem(1, 30, density=0.1)
    alike = np.zeros_like(problem.start)
    still = replace(problem, start=alike, end=alike.copy())
    planner = Hybrid(medium=10, large=10, for_structure=0.0)
    assert plan_order(still, planner=planner, time_limit_s=60.0, seed=0).cost == 0.0


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
    best = layered_start(incumbent, near, *given, promising=0.0)
    assert best is not None
    assert (best.order == incumbent.order).all()


@pytest.mark.parametrize("trees", [0.0, 0.02])
def test_hybrid_goes_on_from_the_best_of_what_it_has_half_way(
    monkeypatch: pytest.MonkeyPatch, trees: float
) -> None:
    """A large print half-way is still warm and may cost more than the first, fast annealing."""
    begun: list[tuple[float, float]] = []

    def watched(incumbent: Incumbent, sequence: Sequence, *args: Any, **options: Any) -> bool:
        begun.append((sequence.cost, incumbent.cost))
        return anneal_pieces(incumbent, sequence, *args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.anneal_pieces", watched)
    planner = Hybrid(medium=10, for_structure=trees, warm=1.4)  # hardly cooled half-way
    problem = random_problem(5, 300, density=0.01)
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=200_000)
    assert len(begun) == 3
    assert begun[2][0] == begun[2][1]


def test_hybrid_says_which_gamma_it_chose() -> None:
    """The paper leaves the choice open; users and benchmarks want to see it."""
    assert 0.0 < run(random_problem(3, 60, density=0.05), "hybrid").notes["gamma"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_mcts_finds_the_optimum_when_every_contour_is_a_cluster(seed: int) -> None:
    """The paper's search converges to the optimum; this is what 'faithful' means."""
    problem = random_problem(seed, 7, density=0.3, turning=0.0)
    planner = Mcts(labels=lambda graph: np.arange(graph.n, dtype=np.int32))
    incumbent = Incumbent(
        problem,
        clock=lambda: 0.0,
        budget=Budget(1.0, 20_000),
        criterion=IterationLimit(20_000),
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
    result = plan_order(problem, planner=planner, time_limit_s=1e9, seed=1, stop=lambda: True)
    assert len(result.toolpath) == 50
    assert result.iterations <= 2000


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("n", [0, 1])
def test_empty_and_single_prints_end_at_once(planner: str, n: int) -> None:
    """There is nothing to search; the time limit must not be waited for."""
    result = plan_order(random_problem(1, n), planner=planner, time_limit_s=1e9, seed=1)
    assert len(result.toolpath) == n
    assert result.cost == 0.0


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_time_limit_is_kept(planner: str) -> None:
    """The clock is an argument: each look at it passes a quarter of a second here."""
    ticks = itertools.count()
    result = plan_order(
        random_problem(9, 40, density=0.1),
        planner=planner,
        time_limit_s=20.0,
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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"planner": "magic"}, "planner 'magic' is unknown, expected one of slicer"),
        ({"time_limit_s": -1.0}, "negative limit: -1.0 s"),
        ({"time_limit_s": float("nan")}, "negative limit: nan s"),
        ({"max_iterations": -5}, "-5 iterations"),
    ],
)
def test_bad_options_are_named(options: dict[str, object], message: str) -> None:
    """A typing error should not search for a minute."""
    arguments = {"planner": "local", "time_limit_s": 1.0, "seed": 1, **options}
    with pytest.raises(ValueError, match=message):
        plan_order(random_problem(1, 3), **arguments)  # type: ignore[arg-type]  # bad on purpose


@pytest.mark.parametrize("medium", [10, 100])
def test_hybrid_stops_where_no_travel_is_left(medium: int) -> None:
    """Annealing may reach zero where greedy does not; there is no heat below it."""
    start, end = np.zeros((60, 3)), np.zeros((60, 3))
    start[30:, 0] = end[30:, 0] = end[0, 0] = 10.0  # 0 leads from one spot to the other
    graph = DependencyGraph.from_pairs(60, np.empty((0, 2), np.int32))
    problem = OrderProblem(start, end, np.zeros(60, np.bool_), np.zeros(60, np.int32), graph)
    result = plan_order(
        problem, planner=Hybrid(medium=medium), time_limit_s=60.0, seed=0, max_iterations=100_000
    )
    assert result.cost == 0.0
    assert result.iterations < 100_000


@pytest.mark.parametrize("ahead", [False, True])
def test_hybrid_stays_within_layers_once_that_is_ahead(
    monkeypatch: pytest.MonkeyPatch, ahead: bool
) -> None:
    """Races within layers, joined layer by layer, beat races of the whole on real prints."""
    layer = np.repeat(np.arange(8, dtype=np.int32), 25)
    problem = replace(random_problem(2, 200, density=0.01), layer=layer)
    found: list[float] = []  # by races within layers
    raced: list[list[bool]] = []

    def watched(incumbent: Incumbent, rivals: list[Sequence], *args: Any, **options: Any) -> bool:
        if "groups" not in options:
            return anneal_rivals(incumbent, rivals, *args, **options)
        within = [bool(group.any()) for group in options["groups"]]
        coolings = args[1]
        assert (coolings[0].hot_mm < coolings[1].hot_mm) == within[0]
        for rival, stays in zip(rivals, within, strict=True):
            assert not stays or (np.diff(layer[rival.order]) >= 0).all()
            assert not stays or rival.cost <= min(found, default=np.inf) + 1e-9
        stop = anneal_rivals(incumbent, rivals, *args, **options)
        if not within[0]:  # one of them has bad luck
            rivals[0 if ahead else 1].order[:] = np.arange(200)
            rivals[0 if ahead else 1].flip[:] = 0
        found.extend(rival.cost for rival, stays in zip(rivals, within, strict=True) if stays)
        raced.append(within)
        return stop

    monkeypatch.setattr("decmcts.search.hybrid.anneal_rivals", watched)
    planner = Hybrid(promising=10.0, racing=50.0)
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=400_000)
    assert raced == [[False, True], *[[ahead, True]] * (planner.most_races - 1)]


@pytest.mark.parametrize(("large", "steps", "races"), [(100, 400, True), (100, 100, False),
                                                       (50, 400, False)])  # fmt: skip
def test_hybrid_races_on_larger_prints_if_there_is_time(
    monkeypatch: pytest.MonkeyPatch, large: int, steps: int, races: bool
) -> None:
    """With a minute, races end better on prints of some thousand contours too."""
    raced: list[bool] = []

    def watched(*args: Any, **options: Any) -> bool:
        raced.append("fused" not in options)
        return anneal_rivals(*args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.anneal_rivals", watched)
    planner = Hybrid(medium=10, large=large, for_races=100.0)
    problem = random_problem(5, 60, density=0.05)
    problem = replace(problem, layer=np.zeros_like(problem.layer))  # none within layers
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=60 * steps)
    assert any(raced) == races


def test_hybrid_has_no_races_within_a_single_layer() -> None:
    """There they would be races of the whole."""
    problem = random_problem(2, 30)
    problem = replace(problem, layer=np.zeros_like(problem.layer))
    incumbent = Incumbent(
        problem, clock=lambda: 0.0, budget=Budget(1.0, None), criterion=IterationLimit(1000)
    )
    given = nearest_in_layers(incumbent, layer_runs(problem.layer))
    assert layered_start(incumbent, near_ports(problem), *given, promising=9.0) is None
