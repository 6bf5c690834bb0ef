"""A contraction loses nothing and allows nothing new but other orders of what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts._kernels.sequence.tour import respects
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.contraction import contract, merge
from decmcts.search.planners import plan_order
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem, with_loops, with_pace


def found(problem: OrderProblem, seed: int, iterations: int = 3000) -> Sequence:
    """A sequence that a short search ends with."""
    result = plan_order(
        problem, planner="local", stopping=Stopping(iterations=iterations), seed=seed
    )
    n, order = len(problem), result.toolpath.order
    is_reversed, entry_id = np.zeros(n, np.uint8), np.full(n, -1, np.int32)
    is_reversed[order] = result.toolpath.reversed
    if problem.seams is not None:
        chosen = order[np.diff(problem.seams.offsets)[order] > 1]
        entry = np.zeros(n, np.int64)
        entry[order] = result.toolpath.entry
        entry_id[chosen] = problem.seams.offsets[chosen] + entry[chosen]
    return Sequence(
        problem, problem.metric(), near_ports(problem), order.copy(), is_reversed, entry_id
    )


def varied(seed: int) -> OrderProblem:
    """Points, loops, seconds or bare costs, in turn."""
    problem = random_problem(seed, 60, density=0.03)
    if seed % 4 == 3:
        costs = np.random.default_rng(seed).random((60, 60))
        return replace(problem, reversible=np.zeros(60, np.bool_), costs=costs)
    problem = with_loops(problem, seed) if seed % 4 == 1 else problem
    return with_pace(problem) if seed % 4 == 2 else problem


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_sequences_of_it_stand_for_allowed_ones_at_their_cost(seed: int) -> None:
    """In any order of the runs the travels inside them stay, the others are those between runs."""
    problem = varied(seed)
    one, other = found(problem, 0), found(problem, 1)
    few = merge(one, other)
    start = few.start()
    assert len(few.problem) < len(problem)
    assert (few.expanded(start).order == one.order).all()
    inside = one.cost - start.cost
    graph = problem.graph
    for again in range(3):
        small = found(few.problem, again, iterations=500 * again)
        whole = few.expanded(small)
        assert sorted(whole.order.tolist()) == list(range(len(problem)))
        assert respects(whole.order, graph.succ_offsets, graph.succs)
        assert not (whole.reversed & ~problem.reversible).any()
        assert whole.cost == pytest.approx(inside + small.cost)


@pytest.mark.slow
def test_what_both_share_is_contracted_and_nothing_else() -> None:
    """Two sequences that are one leave a single run; without any in common all stay."""
    problem = random_problem(5, 30, density=0.0, reversible=0.0)
    one = found(problem, 0)
    assert len(merge(one, one).problem) == 1
    other = Sequence(
        problem,
        one.metric,
        one.near,
        one.order[::-1].copy(),
        one.reversed.copy(),
        one.entry_id.copy(),
    )
    assert len(merge(one, other).problem) == 30


@pytest.mark.slow
@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_any_runs_may_be_contracted(seed: int, timed: bool) -> None:
    """Single contours keep their freedoms, whatever else is contracted; entries stay allowed."""
    problem = varied(seed)
    if timed and problem.costs is None:
        problem = with_pace(problem)
    whole = found(problem, seed)
    few = contract(whole, np.random.default_rng(seed).random(len(problem) - 1) < 0.5)
    inside = whole.cost - few.start().cost
    result = found(few.problem, seed, iterations=2000)
    again = few.expanded(result)
    assert sorted(again.order.tolist()) == list(range(len(problem)))
    assert respects(again.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not (again.reversed & ~problem.reversible).any()
    assert again.cost == pytest.approx(inside + result.cost)
    if problem.seams is not None:
        chosen = again.entry_id >= 0
        assert (problem.seams.owner[again.entry_id[chosen]] == np.flatnonzero(chosen)).all()
        assert (chosen == (np.diff(problem.seams.offsets) > 1)).all()


@pytest.mark.slow
def test_entries_that_differ_are_not_shared() -> None:
    """Two sequences alike but for where a loop is entered differ there."""
    problem = varied(1)
    one = found(problem, 1)
    other = one.copy()
    assert problem.seams is not None
    loop = int(np.flatnonzero(np.diff(problem.seams.offsets) > 1)[0])
    first = int(problem.seams.offsets[loop])
    other.entry_id[loop] = first if one.entry_id[loop] != first else first + 1
    assert len(merge(one, other).problem) in (2, 3)  # the loop, and what is before and behind
