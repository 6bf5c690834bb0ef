"""What is said of agents that were lost, failed or disturbed."""

from __future__ import annotations

from typing import Any

from agents.launching.supervisor import AgentStatus
from decmcts.planning.team.outcome import Outcome, lines_of


def said(outcome: Outcome) -> tuple[Any, list[str]]:
    team = outcome.metrics()["team"]
    return team, lines_of(team)


def test_a_joint_plan_that_was_lost_is_said() -> None:
    """The exit code is 0, for the plan is safe; a program that reads it must not be misled."""
    killed = AgentStatus(0, "left", "lost", note="killed by SIGKILL")
    team, lines = said(Outcome(None, (killed,), "every agent ended: killed by SIGKILL"))
    assert team["agreed"] is False and team["failed"] == "every agent ended: killed by SIGKILL"
    assert lines == ["every agent ended: killed by SIGKILL; one head prints alone"]


def test_who_disturbed_is_counted_and_said() -> None:
    """What an agent's own queue drops is no disturbance."""
    dropped = {"forged message": 3, "outgoing queue full": 9}
    agents = tuple(AgentStatus(h, name, dropped=dropped) for h, name in enumerate("ab"))
    team, lines = said(Outcome(None, agents))
    assert team["disturbed"] == {"forged message": 6}
    assert lines == ["somebody disturbed the agents; dropped and not heard: 6 × forged message"]


def test_without_disturbance_nothing_is_said() -> None:
    """The usual summary has no line more."""
    assert said(Outcome(None, (AgentStatus(0, "left"),)))[1] == []
