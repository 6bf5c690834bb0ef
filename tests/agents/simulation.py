"""A team of agents on a memory network, stepped by hand: no threads, no sleeping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agents.agreeing.events import Event, Fenced, Left, Note, Refused, Release, Unfenced
from agents.loop.agent import Agent, Meet, Progress
from agents.networks.memory import MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Traffic
from agents.planners.planner import Planner
from tests.agents.toy import ToyPlanner

STEP_S = 0.02


class Recorder:
    """A front end that keeps what it is told."""

    def __init__(self) -> None:
        self.asked: list[Event | Meet] = []
        self.told: list[Note | Refused | Unfenced | Release | Left] = []

    def commands(self) -> list[Event | Meet]:
        asked, self.asked = self.asked, []
        return asked

    def progress(self, progress: Progress, traffic: Traffic) -> None:
        self.last = progress

    def tell(self, effect: Note | Refused | Unfenced | Release | Left) -> None:
        self.told.append(effect)

    def of(self, kind: type) -> list[Any]:
        return [effect for effect in self.told if isinstance(effect, kind)]


class Team:
    """Agents 0..n-1 over one network."""

    def __init__(
        self,
        n: int,
        weather: Weather,
        *,
        seed: int = 0,
        limit_s: float = 1.0,
        needed: int | None = None,
        quirks: dict[int, str] | None = None,
        silence_s: float = 15.0,
        planner_of: Callable[[int], Planner] | None = None,
    ) -> None:
        self.network = MemoryNetwork(np.random.default_rng(seed), weather)
        self.names = tuple(f"head{h}" for h in range(n))
        self.seed, self.limit_s, self.needed = seed, limit_s, needed
        self.quirks, self.silence_s = quirks or {}, silence_s
        self.planner_of = planner_of  # None: the small one of the tests
        self.stuck: set[int] = set()  # heads whose planner does not return
        self.fronts = {h: Recorder() for h in range(n)}
        self.agents: dict[int, Agent] = {}
        self.epochs: dict[int, int] = {}
        for head in range(n):
            self.add(head)

    def add(
        self, head: int, *, epoch: int = 1, jobs: int = 40, fenced: tuple[int, ...] = ()
    ) -> None:
        self.epochs[head] = epoch
        transport = MemoryTransport(self.network, head, epoch).__enter__()
        if self.planner_of is not None:
            planner = self.planner_of(head)
        else:
            planner = ToyPlanner(
                head,
                names=self.names,
                jobs=jobs,
                seed=self.seed,
                needed=self.needed,
                quirk=self.quirks.get(head, ""),
            )
        self.agents[head] = Agent(
            head,
            epoch,
            planner=planner,
            transport=transport,
            front=self.fronts[head],
            time_limit_s=self.limit_s,
            clock=lambda: self.network.now,
            fenced=fenced,
            silence_s=self.silence_s,
        )

    def run(self, seconds: float) -> None:
        end = self.network.now + seconds
        while self.network.now < end:
            self.network.advance(STEP_S)
            for head, agent in self.agents.items():
                transport = self.network.transports.get(head)
                free = transport is not None and not transport.hung
                if free and head not in self.stuck:
                    agent.step()

    def kill(self, head: int) -> None:
        self.network.kill(head)
        del self.agents[head]

    def fence(self, head: int) -> None:
        """Kill a head for sure and tell the others, as the launcher does."""
        epoch = self.epochs[head]
        if head in self.agents:
            self.kill(head)
        for other in self.agents:
            self.fronts[other].asked.append(Fenced(head, epoch))

    def releases(self) -> dict[int, Release]:
        return {h: a.released for h, a in self.agents.items() if a.released is not None}
