"""Teams in worlds that once stopped them: unequal hosts, stuck planners, partial cuts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agents.agreeing.agreement import STALLED_TICKS
from agents.agreeing.events import HeadFenced, LogNote, Phase, PlanReleased, Refused, Unfenced
from agents.loop.agent import TICK_S
from agents.messages.codec import encode, kind_of
from agents.messages.kinds import (
    VERSION,
    Envelope,
    Hello,
    Joint,
    Message,
    PlanReply,
    Presence,
    Proposal,
)
from agents.networks.memory import Weather
from agents.networks.transport import Packet
from tests.agents.simulation import Team

STORM = Weather(loss=0.3, delay_s=(0.0, 0.4), duplicate=0.3)
JOBS = 40


def the_release(team: Team) -> PlanReleased:
    releases = team.releases()
    assert sorted(releases) == sorted(team.agents)
    assert len({release.digest for release in releases.values()}) == 1
    return releases[min(releases)]


@pytest.mark.parametrize("heads", [2, 3, 5])
def test_hosts_that_resolve_differently_agree_on_a_serial_order(heads: int) -> None:
    """They took each other's plans for lies and released nothing, for ever."""
    team = Team(heads, Weather(), quirks={heads - 1: "another processor"})
    team.run(3.0)
    release = the_release(team)
    (plan,) = release.plans.values()
    assert plan[0] == JOBS and sorted(plan[1:]) == list(range(JOBS))
    notes = [note.text for front in team.fronts.values() for note in front.of(LogNote)]
    assert any("serial order proposed" in note for note in notes)


@pytest.mark.parametrize("seed", range(6))
def test_a_stormy_network_of_unequal_hosts_agrees_too(seed: int) -> None:
    """The way out must not need luck."""
    quirks = {h: str(h % 3) for h in range(4)}
    team = Team(4, STORM, seed=seed, quirks=quirks)
    team.run(15.0)
    the_release(team)


def test_equal_hosts_never_print_serially() -> None:
    """The way out costs all that several heads bring."""
    team = Team(4, STORM)
    team.run(15.0)
    assert len(the_release(team).plans) > 1


def test_a_head_that_accepts_no_order_at_all_is_refused_by_name() -> None:
    """Nothing is left to agree on: say so instead of waiting."""
    team = Team(2, Weather(), quirks={1: "x"})
    planner = team.agents[1]._planner
    honest = planner.resolve

    def unlike(plans, live):  # type: ignore[no-untyped-def]
        found = honest(plans, live)
        return replace(found, digest=found.digest[::-1])

    planner.resolve = unlike
    team.run(4.0)
    assert team.releases() == {}
    refused = team.fronts[0].of(Refused) + team.fronts[1].of(Refused)
    assert refused and "is no order here" in refused[0].reason


def test_a_stuck_planner_loses_its_place_though_its_network_lives() -> None:
    """The token stays: zenoh's threads know nothing of the kernel that does not return."""
    team = Team(3, Weather(), limit_s=4.0, silence_s=1.0)
    team.run(1.0)
    team.stuck.add(2)
    team.run(2.0)
    assert team.agents[0].protocol.live == (0, 1)
    team.run(3.0)
    assert team.releases() == {}  # it may be moving
    assert team.fronts[0].of(Unfenced)[-1].heads == (2,)
    team.fence(2)
    team.run(1.0)
    assert the_release(team).live == (0, 1)


def test_a_planner_that_was_only_slow_takes_part_again() -> None:
    """A long round is no death."""
    team = Team(3, Weather(), limit_s=6.0, silence_s=1.0)
    team.run(1.0)
    team.stuck.add(2)
    team.run(2.0)
    team.stuck.clear()
    team.run(6.0)
    assert the_release(team).live == (0, 1, 2)


def test_a_long_round_promises_a_longer_silence() -> None:
    """A head whose rounds take seconds must not be taken for stuck in each of them."""
    team = Team(2, Weather(), limit_s=9.0, silence_s=0.5)
    agent = team.agents[1]
    iterate = agent._planner.iterate
    clock = [0.0]
    agent._clock = lambda: team.network.now + clock[0]

    def slow(live, spent):  # type: ignore[no-untyped-def]
        clock[0] += 1.0
        iterate(live, spent)

    agent._planner.iterate = slow
    team.run(0.3)
    assert agent._within() == round(4.0 / TICK_S)


