"""The moves of local search: cheap changes and cheap feasibility must be the true ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.random_kernels import below, seeded, uniform
from decmcts.search.sequence.anneal_kernels import anneal, descend
from decmcts.search.sequence.insertion_kernels import try_insertion
from decmcts.search.sequence.metric_kernels import costliest, distance, respects
from decmcts.search.sequence.moves_kernels import (
    Tour,
    apply_reversal,
    apply_swap,
    reversal_allowed,
    swap_allowed,
)
from decmcts.search.sequence.problem import OrderProblem, Pace
from tests.search.problems import price, random_problem, sliced_tour, tour_cost, with_bare


def fresh_tour(problem: OrderProblem, group: np.ndarray | None = None) -> Tour:
    return sliced_tour(problem, group)


@pytest.mark.parametrize("temperature", [0.01, 1.0, 100.0])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 30), density=st.sampled_from([0, 0.1, 0.4]))
def test_summed_changes_equal_the_recomputed_cost(
    temperature: float, seed: int, n: int, density: float
) -> None:
    """Annealing that believes wrong changes walks away from good sequences."""
    problem = random_problem(seed, n, density=density)
    tour = fresh_tour(problem)
    before = tour_cost(tour.metric, tour.order, tour.reversed)
    total = anneal(tour, seeded(seed), temperature, 500)
    after = tour_cost(tour.metric, tour.order, tour.reversed)
    assert after == pytest.approx(before + total, abs=1e-6)
    assert tour.after.sum() == pytest.approx(after, abs=1e-6)
    assert respects(tour.order, tour.succ_offsets, tour.succs)
    assert (tour.position[tour.order] == np.arange(n)).all()
    assert not tour.reversed[~problem.reversible].any()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 30))
def test_changes_are_true_for_seconds(seed: int, n: int) -> None:
    """The same moves serve other objectives; a formula mixed up would mislead them."""
    problem = random_problem(seed, n, density=0.1)
    problem = replace(problem, pace=Pace(100.0, 1500.0, 20.0, 300.0, hop_s=0.3, free_mm=2.0))
    tour = fresh_tour(problem)
    before = plain_cost(problem, tour)
    total = anneal(tour, seeded(seed), 1.0, 500)
    assert plain_cost(problem, tour) == pytest.approx(before + total, abs=1e-6)
    assert respects(tour.order, tour.succ_offsets, tour.succs)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 30))
def test_changes_are_true_where_a_climb_may_be_bare(seed: int, n: int) -> None:
    """A travel up costs less than the same down: reversing a segment changes what is inside it."""
    problem = with_bare(random_problem(seed, n, density=0.05, reversible=0.8))
    tour = fresh_tour(problem)
    before = tour_cost(problem.metric(), tour.order, tour.reversed)
    total = anneal(tour, seeded(seed), 1.0, 500)
    after = tour_cost(problem.metric(), tour.order, tour.reversed)
    assert after == pytest.approx(before + total, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_bare_travels_are_priced_as_by_hand(seed: int) -> None:
    """Inside rectangles that change from layer to layer, up one layer but never down."""
    problem = with_bare(random_problem(seed, 40, density=0.0))
    metric, ports = problem.metric(), problem.ports()
    bare, over = 0, 0
    dearest, hopping = costliest(metric, ports), costliest(metric._replace(over=0.0), ports)
    for a, b in product(range(80), repeat=2):
        found = distance(metric, a, b)
        assert found == pytest.approx(price(problem, ports[a], ports[b]))
        assert found <= distance(dearest, a, b) + 1e-12
        bare += found < distance(hopping, a, b)
        over += found > distance(hopping, a, b)
    assert 50 < bare < 3000
    assert over > 50


def plain_cost(problem: OrderProblem, tour: Tour) -> float:
    """Price a sequence by formulas of the test's own."""
    total = 0.0
    for a, b in pairwise(tour.order.tolist()):
        leave = problem.start[a] if tour.reversed[a] else problem.end[a]
        enter = problem.end[b] if tour.reversed[b] else problem.start[b]
        pace = problem.pace
        assert pace is not None
        level, rise = float(np.hypot(*(enter - leave)[:2])), float(abs(enter - leave)[2])
        upright = (pace.z_speed, pace.z_acceleration)
        for length, speed, rate in ((level, pace.speed, pace.acceleration), (rise, *upright)):
            peak = min(speed, (length * rate) ** 0.5)
            total += 2 * peak / rate + (length / peak - peak / rate if peak else 0.0)
        total += pace.hop_s * (level + rise > pace.free_mm)
    return total


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_swaps_and_reversals_are_allowed_exactly_when_the_result_respects_the_graph(
    seed: int,
) -> None:
    """Too strict wastes moves, too lax crashes heads."""
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, 12, density=0.15)
    graph = problem.graph
    i, j, k = sorted(rng.choice(13, 3, replace=False).tolist())
    swapped = fresh_tour(problem)
    allowed = swap_allowed(swapped, i, j, k)
    apply_swap(swapped, i, j, k)
    assert allowed == respects(swapped.order, graph.succ_offsets, graph.succs)
    reversed_tour = fresh_tour(problem)
    allowed = reversal_allowed(reversed_tour, i, k)
    apply_reversal(reversed_tour, i, k)
    assert allowed == respects(reversed_tour.order, graph.succ_offsets, graph.succs)


