"""What is said of agents that were lost, failed or disturbed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from agents.launching.status import AgentStatus
from decmcts.planning.team.joint import Deciding, Outcome, lines_of


def said(outcome: Outcome) -> tuple[Any, list[str]]:
    team = outcome.metrics()["team"]
    return team, lines_of(team)


def test_a_joint_plan_that_was_lost_is_said() -> None:
    """The exit code is 0, for the plan is safe; a program that reads it must not be misled."""
    killed = AgentStatus(0, "left", "lost", note="killed by SIGKILL")
    team, lines = said(Outcome(None, (killed,), "every agent ended: killed by SIGKILL"))
    assert team["agreed"] is False and team["failed"] == "every agent ended: killed by SIGKILL"
    assert lines == ["every agent ended: killed by SIGKILL; one head prints alone"]


def test_an_agent_that_was_started_again_is_said() -> None:
    """Its head is planned for; who looks at the machine should know why a process died."""
    back = AgentStatus(0, "left", "released", again="killed by SIGKILL")
    lost = AgentStatus(1, "right", "lost", note="it died twice", again="killed by SIGKILL")
    team, lines = said(Outcome(None, (back, lost)))
    assert team["again"] == {"left": "killed by SIGKILL", "right": "killed by SIGKILL"}
    assert lines == [
        "head right was lost (it died twice); the plan does without it",
        "the agent of head left was started again (killed by SIGKILL)",
    ]


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


def test_who_found_the_plan() -> None:
    """The first of those that knew a plan as good as the best."""
    left = AgentStatus(0, "left", history=((1.0, 9.0), (4.0, 5.0)))
    right = AgentStatus(1, "right", history=((2.0, 5.0),))
    assert Outcome(None, (left, right)).metrics()["found_by"] == "right"
    assert Outcome(None, (left, right), "none agreed").metrics()["found_by"] is None


def test_how_distributions_sharpen_is_kept_in_few_rows() -> None:
    """A search of days has as many rows as one of seconds, evenly spread to its end."""
    deciding = Deciding()
    for step in range(10_000):
        heads = (AgentStatus(0, "a", elapsed_s=step / 10, entropy=1.0 - step / 10_000),)
        deciding.take(heads)
    seconds = [row[0] for row in deciding.rows]
    assert 50 <= len(seconds) <= Deciding.MOST and seconds[-1] > 970.0
    gaps = [b - a for a, b in pairwise(seconds)]
    assert max(gaps[1:]) < 3.0 * min(gaps[1:])
    assert [row[1] for row in deciding.rows] == sorted((r[1] for r in deciding.rows), reverse=True)