def test_heads_that_only_cannot_hear_each_other_say_so() -> None:
    """With a third that hears both, neither could agree, and nobody was told why."""
    team = Team(3, Weather(), limit_s=1.0)
    team.network.lease_s = 0.3
    team.run(0.5)
    team.network.cut(0, 1)
    team.run(2.0 + STALLED_TICKS * TICK_S)
    assert team.releases() == {}
    assert team.fronts[0].of(Unfenced)[-1].heads == (1,)
    team.fence(1)
    team.run(2.0)
    assert the_release(team).live == (0, 2)


def test_a_late_token_does_not_undo_a_fence() -> None:
    """The launcher killed the head; what is still in the air is of the dead."""
    team = Team(2, Weather(), limit_s=2.0)
    team.run(0.5)
    team.fence(1)
    team.run(0.1)
    late = encode(Envelope(1, 1, 10**6, team_hello(team)))
    for _ in range(3):
        team.network.transports[0].inbox.append(Presence(1, 1, True))
        team.network.transports[0].inbox.append(Packet(1, "hello", late))
        team.run(0.2)
    team.run(3.0)
    assert the_release(team).live == (0,)


def team_hello(team: Team) -> Hello:
    return Hello(team.agents[0]._planner.problem, VERSION, "head1", True)


def test_a_restart_with_an_earlier_clock_takes_part() -> None:
    """A host without a clock of its own must be able to come back."""
    team = Team(2, Weather(delay_s=(0.0, 0.05)), limit_s=3.0)
    team.kill(1)
    team.add(1, epoch=5)
    team.run(1.0)
    team.kill(1)
    team.add(1, epoch=2)
    team.run(8.0)
    assert the_release(team).live == (0, 1)


def test_a_fence_may_be_said_twice() -> None:
    """The launcher says it again to whoever misses the head."""
    team = Team(3, Weather(), limit_s=2.0)
    team.run(0.5)
    team.fence(2)
    team.run(0.5)
    for head in team.agents:
        team.fronts[head].asked.append(HeadFenced(2, 1))
    team.run(3.0)
    assert the_release(team).live == (0, 1)


def test_replies_nobody_asked_for_cost_nothing() -> None:
    """Each once cost a resolve, the most expensive thing a message can ask for."""
    team = Team(2, Weather(), limit_s=5.0)
    team.run(0.5)
    resolved = []
    planner = team.agents[0]._planner
    plain = planner.resolve
    planner.resolve = lambda plans, live: resolved.append(1) or plain(plans, live)
    before = team.agents[0].rounds
    for i in range(200):
        proposal = Proposal((0, 1), {0: np.int32([1])}, 1.0, f"{i:032x}")
        publish(team, i, PlanReply(0, proposal))
        team.run(0.02)
    assert len(resolved) <= team.agents[0].rounds - before + 2  # what planning itself does


def test_a_flood_of_proposals_is_resolved_a_few_a_tick() -> None:
    """Whoever claims ever better plans must not keep us from everything else."""
    team = Team(2, Weather(), limit_s=0.2)
    team.run(0.1)
    resolved = []
    planner = team.agents[0]._planner
    plain = planner.resolve
    planner.resolve = lambda plans, live: resolved.append(1) or plain(plans, live)
    for i in range(300):
        publish(team, i, Proposal((0, 1), {0: np.int32([1])}, 1.0 - i / 1e3, f"{i:032x}"))
        team.network.advance(0.0)
    team.run(0.02)
    assert 0 < len(resolved) <= 4


def publish(team: Team, i: int, message: Message) -> None:
    envelope = Envelope(1, 1, 10**6 + i, message)
    team.network.publish(Packet(1, kind_of(message), encode(envelope)))


