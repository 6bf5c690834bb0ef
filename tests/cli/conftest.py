"""Heads that plan in this process, for what the command line does around them."""

from __future__ import annotations

from typing import Any

import pytest

from agents.launch import LaunchResult
from agents.spawn import Agreement
from decmcts.cli import team
from decmcts.team.dec_mcts.rounds import plan_team
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Jobs and machines given to agents, which here agree in this process and at once."""
    given: list[Any] = []

    def agree(job: Any, machine: Any, graph: Any, *, lags: Any, **_: Any) -> LaunchResult:
        given.append((job, machine))
        problem = build_team_problem(job, machine, graph, lags)
        live = tuple(range(len(machine.heads)))
        best = plan_team(problem, time_limit_s=60.0, max_rounds=1, seed=0)
        found = resolve(problem, best.plans, live)
        agreement = Agreement(best.plans, found.makespan_s, found.digest, live, ())
        return LaunchResult(agreement, found.toolpaths, problem.digest)

    monkeypatch.setattr(team, "launch_agents", agree)
    return given
