"""What joint plans are worth: each resolved once, the best kept, the work counted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.team.engine.plans import StatedOrder, encode, encode_stated
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.values import EACH, JointValues, Plan

TEAM = (0, 1)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    chosen = case(2, towers=4, reach=5.0)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def _plans(problem: TeamProblem, policy: int) -> dict[int, Plan]:
    return {r: encode(policy, problem.n_macros) for r in TEAM}


def test_each_joint_plan_is_resolved_once(problem: TeamProblem) -> None:
    """What is known costs nothing, and the count says what was done."""
    values, plans = JointValues(problem), _plans(problem, 1)
    assert not values.knows(plans, TEAM)
    found = values.makespan(plans, TEAM)
    assert found == resolve(problem, plans, TEAM).makespan_s == values.makespan(plans, TEAM)
    assert values.knows(plans, TEAM) and values.placed == len(problem.macro) + EACH


def test_the_best_is_kept_and_the_best_that_states_no_order(problem: TeamProblem) -> None:
    """Polishing begins from plans of macro-actions; what it makes is offered."""
    values = JointValues(problem)
    found = {k: values.makespan(_plans(problem, k), TEAM) for k in range(6)}
    best = min(found.values())
    assert values.best[TEAM].makespan_s == values.starts[TEAM].makespan_s == best
    worst = _plans(problem, max(found, key=found.__getitem__))
    stated = StatedOrder.of(resolve(problem, values.best[TEAM].plans, TEAM).toolpaths)
    told = {0: encode_stated(stated, 2, problem.n_macros), 1: worst[1]}
    assert values.makespan(told, TEAM) == best and values.stated(told) is not None
    assert values.stated(values.best[TEAM].plans) is not None
    assert values.stated(values.starts[TEAM].plans) is None


def test_heads_that_cannot_print_everything_are_worth_nothing(case_of: Callable[..., Any]) -> None:
    """The gain over doing nothing is then all there is, and no plan of theirs is tried again."""
    lines = [[(x, 20.0, 0.5), (x + 3.0, 20.0, 0.5)] for x in (2.0, 115.0)]
    chosen = case_of(*lines)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    assert not problem.space.eligible.all(axis=0).any()
    values, plans = JointValues(problem), _plans(problem, 0)
    for r in TEAM:
        assert values.makespan({r: plans[r]}, (r,)) == np.inf
        assert values.value({r: plans[r]}, (r,)) == 0.0
        assert values.utility(1 - r, plans, TEAM) == values.value(plans, TEAM)
    assert values.placed == len(problem.macro) + EACH
