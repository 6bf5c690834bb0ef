"""Starts one agent process per head, has them supervised and returns their agreement.

Knows nothing of prints: which program an agent is and what it plans are
arguments. `agents.launch` uses it for real prints.

An agent takes seconds to load its modules and kernels. A crew does that while the launcher
reads and judges the print. Each agent is then handed its arguments on its stdin, where other
users of the host do not see them. An agent that is handed nothing ends with its launcher
(`agents.loop.pipes`), or is killed here: nobody has met it yet.
"""

from __future__ import annotations

import queue
import secrets
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from agents.launching.places import Places
from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.launching.status import AgentStatus, LaunchError, OnProgress
from agents.launching.supervisor import Supervisor
from agents.networks.meeting import Meeting
from decmcts.arrays import Int32s
from decmcts.search.sequence.stopping import Stopping

EXTRUDER = (sys.executable, "-P", "-m", "agents.extruder")


class Crew:
    """One agent process a head; use as a context manager, which starts and ends them.

    Each runs `command` with `PIPED`, and is handed all else by `begin`.
    """

    def __init__(self, heads: int, command: Sequence[str] = EXTRUDER) -> None:
        self.received: queue.Queue[AgentLine]  # what they write
        self._heads, self._command = heads, (*command, PIPED)
        self.agents: dict[int, AgentProcess] = {}  # by head
        self._begun = False

    def __len__(self) -> int:
        """Return how many heads it is for."""
        return self._heads

    def __enter__(self) -> Self:
        """Start the processes, unless they are started already."""
        if not self.agents:
            self.received = queue.Queue()
            try:
                for head in range(self._heads):
                    self.agents[head] = AgentProcess(head, self._command, self.received.put)
            except BaseException:  # no `__exit__` comes behind this
                self.__exit__()
                raise
        return self

    def __exit__(self, *error: object) -> None:
        """End all of them, once."""
        agents, self.agents = list(self.agents.values()), {}
        begun, self._begun = self._begun, False
        for agent in agents:
            if begun:
                agent.send({"command": "exit"})
            else:
                agent.kill()
        for agent in agents:
            agent.reap()

    def begin(self, arguments: Sequence[str], meeting: Meeting | None) -> None:
        """Hand these arguments, its own head and where they meet to every agent."""
        self._begun = True
        for head, agent in self.agents.items():
            agent.begin([*arguments, "--head", str(head)], meeting)

    def start_again(self, head: int, arguments: Sequence[str], meeting: Meeting | None) -> None:
        """Start a process in the place of one that ended, and hand it its arguments."""
        self.agents[head].reap()
        self.agents[head] = AgentProcess(head, self._command, self.received.put)
        self.agents[head].begin([*arguments, "--head", str(head)], meeting)


OnStart = Callable[[Mapping[int, int]], None]
"""Told the process id of every head, and again when one was started again."""

SECRET_BYTES = 32


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """The plan the agents released, and how they came to it."""

    plans: Mapping[int, Int32s]  # head -> its plan
    makespan_s: float
    digest: str
    live: tuple[int, ...]  # heads the plan uses
    agents: tuple[AgentStatus, ...]  # of every head, lost ones included


def run_agents(
    names: Sequence[str],
    arguments: Sequence[str],
    *,
    stopping: Stopping,
    seed: int,
    command: Sequence[str] = EXTRUDER,
    crew: Crew | None = None,
    on_progress: OnProgress | None = None,
    on_start: OnStart | None = None,
    meeting: Meeting | None = None,
) -> Agreement:
    """Run one agent process per head and return what they agreed on.

    Every agent runs `command` with `arguments`, e.g. `--pack DIR`, and its own
    place in the team. They are those of a `crew`, if one that waits is given, which ends
    here. `on_progress` is told the status of all whenever something was heard, `on_start`
    the process ids. They meet at a `meeting` of their own unless one is given. Where it is
    and its secret go to them through their pipes.

    Seconds of `stopping` count from when all agents are ready; ten times a second it is polled
    whether to agree on the best so far. Iterations cannot be limited.

    LaunchError if there is no plan; ValueError without a limit of seconds, or with one of
    iterations.
    """
    if stopping.seconds is None or stopping.iterations is not None:
        raise ValueError("agents plan by the clock: limit seconds, and no iterations")
    epoch = time.time_ns() // 1_000_000
    with (
        Places(len(names)) as places,
        crew if crew is not None else Crew(len(names), command) as team,
    ):
        if meeting is None and len(names) > 1:  # one head alone needs no network
            meeting = Meeting(places.fresh(), secrets.token_bytes(SECRET_BYTES))
        team.begin([*arguments, *_planning_arguments(stopping.seconds, seed, epoch)], meeting)

        def report_start() -> None:
            if on_start is not None:
                on_start({head: agent.pid for head, agent in team.agents.items()})

        def start_again(head: int, epoch: int, left_s: float, places: Sequence[str] | None) -> None:
            where = meeting
            if places is not None and meeting is not None:
                where = replace(meeting, places=tuple(places))
            planning = _planning_arguments(left_s, seed, epoch)
            team.start_again(head, [*arguments, *planning], where)
            report_start()

        report_start()
        supervisor = Supervisor(
            team.agents,
            tuple(names),
            team.received,
            stopping=stopping,
            epoch=epoch,
            on_progress=on_progress,
            elsewhere=places.fresh,
            start_again=start_again,
        )
        try:
            released = supervisor.run()
        except LaunchError as error:
            error.agents = tuple(supervisor.status)
            raise
    plans = {int(h): np.array(plan, np.int32) for h, plan in released["plans"].items()}
    makespan_s, digest, live = (released[name] for name in ("makespan_s", "digest", "live"))
    return Agreement(plans, makespan_s, digest, tuple(live), tuple(supervisor.status))


def _planning_arguments(time_limit_s: float, seed: int, epoch: int) -> list[str]:
    own = ["--time-limit", repr(time_limit_s), "--seed", str(seed), "--epoch", str(epoch)]
    return ["--controlled", *own]