def test_groups_are_never_mixed() -> None:
    """The planner `layerwise` must print layer after layer."""
    problem = random_problem(3, 30, density=0.0)
    group = (np.arange(30) // 5).astype(np.int32)
    tour = fresh_tour(problem, group)
    before = tour.order.copy()
    anneal(tour, seeded(1), 50.0, 5000)
    assert (tour.order != before).sum() > 15
    assert (np.diff(group[tour.order]) >= 0).all()


def test_equal_seeds_walk_the_same_way() -> None:
    """Results must be repeatable."""
    problem = random_problem(5, 25, density=0.1)
    first, second = fresh_tour(problem), fresh_tour(problem)
    anneal(first, seeded(7), 1.0, 3000)
    anneal(second, seeded(7), 1.0, 3000)
    assert (first.order == second.order).all()
    assert (first.reversed == second.reversed).all()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 30))
def test_descent_ends_where_a_second_one_finds_nothing(seed: int, n: int) -> None:
    """It is the last word of the search: its books must balance and it must finish."""
    problem = random_problem(seed, n, density=0.1)
    tour = fresh_tour(problem)
    before = tour_cost(tour.metric, tour.order, tour.reversed)
    gain = total = descend(tour, 0, n, 50)
    while gain < 0.0:
        gain = descend(tour, 0, n, 50)
        total += gain
    after = tour_cost(tour.metric, tour.order, tour.reversed)
    assert after == pytest.approx(before + total, abs=1e-6)
    assert respects(tour.order, tour.succ_offsets, tour.succs)
    assert not tour.reversed[~problem.reversible].any()


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.02, 0.1, 0.3]))
def test_an_insertion_makes_one_contour_follow_another_feasibly(seed: int, density: float) -> None:
    """It carries dependent contours along, so nothing checks its feasibility afterwards."""
    problem = random_problem(seed, 25, density=density)
    tour = fresh_tour(problem)
    p, at = np.random.default_rng(seed).choice(25, 2, replace=False).tolist()
    if at == p + 1:
        return
    leader, follower = tour.order[p], tour.order[at]
    before = tour_cost(tour.metric, tour.order, tour.reversed)
    change = try_insertion(tour, p, at, 1e9)
    assert respects(tour.order, tour.succ_offsets, tour.succs)
    assert not tour.mark.any()
    assert tour_cost(tour.metric, tour.order, tour.reversed) == pytest.approx(before + change)
    if (tour.order != np.arange(25)).any():
        assert tour.position[follower] == tour.position[leader] + 1


def test_the_largest_random_number_is_still_below_its_limit() -> None:
    """It rounds to 1 once in 2^53 draws; an index of n would read past the end unseen."""
    word, all_ones = (1 << 64) - 1, (1 << 64) - 1
    for shift in (-17, 7, -13):  # undoes the generator's steps, the last first
        undone = word
        for _ in range(10):
            moved = undone << -shift if shift < 0 else undone >> shift
            undone = word ^ (moved & all_ones)
        word = undone
    assert uniform(np.array([word], np.uint64)) == 1.0
    assert below(np.array([word], np.uint64), 7) == 6
