"""Agent processes that are started before there is anything to plan.

An agent takes seconds to load its modules and kernels. A crew does that while the launcher
reads and judges the print. Each agent is then handed its arguments on its stdin, where other
users of the host do not see them. An agent that is handed nothing ends with its launcher
(`agents.loop.pipes`), or is killed here: nobody has met it yet.
"""

from __future__ import annotations

import queue
import sys
from collections.abc import Mapping, Sequence
from typing import Self

from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.networks.meeting import Meeting

EXTRUDER = (sys.executable, "-P", "-m", "agents.extruder")


class Crew:
    """One agent process a head; use as a context manager, which starts and ends them.

    Parameters
    ----------
    heads : int
        How many.
    command : sequence of str
        What each runs; it is started with `PIPED` and handed all else by `begin`.
    """

    def __init__(self, heads: int, command: Sequence[str] = EXTRUDER) -> None:
        self.received: queue.Queue[AgentLine]  # what they write
        self._heads, self._command = heads, (*command, PIPED)
        self._agents: dict[int, AgentProcess] = {}
        self._begun = False

    def __len__(self) -> int:
        """Return how many heads it is for."""
        return self._heads

    def __enter__(self) -> Self:
        """Start the processes, unless they are started already."""
        if not self._agents:
            self.received = queue.Queue()
            try:
                for head in range(self._heads):
                    self._agents[head] = AgentProcess(head, self._command, self.received.put)
            except BaseException:  # no `__exit__` comes behind this
                self._end()
                raise
        return self

    def __exit__(self, *error: object) -> None:
        """End all of them, once."""
        self._end()

    def _end(self) -> None:
        agents, self._agents = list(self._agents.values()), {}
        begun, self._begun = self._begun, False
        for agent in agents:
            if begun:
                agent.send({"command": "exit"})
            else:
                agent.kill()
        for agent in agents:
            agent.reap()

    @property
    def agents(self) -> Mapping[int, AgentProcess]:
        """The processes, by head."""
        return self._agents

    def begin(self, arguments: Sequence[str], meeting: Meeting | None) -> None:
        """Hand these arguments, its own head and where they meet to every agent."""
        self._begun = True
        for head, agent in self._agents.items():
            agent.begin([*arguments, "--head", str(head)], meeting)

    def start_again(self, head: int, arguments: Sequence[str], meeting: Meeting | None) -> None:
        """Start a process in the place of one that ended, and hand it its arguments."""
        self._agents[head].reap()
        agent = AgentProcess(head, self._command, self.received.put)
        self._agents[head] = agent
        agent.begin([*arguments, "--head", str(head)], meeting)
