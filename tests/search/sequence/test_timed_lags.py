"""Time between contours that lie on each other: cheap checks must be the true ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.print.lags_kernels import Lags
from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.planners import KEEP_LAGS, PLANNERS, plan_order, toolpath_cost
from decmcts.search.sequence.anneal_kernels import anneal, descend
from decmcts.search.sequence.insertion_kernels import try_insertion
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.moves_kernels import (
    Tour,
    apply_reversal,
    apply_swap,
    reversal_allowed,
    swap_allowed,
)
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags
from tests.search.problems import random_problem, sliced_tour, started, tour_cost, with_loops


def problem_with_lags(seed: int, n: int, *, density: float, longest: float = 6.0) -> OrderProblem:
    """A problem in which ends of some edges must be some time apart, as in the source or less."""
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, n, density=density)
    pairs = problem.graph.pairs()
    pairs = pairs[rng.random(len(pairs)) < 0.7]
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(pairs[:, 1], minlength=n))])
    lags = Lags(
        offsets.astype(np.int64),
        pairs[:, 0].astype(np.int32),
        rng.uniform(0.0, longest, len(pairs)),
    )
    seconds = rng.choice([0.3, 1.0, 2.5], n)
    return replace(problem, timed_lags=TimedLags.kept_by_source(lags, seconds))


def keeps(problem: OrderProblem, order: np.ndarray) -> bool:
    """Say whether a sequence leaves enough time, by a clock of the test's own."""
    assert problem.timed_lags is not None
    lags, seconds = problem.timed_lags.lags, problem.timed_lags.seconds
    end = np.empty(len(order))
    end[order] = np.cumsum(seconds[order])
    above = np.repeat(np.arange(len(order)), np.diff(lags.offsets))
    return bool((end[above] - seconds[above] - end[lags.below] >= lags.seconds - 2e-6).all())


def is_on_time(tour: Tour) -> bool:
    """Say whether the times kept with a tour, if any, are those of its sequence."""
    if not len(tour.lags.under):
        return True
    begin = np.cumsum(tour.lags.seconds[tour.order]) - tour.lags.seconds[tour.order]
    return bool(np.allclose(tour.lags.begin[tour.order], begin, atol=1e-6))


def walked(problem: OrderProblem, seed: int, steps: int = 300) -> Tour:
    """A tour that is no longer the source's."""
    tour = sliced_tour(problem)
    anneal(tour, seeded(seed), 100.0, steps)
    return tour


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_moves_are_allowed_exactly_when_the_result_keeps_graph_and_time(seed: int) -> None:
    """Too strict wastes moves, too lax prints on warm plastic."""
    rng = np.random.default_rng(seed)
    problem = problem_with_lags(seed, 12, density=0.15)
    graph = problem.graph
    i, j, k = sorted(rng.choice(13, 3, replace=False).tolist())

    def holds(tour: Tour) -> bool:
        linear = respects(tour.order, graph.succ_offsets, graph.succs)
        return bool(linear) and keeps(problem, tour.order)

    swapped = walked(problem, seed)
    assert holds(swapped)
    allowed = swap_allowed(swapped, i, j, k)
    apply_swap(swapped, i, j, k)
    assert allowed == holds(swapped)
    assert is_on_time(swapped)
    reversed_tour = walked(problem, seed)
    allowed = reversal_allowed(reversed_tour, i, k)
    apply_reversal(reversed_tour, i, k)
    assert allowed == holds(reversed_tour)
    assert is_on_time(reversed_tour)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(2, 30),
    density=st.sampled_from([0.05, 0.1, 0.3]),
    loops=st.booleans(),
)
def test_annealing_and_descent_keep_time(seed: int, n: int, density: float, loops: bool) -> None:
    """Carries undo a half-made move, insertions rearrange a window: the sums must be right."""
    problem = problem_with_lags(seed, n, density=density)
    if loops:
        problem = with_loops(problem, 3)
    tour = sliced_tour(problem)
    before = tour_cost(tour.metric, tour.order, tour.reversed)
    total = anneal(tour, seeded(seed), 5.0, 2000)
    for p in range(0, n - 2, 3):
        total += try_insertion(tour, p, p + 2, 3.0) + try_insertion(tour, p + 1, p, 3.0)
    total += descend(tour, 0, n, 50)
    assert tour_cost(tour.metric, tour.order, tour.reversed) == pytest.approx(
        before + total, abs=1e-6
    )
    assert respects(tour.order, tour.succ_offsets, tour.succs)
    assert keeps(problem, tour.order)
    assert is_on_time(tour)


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_leaves_time(planner: str) -> None:
    """Not all know of time; none may return what does not keep it."""
    problem = problem_with_lags(3, 60, density=0.02)
    result = plan_order(problem, planner=planner, stopping=Stopping(iterations=20_000), seed=1)
    assert keeps(problem, result.toolpath.order)
    assert result.cost < result.source_cost or planner not in KEEP_LAGS
    assert result.cost <= result.source_cost
    if planner != "slicer":  # without lags some search ends in an order that breaks them
        free = [
            plan_order(
                replace(problem, timed_lags=None), planner=planner, seed=seed,
                stopping=Stopping(iterations=20_000),
            ).toolpath.order
            for seed in range(4)
        ]  # fmt: skip
        assert not all(keeps(problem, order) for order in free)


