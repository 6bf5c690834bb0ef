"""A team of agents on a network in memory, stepped by hand: no threads, no sleeping.

Its clock is the network's, so a run repeats bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agents.agreeing.events import HeadFenced, Notice, PlanReleased, ProtocolEvent
from agents.loop.agent import Agent, AgentProgress, Meet
from agents.networks.memory import MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Traffic
from agents.planners.planner import AgentPlanner

STEP_S = 0.02


class Recorder:
    """A front end that keeps what it is told; `asked` is what it asks next."""

    def __init__(self) -> None:
        self.asked: list[ProtocolEvent | Meet] = []
        self.notices: list[Notice] = []

    def commands(self) -> list[ProtocolEvent | Meet]:
        """Return what is asked, once."""
        asked, self.asked = self.asked, []
        return asked

    def progress(self, progress: AgentProgress, traffic: Traffic) -> None:
        """Keep the last progress."""
        self.last = progress

    def notify(self, effect: Notice) -> None:
        """Keep what is told."""
        self.notices.append(effect)

    def of(self, kind: type) -> list[Any]:
        """Return what was told of one kind."""
        return [effect for effect in self.notices if isinstance(effect, kind)]


class MemoryTeam:
    """Agents 0..n-1 over one network."""

    def __init__(
        self,
        n: int,
        weather: Weather,
        planner_of: Callable[[int], AgentPlanner],
        *,
        seed: int = 0,
        limit_s: float = 1.0,
        silence_s: float = 15.0,
    ) -> None:
        self.network = MemoryNetwork(np.random.default_rng(seed), weather)
        self.limit_s, self.silence_s = limit_s, silence_s
        self.planner_of = planner_of
        self.stuck: set[int] = set()  # heads whose planner does not return
        self.fronts = {h: Recorder() for h in range(n)}
        self.agents: dict[int, Agent] = {}
        self.epochs: dict[int, int] = {}
        for head in range(n):
            self.add(head)

    def add(self, head: int, *, epoch: int = 1, fenced: tuple[int, ...] = ()) -> None:
        """Let a head begin, or one that was killed begin again as a later `epoch`."""
        self.epochs[head] = epoch
        self.agents[head] = Agent(
            head,
            epoch,
            planner=self.planner_of(head),
            transport=MemoryTransport(self.network, head, epoch).__enter__(),
            front=self.fronts[head],
            time_limit_s=self.limit_s,
            clock=lambda: self.network.now,
            fenced=fenced,
            silence_s=self.silence_s,
        )

    def run(self, seconds: float) -> None:
        """Let all agents go on for so many seconds of the network's clock."""
        end = self.network.now + seconds
        while self.network.now < end:
            self.network.advance(STEP_S)
            for head, agent in self.agents.items():
                transport = self.network.transports.get(head)
                free = transport is not None and not transport.hung
                if free and head not in self.stuck:
                    agent.step()

    def kill(self, head: int) -> None:
        """Let a head's process die."""
        self.network.kill(head)
        del self.agents[head]

    def fence(self, head: int) -> None:
        """Kill a head for sure and tell the others, as the launcher does."""
        epoch = self.epochs[head]
        if head in self.agents:
            self.kill(head)
        for other in self.agents:
            self.fronts[other].asked.append(HeadFenced(head, epoch))

    def releases(self) -> dict[int, PlanReleased]:
        """Return what each head has released, of those that have."""
        return {h: a.released for h, a in self.agents.items() if a.released is not None}
