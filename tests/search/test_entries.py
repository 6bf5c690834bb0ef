"""Loops entered elsewhere: the search must price, choose and report what it really does."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.planners import PLANNERS, plan_order, toolpath_cost
from decmcts.search.sequence.anneal_kernels import anneal, descend
from decmcts.search.sequence.entries_kernels import choose_visits, slide_entries, visits_cost
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem, Pace, Seams
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem, sliced_tour, tour_cost


def loops(seed: int, n: int, *, most: int = 9, density: float = 0.1) -> OrderProblem:
    """A random problem in which about half the contours may be entered at several places."""
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, n, density=density)
    counts = np.where(rng.random(n) < 0.5, rng.integers(2, most + 1, n), 1)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    enter = rng.integers(0, 5, (offsets[-1], 3)).astype(float)
    leave = enter + rng.integers(0, 2, (offsets[-1], 3))
    vertices = (np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)).astype(np.int32)
    single = np.flatnonzero(counts == 1)
    enter[offsets[single]], leave[offsets[single]] = problem.start[single], problem.end[single]
    first = offsets[:-1]
    return replace(
        problem,
        start=enter[first],
        end=leave[first],
        reversible=problem.reversible & (counts == 1),
        seams=Seams(offsets, enter, leave, vertices),
    )


@pytest.mark.parametrize("temperature", [0.01, 1.0, 100.0])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 30), timed=st.booleans())
def test_summed_changes_equal_the_recomputed_cost(
    temperature: float, seed: int, n: int, timed: bool
) -> None:
    """Moves that change entries on the way must leave no trace when they are refused."""
    problem = loops(seed, n)
    if timed:
        problem = replace(problem, pace=Pace(100.0, 1500.0, 10.0, 200.0, hop_s=0.3, free_mm=2.0))
    tour = sliced_tour(problem)
    before = visits_cost(problem.metric(), tour.order, tour.reversed, tour.entry_id)
    total = anneal(tour, seeded(seed), temperature, 700)
    total += descend(tour, 0, n, 5)
    after = visits_cost(problem.metric(), tour.order, tour.reversed, tour.entry_id)
    assert after == pytest.approx(before + total, abs=1e-6)
    assert tour_cost(tour.metric, tour.order, tour.reversed) == pytest.approx(after)
    assert tour.after.sum() == pytest.approx(after, abs=1e-6)
    assert respects(tour.order, tour.succ_offsets, tour.succs)


@pytest.mark.parametrize("forward", [True, False])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), slack=st.floats(-20.0, 20.0))
def test_sliding_costs_what_it_says_or_leaves_no_trace(
    forward: bool, seed: int, slack: float
) -> None:
    """Never more than the slack; refused, every loop is entered as before."""
    problem, rng = loops(seed, 12), np.random.default_rng(seed)
    tour = sliced_tour(problem)
    chosen = np.flatnonzero(tour.entry_id[tour.order] >= 0)
    if len(chosen) == 0:
        return
    p = int(rng.choice(chosen))
    entry = int(rng.integers(*tour.entry_offsets[tour.order[p] : tour.order[p] + 2]))
    before, cost = tour.entry_id.copy(), tour.after.sum()
    change = slide_entries(tour, p, entry, forward, slack)
    after = visits_cost(problem.metric(), tour.order, tour.reversed, tour.entry_id)
    assert after == pytest.approx(cost + change, abs=1e-9)
    assert tour.after.sum() == pytest.approx(after, abs=1e-9)
    if change == 0.0:
        assert (tour.entry_id == before).all() or slack >= 0.0
    else:
        assert change <= slack
        assert tour.entry_id[tour.order[p]] == entry


def tower(height: int) -> OrderProblem:
    """Square loops of 50 mm above each other, sliced with their seams in the far corner.

    What is printed before and after them lies at the corner opposite.
    """
    corners = np.array([[50.0, 50.0], [0.0, 50.0], [0.0, 0.0], [50.0, 0.0]])
    counts = np.array([1, *([4] * height), 1])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    z = np.repeat(np.arange(height + 2.0), counts)
    xy = np.concatenate([[[-1.0, 0.0]], np.tile(corners, (height, 1)), [[-1.0, 0.0]]])
    enter = np.column_stack([xy, z])
    first, n = offsets[:-1], height + 2
    chain = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    return OrderProblem(
        enter[first],
        enter[first],
        np.zeros(n, np.bool_),
        np.arange(n, dtype=np.int32),
        DependencyGraph.from_pairs(n, chain),
        seams=Seams(offsets, enter, enter, np.arange(len(enter), dtype=np.int32)),
    )


def test_the_seams_of_a_tower_slide_to_another_corner_together() -> None:
    """As far as it takes to gain what was asked for; not at all if it never does."""
    problem = tower(20)
    tour = sliced_tour(problem)
    corner = int(tour.entry_offsets[1]) + 2
    sliced = tour.entry_id.copy()
    assert slide_entries(tour, 1, corner, True, -1000.0) == 0.0
    assert (tour.entry_id == sliced).all()
    assert slide_entries(tour, 1, corner, True, -100.0) < -100.0
    assert (tour.entry_id[1:-1] - tour.entry_offsets[1:-2] == 2).all()


def test_a_sequence_is_entered_as_suits_its_order_best() -> None:
    """All entries at once: no way to enter the tower is cheaper; without a choice none changes."""
    problem = tower(20)
    n = len(problem)
    order, is_reversed = np.arange(n, dtype=np.int32), np.zeros(n, np.uint8)
    assert problem.seams is not None
    near = near_ports(problem)
    sequence = Sequence(problem, problem.metric(), near, order, is_reversed, problem.seams.sliced)
    sequence.choose_entries()
    assert sequence.cost == pytest.approx(2 * np.hypot(1.0, 1.0) + 19)
    fixed = replace(problem, seams=None)
    entry_id = np.full(n, -1, np.int32)
    other = Sequence(fixed, fixed.metric(), near_ports(fixed), order, is_reversed, entry_id)
    cost = other.cost
    other.choose_entries()
    assert other.cost == cost


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_entries_chosen_for_an_order_are_the_cheapest(seed: int) -> None:
    """The dynamic programme is the exact end of every search."""
    problem = loops(seed, 5, most=4)
    seams, order = problem.seams, np.arange(5, dtype=np.int32)
    assert seams is not None
    choice = np.diff(seams.offsets) > 1
    possible = [
        [(0, o) for o in range(seams.offsets[c], seams.offsets[c + 1])]
        if choice[c]
        else [(f, -1) for f in range(1 + int(problem.reversible[c]))]
        for c in range(5)
    ]
    least = min(
        visits_cost(
            problem.metric(),
            order,
            np.array([w[0] for w in visits], np.uint8),
            np.array([w[1] for w in visits], np.int32),
        )
        for visits in product(*possible)
    )
    is_reversed, entry_id = choose_visits(
        problem.metric(), order, problem.reversible, seams.offsets
    )
    assert visits_cost(problem.metric(), order, is_reversed, entry_id) == pytest.approx(least)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(4, 40))
def test_what_a_block_gains_the_whole_sequence_gains(seed: int, n: int) -> None:
    """Local numbers of entries must lead back to the right ones."""
    problem, rng = loops(seed, n), np.random.default_rng(seed)
    tour = sliced_tour(problem)
    anneal(tour, seeded(seed), 3.0, 300)
    sequence = Sequence(
        problem, problem.metric(), near_ports(problem), tour.order, tour.reversed, tour.entry_id
    )
    before = sequence.cost
    first, last = sorted(rng.choice(n + 1, 2, replace=False).tolist())
    block = cut(sequence, first, last)
    change = anneal(block.tour, seeded(seed + 1), 0.5, 300)
    block.put_back(sequence)
    assert sequence.cost == pytest.approx(before + change, abs=1e-6)
    assert respects(sequence.order, problem.graph.succ_offsets, problem.graph.succs)


@pytest.mark.parametrize("planner", sorted(PLANNERS))
def test_every_planner_uses_the_freedom_and_reports_the_vertex(planner: str) -> None:
    """The toolpath's entries must give the cost that was found."""
    problem = loops(3, 40, density=0.05)
    seams = problem.seams
    assert seams is not None
    result = plan_order(problem, planner=planner, stopping=Stopping(iterations=20_000), seed=1)
    start, end = problem.start.copy(), problem.end.copy()
    for c, vertex in zip(result.toolpath.order, result.toolpath.entry, strict=True):
        entry = seams.offsets[c] + vertex
        start[c], end[c] = seams.enter[entry], seams.leave[entry]
    is_reversed = result.toolpath.reversed[:, None]
    order = result.toolpath.order
    enter = np.where(is_reversed, end[order], start[order])
    leave = np.where(is_reversed, start[order], end[order])
    travel = float(np.linalg.norm(enter[1:] - leave[:-1], axis=1).sum())
    assert result.cost == pytest.approx(travel)
    assert toolpath_cost(problem, result.toolpath) == pytest.approx(travel)
    with pytest.raises(ValueError, match="no entry"):
        toolpath_cost(problem, replace(result.toolpath, entry=result.toolpath.entry + 99))
    if planner != "slicer":
        fixed = replace(problem, seams=None)
        without = plan_order(fixed, planner=planner, stopping=Stopping(iterations=20_000), seed=1)
        assert result.cost < without.cost


def test_a_search_out_of_iterations_still_ends_with_the_best_entries() -> None:
    """The exact choice for the order found must not be lost when the descent is cut short."""
    problem = loops(5, 300, density=0.01)
    result = plan_order(problem, planner="hybrid", stopping=Stopping(iterations=9000), seed=1)
    is_reversed, entry_id = problem.visits_for(problem.metric(), result.toolpath.order)
    least = visits_cost(problem.metric(), result.toolpath.order, is_reversed, entry_id)
    assert result.cost == pytest.approx(least)
