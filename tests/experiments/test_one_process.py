"""Planners that need no agents: whatever they find is an order the judge accepts."""

from __future__ import annotations

import pytest

from decmcts.experiments.decentral_or_central import by_one_tree
from decmcts.experiments.teams import in_one_process
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.random_teams import judged, problem_of


@pytest.mark.slow
@pytest.mark.parametrize("plan", [by_one_tree, in_one_process])
def test_the_judge_accepts_what_is_found(plan):
    """A planner that cheats would be no yardstick."""
    problem = problem_of(1)
    toolpaths = plan(problem, Stopping(iterations=2), seed=1)
    found = schedule(problem.job, problem.machine, problem.graph, toolpaths)
    assert judged(problem, found, 3).ok
    assert sum(len(path) for path in toolpaths) == len(problem.macro)
