"""How an agent's process ended, in words."""

from __future__ import annotations

import os
import queue
import signal
import sys

import pytest

from agents.launching.processes import AgentLine, AgentProcess


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "killed by SIGKILL"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "killed by SIGSEGV"),
        ("import sys; sys.exit('decmcts: no such port')", "no such port"),
        ("import sys; sys.exit(3)", "its process ended (3)"),
    ],
)
def test_an_end_is_told_as_what_it_was(code: str, said: str) -> None:
    """A killed agent was reported by its last note: 'right is here'."""
    heard: queue.Queue[AgentLine] = queue.Queue()
    agent = AgentProcess(0, (sys.executable, "-c", code), heard.put)
    assert heard.get(timeout=30.0).line is None
    assert agent.ending() == said
    agent.reap()


@pytest.mark.slow
def test_a_running_agent_has_no_end() -> None:
    heard: queue.Queue[AgentLine] = queue.Queue()
    agent = AgentProcess(0, (sys.executable, "-c", "import time; time.sleep(60)"), heard.put)
    os.kill(agent.pid, signal.SIGSTOP)
    assert agent.ending() == ""
    agent.kill()
    assert agent.ending() == "killed by SIGKILL"
    agent.reap()
