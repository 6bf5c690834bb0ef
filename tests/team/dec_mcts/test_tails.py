"""Tails: how much must still come after a turn, so what a delay there costs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.team.dec_mcts.polish import Polish
from decmcts.team.dec_mcts.windows_kernels import find_tails
from decmcts.team.engine.plans import StatedOrder, encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.replay_kernels import replay
from decmcts.team.engine.resolve import resolve


def _told(case: Callable[..., Any], seed: int) -> tuple[TeamProblem, Polish]:
    """Return a joint order with the marks of all its turns and their tails."""
    chosen = case(seed, towers=8, reach=5.0)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    plans = {r: encode(seed, problem.n_macros) for r in range(2)}
    polish = Polish(problem, StatedOrder.of(resolve(problem, plans, [0, 1]).toolpaths), seed=1)
    n = len(problem.macro)
    joint, visits, fleet, units, heads, marks = polish._engine
    assert replay(n, joint, visits, fleet, units, heads, marks)
    find_tails(visits, fleet, units, marks)
    return problem, polish


def _with_longer(problem: TeamProblem, polish: Polish, contour: int, by_s: float) -> float:
    """Return the makespan of the same order where one contour takes longer."""
    before = problem.visits.seconds[:, contour].copy()
    problem.visits.seconds[:, contour] += by_s
    try:
        return Polish(problem, polish._stated(), seed=1).began_s
    finally:
        problem.visits.seconds[:, contour] = before


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_no_way_is_longer_than_the_print(case: Callable[..., Any], seed: int) -> None:
    """And at the end the longest way is the print."""
    _, polish = _told(case, seed)
    ways = polish._marks.free + polish._marks.tail
    assert ways[1:].max() <= polish.makespan_s + 1e-6
    assert ways[-1].max() == pytest.approx(polish.makespan_s)
    assert (np.ptp(ways, axis=0) > 0).any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_delay_costs_what_the_tail_says(case: Callable[..., Any], seed: int) -> None:
    """Less than the slack costs nothing; on the longest way every second counts."""
    problem, polish = _told(case, seed)
    order, head, marks = polish._joint.order, polish._joint.head, polish._marks
    delay_s, slack_s, cost_s = 0.05, [], []
    for turn, contour in enumerate(order.tolist()):
        r = head[contour]
        way = marks.free[turn + 1, r] + marks.tail[turn + 1, r]
        slack_s.append(polish.makespan_s - way)
        cost_s.append(_with_longer(problem, polish, contour, delay_s) - polish.makespan_s)
    critical = np.array(slack_s) < 1e-6
    free = np.array(slack_s) > delay_s
    costs = np.array(cost_s)
    assert critical.any() and free.any()
    assert costs[critical] == pytest.approx(delay_s)
    assert costs[free] == pytest.approx(0.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("improve", [Polish.recreate, Polish.improve])
def test_tails_are_those_of_the_order_and_not_of_what_was_tried(
    case: Callable[..., Any], improve: Callable[..., None], seed: int
) -> None:
    """After windows that gained nothing units of trials were taken for those of the order."""
    problem, polish = _told(case, seed)
    for _ in range(6):
        improve(polish, 4)
        polish.take(polish._stated())  # nothing to take, but the tails are found
        fresh = Polish(problem, polish._stated(), seed=1)
        fresh.take(fresh._stated())
        assert polish._marks.tail == pytest.approx(fresh._marks.tail)
