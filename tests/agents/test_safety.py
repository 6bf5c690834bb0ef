"""Random worlds with deaths, hangs, cuts, storms and unequal hosts: never two plans released."""

from __future__ import annotations

import numpy as np
import pytest

from agents.agreeing.events import HeadFenced
from agents.networks.memory import Weather
from tests.agents.simulation import Team


def disturb(team: Team, rng: np.random.Generator, *, again: bool = False) -> None:
    """Do one random thing to the team; `again`: heads that died may be started again, once."""
    if again and rng.random() < 0.4:
        off = [h for h, epoch in team.epochs.items() if h not in team.agents and epoch == 1]
        if off:
            head = int(rng.choice(off))
            dead = [h for h in team.epochs if h not in team.agents and h != head]
            team.add(head, epoch=2)
            team.fronts[head].asked.extend(HeadFenced(h, team.epochs[h]) for h in dead)
            return
    heads = sorted(team.agents)
    if len(heads) < 2:
        return
    head, other = (int(h) for h in rng.choice(heads, 2, replace=False))
    what = rng.integers(5)
    if what == 0:
        (team.network.resume if head in team.network.hung else team.network.hang)(head)
    elif what == 1:
        team.network.cut(head, other)
    elif what == 2:
        team.network.heal(head, other)
    elif what == 3:
        team.stuck ^= {head}  # its planner, not its network
    elif len(heads) > 2 and rng.random() < (0.8 if again else 0.3):
        team.fence(head)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(15))
def test_no_world_makes_two_heads_release_different_plans(seed: int) -> None:
    """Two plans at once is a crash of heads; no plan is only a pity."""
    rng = np.random.default_rng(seed)
    weather = Weather(loss=0.2, delay_s=(0.0, 0.6), duplicate=0.2)
    quirks = {3: "another host"} if seed % 3 == 2 else {}
    team = Team(4, weather, seed=seed, limit_s=0.5, quirks=quirks, silence_s=1.0)
    team.network.lease_s = 0.3
    ever: set[str] = set()
    for _ in range(12):
        team.run(float(rng.uniform(0.05, 0.5)))
        disturb(team, rng)
        ever |= {release.digest for release in team.releases().values()}
    settle(team)
    live = {release.digest for release in team.releases().values()}
    assert len(ever | live) == 1
    assert len(team.releases()) == len(team.agents)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(15))
def test_heads_that_come_back_make_no_two_plans(seed: int) -> None:
    """A successor is told of the dead, and the living of its death, at any moment and order."""
    rng = np.random.default_rng([seed, 1])
    weather = Weather(loss=0.2, delay_s=(0.0, 0.6), duplicate=0.2)
    quirks = {3: "another host"} if seed % 3 == 2 else {}
    limit_s = 0.5 if seed % 2 else 3.0  # most deaths while agreeing, or while planning
    team = Team(4, weather, seed=seed, limit_s=limit_s, quirks=quirks, silence_s=1.0)
    team.network.lease_s = 0.3
    for _ in range(16):
        team.run(float(rng.uniform(0.05, 0.5)))
        disturb(team, rng, again=True)
        for head in [head for head, agent in team.agents.items() if agent.done]:
            team.fence(head)  # the launcher sees that its process ended
        # Of the living: where all that released are dead the others propose anew.
        assert len({release.digest for release in team.releases().values()}) <= 1
    settle(team)
    assert len({release.digest for release in team.releases().values()}) == 1
    # Who came after the release takes leave, and stays where it is.
    assert all(agent.released or agent.done for agent in team.agents.values())


def settle(team: Team) -> None:
    """Heal everything and let the team come to an end."""
    team.stuck.clear()
    for head in sorted(team.agents):
        if head in team.network.hung:
            team.network.resume(head)
    heads = sorted(team.agents)
    for i, head in enumerate(heads):
        for other in heads[i + 1 :]:
            team.network.heal(head, other)
    team.run(15.0)
