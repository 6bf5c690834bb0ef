"""Agents that agree over a network in memory, whose clock and losses repeat bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from agents.agreeing.events import PlanReleased
from agents.networks.memory import Weather
from agents.planners.planner import AgentPlanner
from agents.planners.serial import joint_order
from decmcts.errors import VerificationError
from decmcts.experiments.kinds import Key
from decmcts.experiments.teams import Given, exact
from decmcts.print.plan import PlanDocument
from sim.experiments.memory_team import STEP_S, MemoryTeam

PATIENCE_S = 300.0  # of the network's clock, after which a team that has not agreed has failed
ROUND_S = 0.4  # processor time that a round takes about, to turn seconds asked for into rounds
DUPLICATE = 0.1  # of messages arrive twice where any are lost


class Agreed(NamedTuple):
    """What a team has agreed on."""

    document: PlanDocument  # that the judge has passed
    planned_s: float  # simulated seconds of planning
    released_s: float  # until the last head released the plan
    messages: int  # that all heads sent
    live: int


def rounds_of(key: Key) -> int:
    """Return how many rounds a head plans."""
    return int(key["iterations"]) or max(1, round(float(key["seconds"]) / ROUND_S))


def weather_of(loss: float, delay_s: float) -> Weather:
    """Return a network that loses, delays by up to so long and then repeats some messages."""
    return Weather(loss, (0.0, delay_s), DUPLICATE if loss or delay_s else 0.0)


def agreed(
    what: Given, weather: Weather, planner_of: Callable[[int], AgentPlanner], key: Key,
    disturb: Callable[[MemoryTeam], None] = lambda _team: None,
) -> Agreed:  # fmt: skip
    """Let agents plan and agree; a round takes 0.02 simulated seconds.

    `disturb` is called before every step.

    Raises
    ------
    VerificationError
        Where they come to no plan, to two, or to one that the judge refuses.
    """
    limit_s, heads = rounds_of(key) * STEP_S, len(what.problem.machine.heads)
    team = MemoryTeam(heads, weather, planner_of, seed=int(key["seed"]), limit_s=limit_s)
    while team.network.now < PATIENCE_S and not _done(team):
        disturb(team)
        team.run(STEP_S)
    releases = list(team.releases().values())
    if not _done(team):
        raise VerificationError(f"{len(releases)} of {len(team.agents)} heads agreed in time")
    if len({release.digest for release in releases}) > 1:
        raise VerificationError("two plans were released")
    sent = sum(sum(agent.traffic.sent.values()) for agent in team.agents.values())
    document = _exact(what, releases[0])
    return Agreed(document, limit_s, team.network.now, sent, len(releases[0].live))


def _done(team: MemoryTeam) -> bool:
    return len(team.releases()) == len(team.agents)


def _exact(what: Given, release: PlanReleased) -> PlanDocument:
    order = joint_order(what.team, release.plans, release.live)
    if order.digest != release.digest:
        raise VerificationError("the plan that was released resolves to another here")
    return exact(what, order.toolpaths)
