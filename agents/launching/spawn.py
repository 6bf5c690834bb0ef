"""Starts one agent process per head, has them supervised and returns their agreement.

Knows nothing of prints: which program an agent is and what it plans are
arguments. `agents.launch` uses it for real prints.
"""

from __future__ import annotations

import secrets
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.launching.crew import EXTRUDER, Crew
from agents.launching.supervisor import AgentStatus, OnProgress, Supervisor
from decmcts.search.sequence.stopping import Stopping

OnStart = Callable[[Mapping[int, int]], None]
"""Told the process id of every head."""

PORTS = range(10_000, 32_768)  # outgoing connections get 32768 and more on Linux, 49152 elsewhere


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """The plan the agents released, and how they came to it."""

    plans: Mapping[int, NDArray[np.int32]]  # head -> its plan
    makespan_s: float
    digest: str
    live: tuple[int, ...]  # heads the plan uses
    agents: tuple[AgentStatus, ...]  # of every head, lost ones included


@dataclass(frozen=True, slots=True)
class Meeting:
    """Where the agents of one launch find each other."""

    ports: tuple[int, ...]  # one a head, on loopback
    session: str  # name that those of no other launch know

    @staticmethod
    def fresh(n: int) -> Meeting:
        """Return free ports for `n` agents, and a name nobody can guess."""
        return Meeting(free_ports(n), secrets.token_hex(8))


def free_ports(n: int, ports: range = PORTS) -> tuple[int, ...]:
    """Return `n` different loopback ports that are free now and likely stay so.

    Systems give higher ones to outgoing connections: those of agents that try to reach a
    peer could take its port before it listens there.

    Raises
    ------
    OSError
        If there are not so many.
    """
    found: list[int] = []
    with ExitStack() as stack:
        for port in secrets.SystemRandom().sample(ports, len(ports)):
            if len(found) == n:
                break
            each = stack.enter_context(socket.socket())
            with suppress(OSError):
                each.bind(("127.0.0.1", port))
                found.append(port)
    if len(found) < n:
        raise OSError(f"no {n} free ports from {ports.start} to {ports.stop - 1}")
    return tuple(found)


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
    the process ids. They meet at a `meeting` of their own unless one is given.

    Parameters
    ----------
    stopping : Stopping
        What ends planning. Seconds count from when all agents are ready; ten times a second
        it is polled whether to agree on the best so far. Iterations cannot be limited.

    Raises
    ------
    LaunchError
        If there is no plan.
    ValueError
        If there is no limit of seconds, or one of iterations.
    """
    if stopping.seconds is None or stopping.iterations is not None:
        raise ValueError("agents plan by the clock: limit seconds, and no iterations")
    epoch = time.time_ns() // 1_000_000
    shared = [*arguments, *_planning_arguments(stopping.seconds, seed), "--epoch", str(epoch)]
    if len(names) > 1:  # one head is the single-extruder mode: no network
        shared += _meeting_arguments(meeting or Meeting.fresh(len(names)))
    with crew if crew is not None else Crew(len(names), command) as team:
        team.begin(shared)
        if on_start is not None:
            on_start({head: agent.pid for head, agent in team.agents.items()})
        supervisor = Supervisor(
            team.agents,
            tuple(names),
            team.heard,
            stopping=stopping,
            epoch=epoch,
            on_progress=on_progress,
        )
        released = supervisor.run()
    return _agreement(released, tuple(supervisor.status))


def _planning_arguments(time_limit_s: float, seed: int) -> list[str]:
    return ["--controlled", "--time-limit", repr(time_limit_s), "--seed", str(seed)]


def _meeting_arguments(meeting: Meeting) -> list[str]:
    return ["--ports", ",".join(map(str, meeting.ports)), "--session", meeting.session]


def _agreement(released: dict[str, Any], status: tuple[AgentStatus, ...]) -> Agreement:
    plans = {int(h): np.array(plan, np.int32) for h, plan in released["plans"].items()}
    return Agreement(
        plans, released["makespan_s"], released["digest"], tuple(released["live"]), status
    )