@pytest.mark.parametrize("seed", range(6))
def test_hybrid_finds_the_optimum_of_small_prints(seed: int) -> None:
    """Against every order there is; without directions, so that an order has one cost."""
    problem = problem_with_lags(seed, 7, density=0.12, longest=4.0)
    problem = replace(problem, reversible=np.zeros(7, np.bool_))
    graph, tour = problem.graph, sliced_tour(problem)
    is_reversed, least = np.zeros(7, np.uint8), np.inf
    for row in permutations(range(7)):
        order = np.array(row, np.int32)
        if respects(order, graph.succ_offsets, graph.succs) and keeps(problem, order):
            least = min(least, tour_cost(tour.metric, order, is_reversed))
    result = plan_order(problem, planner="hybrid", stopping=Stopping(iterations=50_000), seed=0)
    assert result.cost == pytest.approx(least)
    assert toolpath_cost(problem, result.toolpath) == pytest.approx(least)


def test_equal_seeds_give_equal_orders() -> None:
    """Results must be repeatable, whatever the threads' pace."""
    problem = problem_with_lags(8, 80, density=0.02)
    first, second = (
        plan_order(problem, planner="hybrid", stopping=Stopping(iterations=40_000), seed=4)
        for _ in range(2)
    )
    assert (first.toolpath.order == second.toolpath.order).all()
    assert first.cost < first.source_cost


def test_the_source_owes_no_more_than_it_gives() -> None:
    """It is the way out when nothing else is found, so it must keep its own lags."""
    lags = Lags(np.array([0, 0, 0, 1]), np.array([0], np.int32), np.array([10.0]))
    timed_lags = TimedLags.kept_by_source(lags, np.array([1.0, 4.0, 1.0]))
    assert timed_lags.lags.seconds.tolist() == [4.0]
    assert timed_lags.keeps(np.array([0, 1, 2], np.int32))
    assert not timed_lags.keeps(np.array([0, 2, 1], np.int32))
    with pytest.raises(ValueError, match="times of 3 contours, expected 5"):
        replace(random_problem(1, 5, density=0.1), timed_lags=timed_lags)


def test_a_search_that_is_to_stop_does_not_begin() -> None:
    """Ctrl-C while the first of two searches runs ends both."""
    problem = problem_with_lags(8, 80, density=0.02)
    result = plan_order(
        problem, planner="hybrid", stopping=Stopping(seconds=60.0, asked=lambda: True), seed=4
    )
    assert result.iterations == 0


def test_a_part_of_a_sequence_has_no_time_of_its_own() -> None:
    """What is due across a cut would be lost."""
    problem = problem_with_lags(2, 20, density=0.1)
    sequence = Sequence.best_of(started(problem), near_ports(problem))
    assert len(cut(sequence, 0, 20).ids) == 20
    with pytest.raises(ValueError, match="keep time"):
        cut(sequence, 0, 10)
