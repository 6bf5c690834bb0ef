"""What every planner promises, whatever it does inside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts._kernels.tour import respects
from decmcts.search.planners import PLANNERS, SearchResult, plan_order
from decmcts.search.problem import OrderProblem
from tests.search.problems import random_problem


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
    assert result.cost_mm == pytest.approx(travel)
    assert result.cost_mm <= result.source_cost_mm
