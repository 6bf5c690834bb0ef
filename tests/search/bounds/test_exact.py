"""Prints whose layers have few contours are solved exactly, whatever their size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.bounds.exact import Capacity, Optimum, Patience, solve_exactly
from decmcts.search.bounds.ideals_kernels import WINDOW
from decmcts.search.hybrid.phases import Exact, Hybrid
from decmcts.search.planners import plan_order
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.problem import OrderProblem, Pace, Seams
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import (
    box_walls,
    choices,
    price,
    random_problem,
    with_bare,
    with_loops,
    with_pace,
)


def kinds(problem: OrderProblem, seed: int) -> OrderProblem:
    """The problem as it is, with loops, in seconds, both, or with bare costs, in turn."""
    if seed % 5 == 4:
        n = len(problem)
        costs = np.random.default_rng(seed).integers(0, 30, (n, n)).astype(float)
        return replace(problem, reversible=np.zeros(n, np.bool_), costs=costs)
    problem = with_loops(problem, seed) if seed % 5 in (1, 3) else problem
    paced = with_bare if seed // 5 % 2 else with_pace
    return paced(problem) if seed % 5 in (2, 3) else problem


def layers(seed: int, count: int, each: int, *, apart: bool = False) -> OrderProblem:
    """Layers of `each` contours, one after the other; if `apart`, only each above its like."""
    n = count * each
    problem = random_problem(seed, n, density=0.0)
    if apart:
        pairs = [(k, k + each) for k in range(n - each)]
    else:
        pairs = [(k, m) for k in range(n - each) for m in range(k // each * each + each, n)]
    graph = DependencyGraph.from_pairs(n, np.array(pairs, np.int32))
    return replace(problem, layer=(np.arange(n) // each).astype(np.int32), graph=graph)


def least(problem: OrderProblem) -> float:
    """The optimum by plain recursion over the set printed and the last contour's choice."""
    n, needed = len(problem), [set[int]() for _ in range(len(problem))]
    for a, b in problem.graph.pairs().tolist():
        needed[b].add(a)
    ends = [choices(problem, c) for c in range(n)]

    @cache
    def step(c: int, k: int, d: int, m: int) -> float:
        if problem.costs is not None:
            return float(problem.costs[c, d])
        return price(problem, ends[c][k][1], ends[d][m][0])

    @cache
    def rest(done: frozenset[int], last: tuple[int, int] | None) -> float:
        costs = [
            (step(*last, c, k) if last else 0.0) + rest(done | {c}, (c, k))
            for c in range(n)
            if c not in done and needed[c] <= done
            for k in range(len(ends[c]))
        ]
        return min(costs, default=0.0)

    return rest(frozenset(), None)


def check(problem: OrderProblem, found: Optimum) -> None:
    """Refuse a sequence that is not allowed, or does not cost what it says."""
    graph = problem.graph
    assert sorted(found.order.tolist()) == list(range(len(problem)))
    assert respects(found.order, graph.succ_offsets, graph.succs)
    assert not (found.reversed.astype(bool) & ~problem.reversible).any()
    cost = visits_cost(problem.metric(), found.order, found.reversed, found.entry_id)
    assert found.cost == pytest.approx(cost)
    assert found.bound <= cost


@pytest.mark.parametrize("seed", range(25))
def test_small_problems_of_every_kind(seed: int) -> None:
    """Sparse and dense graphs, loops, seconds with retractions, bare costs."""
    problem = random_problem(seed, 2 + seed % 6, density=(0.0, 0.3, 0.7)[seed % 3])
    problem = kinds(problem, seed)
    found = solve_exactly(problem)
    assert found is not None
    check(problem, found)
    assert found.cost == pytest.approx(least(problem))


