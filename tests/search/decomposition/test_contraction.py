"""A contraction loses nothing and allows nothing new but other orders of what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts._kernels.sequence.tour import respects
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.contraction import contract
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
    assert (few.expanded(few.start()).order == whole.order).all()
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
