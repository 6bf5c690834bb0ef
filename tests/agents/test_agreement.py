"""Teams of agents on a hostile memory network: they agree, or release nothing."""

from __future__ import annotations

import numpy as np
import pytest

from agents.agreeing.events import LogNote, Refused, Unfenced
from agents.loop.agent import Agent
from agents.messages.codec import encode, kind_of
from agents.messages.kinds import Distribution, Envelope, Goodbye, Proposal
from agents.networks.memory import Weather
from agents.networks.transport import NoNetwork, Packet
from decmcts.experiments.in_memory import Recorder
from tests.agents.simulation import Team
from tests.agents.toy import ToyPlanner, load_balance

STORM = Weather(loss=0.3, delay_s=(0.0, 0.4), duplicate=0.3)


def one_digest(team: Team) -> str:
    digests = {release.digest for release in team.releases().values()}
    assert len(digests) == 1
    return digests.pop()


@pytest.mark.parametrize("seed", range(10))
def test_a_stormy_network_still_agrees(seed: int) -> None:
    """Loss, delay, reordering and repetition cost time, never agreement."""
    team = Team(2 + seed % 3, STORM, seed=seed)
    team.run(12.0)
    assert len(team.releases()) == len(team.agents)
    one_digest(team)


def test_every_job_of_the_released_plan_is_done_once() -> None:
    """Agreement on nonsense would be worthless."""
    team = Team(3, STORM)
    team.run(12.0)
    release = team.releases()[0]
    jobs = np.sort(np.concatenate(list(release.plans.values())))
    assert jobs.tolist() == list(range(40))
    lengths = np.random.default_rng(40).uniform(1.0, 9.0, 40)
    assert load_balance(lengths, release.plans, release.live)[1] == release.makespan_s


@pytest.mark.parametrize("seed", range(10))
def test_a_death_at_any_moment_leaves_the_others_with_one_plan(seed: int) -> None:
    """kill -9 before, while and after agreeing: its work is taken over or its plan kept."""
    team = Team(3, STORM, seed=seed)
    team.run(0.2 + 0.15 * seed)
    team.fence(2)
    team.run(12.0)
    assert sorted(team.releases()) == [0, 1]
    one_digest(team)


def test_nothing_is_released_while_a_silent_head_is_not_fenced() -> None:
    """An unreachable head is not a dead head: it may be moving."""
    team = Team(3, Weather(delay_s=(0.0, 0.05)))
    team.run(0.5)
    team.network.hang(1)
    team.run(6.0)
    assert team.releases() == {}
    assert team.fronts[0].of(Unfenced)[-1].heads == (1,)
    team.fence(1)
    team.run(2.0)
    assert sorted(team.releases()) == [0, 2]
    assert team.releases()[0].live == (0, 2)
    one_digest(team)


def test_a_hung_head_that_resumes_rejoins_and_all_three_agree() -> None:
    """A resumed head gets its share of the work back."""
    team = Team(3, Weather(delay_s=(0.0, 0.05)))
    team.run(0.5)
    team.network.hang(1)
    team.run(4.0)
    team.network.resume(1)
    team.run(5.0)
    assert sorted(team.releases()) == [0, 1, 2]
    assert team.releases()[0].live == (0, 1, 2)
    one_digest(team)


def test_a_cut_between_two_heads_releases_nothing_until_it_heals() -> None:
    """Views that differ must not lead to two plans."""
    team = Team(3, Weather(delay_s=(0.0, 0.05)))
    team.run(0.5)
    team.network.cut(0, 1)
    team.run(6.0)
    assert team.releases() == {}
    team.network.heal(0, 1)
    team.run(6.0)
    assert sorted(team.releases()) == [0, 1, 2]
    one_digest(team)


def test_a_head_with_another_problem_is_refused_by_name() -> None:
    """Plans for different prints must never be merged."""
    team = Team(2, Weather())
    team.kill(1)
    team.add(1, epoch=2, jobs=41)
    team.run(5.0)
    refused = team.fronts[0].of(Refused)
    assert [r.head for r in refused] == [1]
    assert "head1 holds problem" in refused[0].reason
    assert team.releases() == {}


