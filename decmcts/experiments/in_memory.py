"""Agents that agree over a network in memory, stepped by hand: no threads, no sleeping.

Their clock is the network's, so a run repeats bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from agents.agreeing.events import HeadFenced, Notice, PlanReleased
from agents.loop.agent import Agent, AgentProgress, FrontEnd
from agents.networks.memory import MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Traffic
from agents.planners.serial import joint_order
from agents.planners.team_planner import DecMctsPlanner
from decmcts.errors import VerificationError
from decmcts.experiments.kinds import Key
from decmcts.experiments.teams import Given, exact
from decmcts.print.plan import PlanDocument

PATIENCE_S = 300.0  # of the network's clock, after which a team that has not agreed has failed
ROUND_S = 0.4  # processor time that a round takes about, to turn seconds asked for into rounds
DUPLICATE = 0.1  # of messages arrive twice where any are lost


class Agreed(NamedTuple):
    """What a team has agreed on."""

    document: PlanDocument  # that the judge has passed
    agreeing_s: float  # simulated seconds from the end of planning to the last release
    messages: int  # that all heads sent
    live: int


def rounds_of(key: Key) -> int:
    """Return how many rounds a head plans."""
    return int(key["iterations"]) or max(1, round(float(key["seconds"]) / ROUND_S))


def weather_of(key: Key) -> Weather:
    """Return a network that loses, delays by up to so long and then repeats some messages."""
    loss, delay_s = float(key["loss"]), float(key["delay_s"])
    return Weather(loss, (0.0, delay_s), DUPLICATE if loss or delay_s else 0.0)


def agreed(
    what: Given, planner_of: Callable[[int], DecMctsPlanner], key: Key,
    disturb: Callable[[MemoryTeam], None] = lambda _team: None,
) -> Agreed:  # fmt: skip
    """Let agents plan and agree; a round takes 0.02 simulated seconds.

    `disturb` is called before every step. VerificationError where they come to no plan, to two,
    or to one that the judge refuses.
    """
    limit_s, heads = rounds_of(key) * STEP_S, len(what.problem.machine.heads)
    team = MemoryTeam(heads, weather_of(key), planner_of, seed=int(key["seed"]), limit_s=limit_s)
    while len(releases := team.releases()) < len(team.agents) and team.network.now < PATIENCE_S:
        disturb(team)
        team.run(STEP_S)
    if len(releases) < len(team.agents):
        raise VerificationError(f"{len(releases)} of {len(team.agents)} heads agreed in time")
    first, *others = releases.values()
    if any(release.digest != first.digest for release in others):
        raise VerificationError("two plans were released")
    order = joint_order(what.team, first.plans, first.live)
    if order.digest != first.digest:
        raise VerificationError("the plan that was released resolves to another here")
    sent = sum(sum(agent.traffic.sent.values()) for agent in team.agents.values())
    agreeing_s = team.network.now - limit_s
    return Agreed(exact(what, order.toolpaths), agreeing_s, sent, len(first.live))


STEP_S = 0.02


class Recorder(FrontEnd):
    """A front end that keeps what it is told."""

    def __init__(self) -> None:
        super().__init__()
        self.notices: list[Notice] = []

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

    kind: type[MemoryNetwork] = MemoryNetwork

    def __init__(
        self,
        n: int,
        weather: Weather,
        planner_of: Callable[[int], DecMctsPlanner],
        *,
        seed: int = 0,
        limit_s: float = 1.0,
        silence_s: float = 15.0,
    ) -> None:
        self.network = self.kind(np.random.default_rng(seed), weather)
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
                if head in self.network.transports and head not in self.stuck:
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
