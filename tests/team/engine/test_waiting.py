"""What waiting costs is part of what heads agree on, as it is part of the exact plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.team.dec_mcts.polish import Polish
from decmcts.team.engine.plans import StatedOrder, encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import Resolved, resolve
from decmcts.team.schedule.joint_plan import schedule

REST_S = 2.0


def _agreed(chosen: Any, seed: int, rest_s: float) -> tuple[TeamProblem, Resolved]:
    """Return what two heads agree on without a search, on a machine that loses so much."""
    machine = replace(chosen.machine, rest_s=rest_s, release="point", signal_interval_s=0.0)
    problem = build_team_problem(chosen.job, machine, chosen.graph)
    plan = encode(seed, problem.n_macros)
    return problem, resolve(problem, {0: plan, 1: plan}, [0, 1])


def _exact_s(problem: TeamProblem, found: Resolved) -> tuple[float, int]:
    """Return when the exact plan ends, and how many of its actions wait."""
    plan = schedule(problem.job, problem.machine, problem.graph, found.toolpaths)
    stops = sum(int((np.diff(head.after_offsets) > 0).sum()) for head in plan.heads)
    return plan.makespan_s, stops


@pytest.mark.parametrize("seed", range(8))
def test_heads_agree_on_when_the_exact_plan_ends(case: Callable[..., Any], seed: int) -> None:
    """Where they wait often too: only travels, timed by their lengths, differ."""
    chosen = case(seed, towers=8, reach=5.0)
    problem, found = _agreed(chosen, seed, REST_S)
    exact_s, stops = _exact_s(problem, found)
    free, quick = _agreed(chosen, seed, 0.0)
    apart_s = abs(quick.makespan_s - _exact_s(free, quick)[0])
    assert stops > 4
    assert abs(found.makespan_s - exact_s) <= apart_s + REST_S


@pytest.mark.parametrize("seed", range(4))
def test_an_order_searched_for_waits_less_where_waiting_costs_much(
    case: Callable[..., Any], seed: int
) -> None:
    """The search trades waits for other things, by what they cost."""
    waits = []
    for rest_s in (0.0, REST_S):
        problem, found = _agreed(case(seed, towers=8, reach=5.0), seed, rest_s)
        polish = Polish(problem, StatedOrder.of(found.toolpaths), seed=1)
        polish.improve(12)
        best = polish.best
        exact = schedule(problem.job, problem.machine, problem.graph, best.toolpaths(2))
        waits.append(sum(int((np.diff(h.after_offsets) > 0).sum()) for h in exact.heads))
    assert waits[1] < waits[0]
