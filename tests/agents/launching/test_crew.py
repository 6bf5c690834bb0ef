"""Agent processes that are started before there is anything to plan."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from agents.launching import spawn as crews
from agents.launching.processes import AgentLine, AgentProcess
from agents.launching.spawn import Crew

SLEEPS = (sys.executable, "-c", "import time; time.sleep(60)")


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_a_crew_that_cannot_start_leaves_none_behind(
    monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    """Too many processes, or Ctrl-C: those that were started are ended, for nobody else will."""
    started: list[AgentProcess] = []

    def start(
        head: int, command: tuple[str, ...], hear: Callable[[AgentLine], None]
    ) -> AgentProcess:
        if head == 2:
            raise error
        started.append(AgentProcess(head, command, hear))
        return started[-1]

    monkeypatch.setattr(crews, "AgentProcess", start)
    with pytest.raises(error), Crew(3, SLEEPS):
        pass
    left = [agent for agent in started if agent.running]
    for agent in left:
        agent.kill()
    assert len(started) == 2 and not left
