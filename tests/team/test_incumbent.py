"""What a planner of one's own offers is kept if it keeps every rule, and named if it is none."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.incumbent import Budget, TeamIncumbent
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.random_teams import judged


@pytest.fixture
def incumbent(case) -> TeamIncumbent:
    """Two heads on a rail, 48 contours, three joint orders."""
    small = case(0)
    problem = build_team_problem(small.job, small.machine, small.graph)
    return TeamIncumbent(problem, Budget(Stopping(iterations=3)))


def in_halves(incumbent: TeamIncumbent) -> tuple[np.ndarray, np.ndarray]:
    """Return the source's order, each contour by the head that it is near."""
    problem = incumbent.problem
    head = problem.key_terms.side.astype(np.int32)
    may = problem.space.eligible[np.arange(len(head)), head]
    return np.arange(len(head), dtype=np.int32), np.where(may, head, 1 - head).astype(np.int32)


@pytest.mark.slow
def test_the_best_of_what_is_offered_is_kept_and_the_judge_accepts_it(incumbent) -> None:
    """One that breaks a rule counts as tried and costs infinitely much."""
    order, head = in_halves(incumbent)
    assert incumbent.offer_order(order[::-1], head[::-1]) == np.inf  # upper layers first
    kept = incumbent.offer_order(order, head)
    assert kept < np.inf and not incumbent.over
    first = np.where(incumbent.problem.space.eligible[:, 0], 0, 1).astype(np.int32)
    assert incumbent.offer_order(order, first) > kept
    assert incumbent.over and incumbent.found.makespan_s == kept
    job, machine, graph = (getattr(incumbent.problem, n) for n in ("job", "machine", "graph"))
    plan = schedule(job, machine, graph, incumbent.found.toolpaths)
    assert judged(incumbent.problem, plan).ok
    assert plan.assignments.tolist() == head.tolist()


@pytest.mark.parametrize("name", ["order", "head", "reversed"])
@pytest.mark.parametrize(
    "wrong", [None, 1, "1", np.zeros(3, np.int32), np.full(48, 2.5), np.arange(48)[None]]
)
def test_what_is_no_order_is_named(incumbent, name: str, wrong: object) -> None:
    """A planner under construction offers all sorts of things."""
    order, head = in_halves(incumbent)
    if name == "reversed" and (wrong is None or np.size(wrong) == 48):
        return
    with pytest.raises(InputError, match=name):
        incumbent.offer_order(**{"order": order, "head": head, name: wrong})
    assert incumbent.orders == 0


def test_incumbent_keeps_the_best_and_when(incumbent):
    """Time to a target is read off the history."""
    seconds = iter(range(100))
    best = TeamIncumbent(
        incumbent.problem, Budget(Stopping(50.0), clock=lambda: float(next(seconds)))
    )
    for makespan in (9.0, 11.0, 7.0):
        best.offer_toolpaths((), makespan)
    assert [value for _, value in best.found.history] == [9.0, 7.0]
    assert best.orders == 3