def test_the_best_joint_plan_is_told_and_taken() -> None:
    """One head's find is every head's find while there is time to build on it."""
    team = Team(3, Weather(), limit_s=6.0)
    team.run(5.5)
    best = [agent._planner.best_joint((0, 1, 2)).makespan_s for agent in team.agents.values()]
    assert max(best) == min(best)
    assert all(agent.traffic.received["joint"] > 0 for agent in team.agents.values())
    judged = [agent._planner.offered for agent in team.agents.values()]
    assert sum(judged) > 0 and max(judged) <= 12  # twice a second at most


def test_a_told_plan_that_names_unknown_work_is_dropped() -> None:
    """It comes from outside, like all messages."""
    team = Team(2, Weather(), limit_s=5.0)
    team.run(0.5)
    publish(team, 0, Joint((0, 1), {1: np.int32([-5, 10**9])}, 0.5))
    team.run(1.0)
    assert team.agents[0].traffic.dropped["joint plan of head 1 does not fit"] == 1


@pytest.mark.parametrize("heads", [1, 6, 8])
def test_any_number_of_heads_agrees(heads: int) -> None:
    """Nothing may be made for two."""
    team = Team(heads, STORM if heads > 1 else Weather(), limit_s=0.5)
    team.run(12.0)
    assert the_release(team).live == tuple(range(heads))


def until_agreeing(team: Team, head: int) -> None:
    """Run until a head began to agree."""
    while team.agents[head].protocol.phase is Phase.PLANNING:
        team.run(0.02)


@pytest.mark.parametrize("stall_s", [0.5, 1.2, 1.6])
@pytest.mark.parametrize("steps", [0, 1, 2])
@pytest.mark.parametrize("heads", [2, 3])
def test_a_head_that_stands_still_while_it_agrees_is_no_dead_end(
    heads: int, steps: int, stall_s: float
) -> None:
    """Its peer forgot what it had proposed; it saw nothing of that and never said it again."""
    team = Team(heads, Weather(delay_s=(0.02, 0.02)), seed=1, silence_s=1.0)
    until_agreeing(team, 1)
    team.run(0.02 * steps)
    assert not team.releases()
    team.stuck = {1}
    team.run(stall_s)
    team.stuck = set()
    team.run(5.0)
    the_release(team)


@pytest.mark.parametrize("seed", range(15))
def test_heads_that_stand_still_at_random_in_a_storm_agree_in_the_end(seed: int) -> None:
    """Whenever one stalls, for longer than it promised or not, whatever is lost then."""
    rng = np.random.default_rng(seed)
    team = Team(2 + seed % 3, STORM, seed=seed, silence_s=1.0)
    team.run(rng.uniform(0.5, 1.5))
    for _ in range(6):
        team.stuck = {int(rng.integers(len(team.agents)))}
        team.run(rng.uniform(0.1, 1.8))
        team.stuck = set()
        team.run(rng.uniform(0.0, 0.6))
    team.run(12.0)
    the_release(team)


def test_a_release_that_died_with_its_only_holder_is_not_waited_for() -> None:
    """A head that began anew heard of the plan but never got it, and waited for it for ever."""
    team = Team(2, Weather(delay_s=(0.02, 0.02)), seed=3)
    while not team.agents[0].released:
        team.run(0.02)
    team.kill(1)
    team.add(1, epoch=2)
    until_agreeing(team, 1)
    team.fence(0)
    team.run(5.0)
    assert team.releases()[1].live == (1,)


@pytest.mark.parametrize("pause_s", [0.5, 1.5, 3.0, 5.0])
@pytest.mark.parametrize("since_s", [0.5, 2.0])
def test_heads_that_pause_greet_again_and_agree(since_s: float, pause_s: float) -> None:
    """Each heard only itself for a moment, and neither could print all: both were given up.

    It goes on while the other plans, or after that one's time is over.
    """
    team = Team(2, Weather(), limit_s=3.0, needed=0)
    team.run(since_s)
    team.network.hang(0)
    team.run(pause_s)
    team.network.resume(0)
    team.run(9.0 - since_s - pause_s)
    assert the_release(team).live == (0, 1)