@pytest.mark.parametrize("seed", [1, 12, 16, 27])
def test_two_travels_round_a_wall_cost_less_than_one_across_it(seed: int) -> None:
    """Orders that were not optimal were taken to be proven so, which ended the search."""
    problem = random_problem(seed, 2 + seed % 6, density=(0.0, 0.3, 0.7)[seed % 3])
    problem = with_loops(problem, seed) if seed % 2 else problem
    problem = replace(problem, pace=Pace.in_mm(box_walls(), 1.0))
    found = solve_exactly(problem)
    assert found is not None
    check(problem, found)
    assert found.cost == pytest.approx(least(problem))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_many_thin_layers(seed: int) -> None:
    """As many contours as it takes, in strict layers or in towers side by side."""
    problem = kinds(layers(seed, 7, 3, apart=seed % 2 == 0), seed)
    found = solve_exactly(problem)
    assert found is not None
    check(problem, found)
    assert found.cost == pytest.approx(least(problem))


@pytest.mark.parametrize("apart", [False, True])
def test_annealing_finds_nothing_better(apart: bool) -> None:
    """Six hundred contours; what must be searched for is proven here."""
    problem = with_loops(layers(3, 200, 3), 3) if not apart else layers(3, 100, 3, apart=True)
    found = solve_exactly(problem)
    if apart:  # three towers of a hundred: each may be far ahead of the others
        assert found is None
        return
    assert found is not None
    check(problem, found)
    planner = Hybrid(exact=Exact(probe=0.0))
    other = plan_order(problem, planner=planner, stopping=Stopping(iterations=2_000_000), seed=0)
    assert found.cost <= other.cost + 1e-9
    assert other.cost <= 1.2 * found.cost


def test_what_cannot_follow_is_not_free() -> None:
    """An infinite cost leads nowhere, also when all that lead to a set are infinite."""
    costs = np.array([[0, np.inf, 5, 9], [np.inf, 0, 7, 9], [6, 8, 0, 9], [1, 1, 1, 0]])
    problem = random_problem(0, 4, reversible=0.0)
    graph = DependencyGraph.from_pairs(4, np.array([(0, 3), (1, 3), (2, 3)], np.int32))
    found = solve_exactly(replace(problem, graph=graph, costs=costs))
    assert found is not None
    assert found.order.tolist() == [1, 2, 0, 3]
    assert found.cost == 22.0