def test_without_a_head_that_is_needed_the_others_wait_and_say_why() -> None:
    """A material only one head has: no plan without it, and no crash either."""
    team = Team(2, Weather(), limit_s=3.0, needed=1)
    team.run(0.5)
    team.fence(1)
    team.run(5.0)
    assert team.releases() == {}
    assert LogNote("only head1 can do job 0") in team.fronts[0].notices
    team.add(1, epoch=2)
    team.run(5.0)
    assert sorted(team.releases()) == [0, 1]
    one_digest(team)


def test_a_head_restarted_in_the_middle_takes_part_again() -> None:
    """A new incarnation is greeted even when its old one's end is seen late."""
    team = Team(2, Weather(delay_s=(0.0, 0.05)), limit_s=3.0)
    team.run(1.0)
    team.kill(1)
    team.add(1, epoch=2)
    team.run(8.0)
    assert sorted(team.releases()) == [0, 1]
    one_digest(team)


def test_one_agent_alone_releases_without_a_network() -> None:
    """The single-extruder mode is the same code with nobody to talk to."""
    clock = iter(np.arange(0.0, 100.0, 0.01).tolist())
    front = Recorder()
    agent = Agent(
        0,
        1,
        planner=ToyPlanner(0, names=("left", "right")),
        transport=NoNetwork(),
        front=front,
        time_limit_s=1.0,
        clock=lambda: next(clock),
        fenced=(1,),
    )
    while agent.released is None:
        agent.step()
    assert agent.released.live == (0,)
    assert sorted(agent.released.plans[0].tolist()) == list(range(40))
    assert not agent.traffic.sent


def test_hostile_bytes_are_dropped_counted_and_survived() -> None:
    """Garbage, huge and forged messages in the middle of planning and agreeing."""
    team = Team(2, Weather())
    rng = np.random.default_rng(7)
    goodbye = encode(Envelope(1, 1, 10**9, Goodbye("", "forged")))
    for _ in range(60):
        team.run(0.1)
        for kind in ("distribution", "proposal", "commit"):
            team.network.publish(Packet(1, kind, rng.bytes(int(rng.integers(0, 500)))))
        team.network.publish(Packet(1, "commit", goodbye))  # kind of another key
        team.network.publish(Packet(0, "goodbye", goodbye))  # head of another key
    team.run(0.1)
    assert sorted(team.releases()) == [0, 1]
    assert team.releases()[0].live == (0, 1)
    assert team.agents[0].traffic.dropped == {"malformed message of head 1": 60 * 4}
    assert len(team.fronts[0].of(LogNote)) < 5


def test_plans_that_name_unknown_work_are_dropped_not_fatal() -> None:
    """Well-formed nonsense reaches the planner, which must refuse it."""
    team = Team(2, Weather())
    team.run(0.2)
    wild = np.int32([-5, 10**9])
    notices = Distribution((wild,), np.float64([1.0]))
    forged = [
        Envelope(1, 1, 10**6, notices),
        Envelope(1, 1, 10**6 + 1, Proposal((0, 1), {1: wild}, 0.5, "ab" * 16)),
    ]
    for envelope in forged:
        packet = Packet(1, kind_of(envelope.message), encode(envelope))
        team.network.publish(packet)
    team.run(2.0)
    dropped = team.agents[0].traffic.dropped
    assert dropped == {"distribution of head 1 does not fit": 1, "plan does not fit": 1}
    one_digest(team)


@pytest.mark.parametrize("seed", range(3))
def test_equal_seeds_and_equal_messages_give_equal_plans(seed: int) -> None:
    """A plan can be computed again, bit for bit."""
    first, second = Team(3, STORM, seed=seed), Team(3, STORM, seed=seed)
    for team in (first, second):
        team.run(12.0)
    assert one_digest(first) == one_digest(second)
    assert [a.rounds for a in first.agents.values()] == [a.rounds for a in second.agents.values()]