def test_given_up_when_asked_or_too_wide() -> None:
    """Time, the width of a level, and room each end it, without a result."""
    problem = layers(1, 40, 8)
    asked: list[float] = []

    def once(made: int, share: float) -> bool:
        asked.append(share)
        return made > 0 and len(asked) < most

    for most in (1, 2, 1000):
        asked.clear()
        assert (solve_exactly(problem, once, effort=1e3) is None) == (most < 1000)
    assert asked == sorted(asked)
    assert (asked[0], asked[-1]) == (0.0, 1.0)
    assert 0.0 < asked[len(asked) // 2 + 1] < 1.0
    assert solve_exactly(problem, widest=100) is None
    for small in (
        Capacity(ideals=1000),
        Capacity(steps=1000),
        Capacity(travels=1000),
        Capacity(slots=101),
    ):
        assert solve_exactly(problem, capacity=small) is None
    assert solve_exactly(problem) is not None


@pytest.mark.parametrize("behind", [WINDOW - 1, WINDOW])
def test_a_contour_far_behind(behind: int) -> None:
    """A chain, and a contour at its end that may come first: up to 63 behind it is seen."""
    n = behind + 1
    problem = random_problem(5, n, density=0.0)
    chain = np.array([(k, k + 1) for k in range(n - 2)], np.int32)
    problem = replace(problem, graph=DependencyGraph.from_pairs(n, chain))
    found = solve_exactly(problem)
    assert (found is not None) == (behind < WINDOW)
    if found is not None:
        check(problem, found)
        assert found.cost == pytest.approx(least(problem))


def test_nothing_and_one() -> None:
    """No contour, and a single one."""
    assert solve_exactly(random_problem(0, 0)) is None
    found = solve_exactly(random_problem(0, 1))
    assert found is not None
    assert found.cost == 0.0


@pytest.mark.parametrize("max_iterations", [None, 300_000])
def test_hybrid_proves_what_it_can(max_iterations: int | None) -> None:
    """It ends early then, and says that the result is optimal."""
    problem = layers(2, 60, 4)
    result = plan_order(problem, planner="hybrid", stopping=Stopping(60.0, max_iterations), seed=0)
    assert result.bound is not None
    assert result.bound <= result.cost
    assert result.cost == pytest.approx(result.bound)
    assert result.history[-1, 0] < 30.0


@pytest.mark.parametrize("max_iterations", range(1, 30, 4))
def test_next_to_no_budget(max_iterations: int) -> None:
    """The attempt ends, and so does the search."""
    asked: list[int] = []

    def stop() -> bool:
        asked.append(1)
        return len(asked) > 1000

    plan_order(
        layers(2, 5, 3), planner="hybrid", seed=0,
        stopping=Stopping(iterations=max_iterations, asked=stop),
    )  # fmt: skip
    assert len(asked) < 1000


def test_hybrid_searches_where_it_cannot_prove() -> None:
    """A hopeless attempt takes a small share of the budget and no bound is claimed."""
    problem = layers(2, 4, 20)
    result = plan_order(problem, planner="hybrid", stopping=Stopping(iterations=200_000), seed=0)
    assert result.bound is None
    assert result.cost < result.source_cost


def test_pieces_of_work_are_small() -> None:
    """Loops with many entries cost far more than their number of steps tells."""
    problem, options = layers(6, 12, 7), 24
    n, rng = len(problem), np.random.default_rng(6)
    enter = rng.random((n * options, 3)) * 100.0
    seams = Seams(
        np.arange(n + 1, dtype=np.int64) * options, enter, enter.copy(),
        np.tile(np.arange(options, dtype=np.int32), n),
    )  # fmt: skip
    first = enter[::options].copy()
    never = np.zeros(n, np.bool_)
    problem = replace(problem, start=first, end=first.copy(), reversible=never, seams=seams)
    pieces: list[tuple[int, float]] = []

    def go_on(made: int, share: float) -> bool:
        pieces.append((made, share))
        return share < 1.0  # no matter at the end: all is done then

    found = solve_exactly(problem, go_on, effort=1e5)
    assert found is not None
    check(problem, found)
    priced = [made for made, share in pieces if share > 0.0]
    assert len(priced) > 3
    assert sum(priced) == sum(made for made, share in pieces if share == 0.0)
    assert max(priced) < sum(priced) / 2


def test_costs_without_end_or_below_zero() -> None:
    """Bare costs may be anything but no number."""
    problem = random_problem(1, 4, density=0.0, reversible=0.0)
    for cost in (np.inf, -5.0):
        found = solve_exactly(replace(problem, costs=np.full((4, 4), cost)))
        assert found is not None
        assert found.cost == 3.0 * cost
        assert found.bound <= found.cost


@pytest.mark.parametrize(("pace", "lasts"), [(0.5, 1.0), (0.7, 1.0), (0.9, 0.06), (5.0, 0.01)])
def test_patience_ends_soon_where_there_is_no_hope(pace: float, lasts: float) -> None:
    """What would take more than its share is given up once that shows, not at its end."""
    now = 0.1
    patience = Patience(lambda: now, 0.15, 0.75)
    for then in (0.12, 0.2, 0.24):
        now = then
        assert patience.lasts(0.0)
    done = 0.01
    while done < 1.0:
        now = 0.24 + pace * done
        if not patience.lasts(done):
            break
        done += 0.01
    assert done == pytest.approx(lasts, abs=0.011)


def test_patience_with_finding_ends() -> None:
    """Steps that take long to find are not waited for."""
    now = 0.1
    patience = Patience(lambda: now, 0.15, 0.75)
    now = 0.26
    assert not patience.lasts(0.0)
