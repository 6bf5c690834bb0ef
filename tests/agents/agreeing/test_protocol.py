"""The state machine by hand: each rule of its theory of operation."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import agents.agreeing.protocol
from agents.agreeing.events import (
    Effect,
    Forget,
    HeadFenced,
    Leave,
    Left,
    LiveChanged,
    Phase,
    PlanningEnded,
    PlanReleased,
    PlanResolved,
    Propose,
    ProtocolEvent,
    Refused,
    Resolve,
    RosterComplete,
    Send,
    Take,
    Tick,
    Unfenced,
)
from agents.agreeing.protocol import Protocol
from agents.messages.kinds import (
    VERSION,
    Commit,
    Distribution,
    Envelope,
    Goodbye,
    Hello,
    Message,
    PlanReply,
    PlanRequest,
    Presence,
    Proposal,
    Stage,
)

PROBLEM, OTHER = "ab" * 16, "cd" * 16
GOOD, BAD = "11" * 16, "22" * 16
BOTH = (0, 1)
PLANS = {0: np.int32([0]), 1: np.int32([1])}


class Peer:
    """Speaks as head 1 to the protocol of head 0."""

    def __init__(self, protocol: Protocol, *, head: int = 1, epoch: int = 1) -> None:
        self.protocol, self.head, self.epoch, self.seq = protocol, head, epoch, 0

    def says(self, message: Message, *, seq: int | None = None) -> list[Effect]:
        self.seq += 1
        number = self.seq if seq is None else seq
        envelope = Envelope(self.head, self.epoch, number, message)
        return self.protocol.handle(envelope)

    def joins(self) -> list[Effect]:
        effects = self.protocol.handle(Presence(self.head, self.epoch, True))
        return effects + self.says(Hello(PROBLEM, VERSION, f"h{self.head}", False))

    def commits(self, digest: str, stage: Stage, *, heard: int = 0, live=BOTH) -> list[Effect]:
        return self.says(Commit(live, digest, stage, 99, (heard, 0)))


@pytest.fixture
def protocol() -> Protocol:
    made = Protocol(0, 1, ("h0", "h1"), PROBLEM)
    made.start()
    return made


@pytest.fixture
def peer(protocol: Protocol) -> Peer:
    made = Peer(protocol)
    made.joins()
    return made


def sent(effects: list[Effect], kind: type) -> list:
    return [e.message for e in effects if isinstance(e, Send) and isinstance(e.message, kind)]


def some(effects: list[Effect], kind: type) -> list:
    return [e for e in effects if isinstance(e, kind)]


def propose(protocol: Protocol, digest: str = GOOD, makespan_s: float = 5.0) -> list[Effect]:
    protocol.handle(PlanningEnded())
    return protocol.handle(Proposal(BOTH, PLANS, makespan_s, digest))


def theirs(digest: str = GOOD, makespan_s: float = 5.0, live=BOTH) -> Proposal:
    return Proposal(live, PLANS, makespan_s, digest)


def own_term(effects: list[Effect]) -> int:
    return sent(effects, Commit)[-1].term


def test_it_imports_no_socket_thread_or_clock() -> None:
    """Sans-I/O is what makes it testable to the last branch."""
    folder = Path(agents.agreeing.protocol.__file__).parent
    allowed = {"__future__", "agents", "collections", "dataclasses", "enum"}
    for name in ("protocol", "roster", "agreement", "ballot"):
        tree = ast.parse((folder / f"{name}.py").read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                assert node.module is not None and node.module.split(".")[0] in allowed
            assert not isinstance(node, ast.Import)


def test_the_clock_starts_when_every_head_is_there(protocol: Protocol) -> None:
    """A head that loads slowly must not find the planning over."""
    effects = Peer(protocol).joins()
    assert some(effects, LiveChanged)[-1].live == BOTH
    assert len(some(effects, RosterComplete)) == 1


def test_a_hello_before_its_token_is_asked_for_again(protocol: Protocol) -> None:
    """Tokens and messages travel apart: either may come first."""
    peer = Peer(protocol)
    peer.says(Hello(PROBLEM, VERSION, "h1", False))
    assert protocol.live == (0,)
    protocol.handle(Presence(1, 1, True))
    (asked,) = sent(protocol.handle(Tick()), Hello)
    assert asked.wants_answer
    peer.says(Hello(PROBLEM, VERSION, "h1", False))
    assert protocol.live == BOTH
    assert not sent(protocol.handle(Tick()), Hello)


@pytest.mark.parametrize(
    ("hello", "reason"),
    [
        (
            Hello(OTHER, VERSION, "right", True),
            "right holds problem cdcdcdcdcdcd, we hold abababababab",
        ),
        (Hello(PROBLEM, 1, "right", True), "right speaks version 1 of the protocol, we 4"),
    ],
)
def test_a_stranger_is_refused_by_name_once_and_not_heard(
    protocol: Protocol, hello: Hello, reason: str
) -> None:
    """Plans for another print must not get in."""
    protocol.handle(Presence(1, 1, True))
    peer = Peer(protocol)
    assert some(peer.says(hello), Refused) == [Refused(1, reason)]
    assert some(peer.says(hello), Refused) == []
    assert peer.says(theirs()) == []
    assert protocol.live == (0,) and protocol.phase is Phase.PLANNING


def test_distributions_are_latest_wins(protocol: Protocol, peer: Peer) -> None:
    """An old one that arrives late would undo what is known."""
    told = Distribution((np.int32([1]),), np.float64([1.0]))
    assert some(peer.says(told, seq=50), Take)
    assert not some(peer.says(told, seq=49), Take)
    assert not some(peer.says(told, seq=50), Take)
    assert some(peer.says(told, seq=51), Take)


def test_a_new_incarnation_starts_counting_anew(protocol: Protocol, peer: Peer) -> None:
    """A restarted head counts from 1 and must be heard, its old self no more."""
    told = Distribution((np.int32([1]),), np.float64([1.0]))
    peer.says(told, seq=50)
    reborn = Peer(protocol, epoch=2)
    assert Forget(1) in reborn.joins()
    assert some(reborn.says(told, seq=1), Take)
    assert not some(peer.says(told, seq=99), Take)
    protocol.handle(Presence(1, 1, False))  # the old token's end, seen late
    assert protocol.live == BOTH


def test_a_peer_s_proposal_ends_our_planning(protocol: Protocol, peer: Peer) -> None:
    """Clocks differ; nobody waits for the slowest clock."""
    assert some(peer.says(theirs()), Propose) == [Propose(BOTH)]
    assert protocol.phase is Phase.AGREEING


def test_the_road_to_a_release(protocol: Protocol, peer: Peer) -> None:
    """Propose, commit, agree, release: in that order and no earlier."""
    assert sent(propose(protocol), Commit) == []
    (commit,) = sent(peer.says(theirs()), Commit)
    assert commit.stage is Stage.COMMITTED
    effects = peer.commits(GOOD, Stage.COMMITTED)
    assert [c.stage for c in sent(effects, Commit)] == [Stage.AGREED]
    assert sent(effects, Commit)[0].heard == (0, 99)
    effects = peer.commits(GOOD, Stage.AGREED, heard=commit.term)
    assert [c.stage for c in sent(effects, Commit)] == [Stage.RELEASED]
    assert some(effects, PlanReleased)[0].digest == GOOD
    assert not protocol.settled
    peer.commits(GOOD, Stage.RELEASED, heard=commit.term)
    assert protocol.settled


def test_an_agreement_to_an_earlier_term_does_not_release(protocol: Protocol, peer: Peer) -> None:
    """Its sender may since have agreed to something else; see Safety."""
    propose(protocol)
    term = own_term(peer.says(theirs()))
    peer.commits(GOOD, Stage.AGREED, heard=term - 1)
    assert protocol.phase is Phase.AGREEING


def test_the_winner_is_the_smallest_makespan(protocol: Protocol, peer: Peer) -> None:
    """Every head picks the same without a further message."""
    propose(protocol, GOOD, 5.0)
    effects = peer.says(theirs(BAD, 4.0))
    assert [r.claimed for r in some(effects, Resolve)] == [BAD]
    effects = protocol.handle(PlanResolved(BOTH, BAD, BAD, 4.0))
    assert [c.digest for c in sent(effects, Commit)] == [BAD]


def test_equal_makespans_are_decided_by_digest(protocol: Protocol, peer: Peer) -> None:
    """A tie must not make two winners."""
    propose(protocol, BAD, 5.0)
    effects = peer.says(theirs(GOOD, 5.0))
    assert [r.claimed for r in some(effects, Resolve)] == [GOOD]


def test_a_plan_that_resolves_otherwise_here_is_not_taken(protocol: Protocol, peer: Peer) -> None:
    """A lie, or a fault: either way it is not the plan we hold."""
    propose(protocol, GOOD, 5.0)
    peer.says(theirs(BAD, 1.0))
    effects = protocol.handle(PlanResolved(BOTH, BAD, OTHER, 4.0))
    assert [c.digest for c in sent(effects, Commit)] == [GOOD]


def test_nothing_is_released_on_different_digests(protocol: Protocol, peer: Peer) -> None:
    """Commit only when every live agent reports the same digest."""
    propose(protocol)
    peer.says(theirs())
    peer.commits(BAD, Stage.AGREED, heard=1)
    assert protocol.phase is Phase.AGREEING


def test_a_missing_plan_is_fetched_and_resolved(protocol: Protocol, peer: Peer) -> None:
    """A peer may know a better plan than we were told of."""
    propose(protocol)
    peer.says(theirs())
    peer.commits(BAD, Stage.COMMITTED)
    (request,) = sent(protocol.handle(Tick()), PlanRequest)
    assert (request.target, request.digest) == (1, BAD)
    effects = peer.says(PlanReply(0, theirs(BAD, 4.0)))
    assert [r.claimed for r in some(effects, Resolve)] == [BAD]
    effects = protocol.handle(PlanResolved(BOTH, BAD, BAD, 4.0))
    assert sent(effects, Commit)[-1].digest == BAD
    assert sent(effects, Commit)[-1].stage is Stage.AGREED


def test_a_request_is_answered_with_the_plan(protocol: Protocol, peer: Peer) -> None:
    """The other side of fetching."""
    propose(protocol)
    (reply,) = sent(peer.says(PlanRequest(0, BOTH, GOOD)), PlanReply)
    assert reply.proposal.digest == GOOD
    assert not sent(peer.says(PlanRequest(1, BOTH, GOOD)), PlanReply)
    assert not sent(peer.says(PlanRequest(0, BOTH, BAD)), PlanReply)


def test_a_death_while_agreeing_starts_over_with_the_rest(protocol: Protocol, peer: Peer) -> None:
    """The dead head's work is re-assigned, the old commit counts no more."""
    propose(protocol)
    peer.says(theirs())
    effects = protocol.handle(Presence(1, 1, False))
    assert Forget(1) in effects and Propose((0,)) in effects
    effects = protocol.handle(Proposal((0,), PLANS, 9.0, BAD))
    assert some(effects, Unfenced) == [Unfenced((1,))]
    assert not some(effects, PlanReleased)
    effects = protocol.handle(HeadFenced(1, 1))
    assert [r.live for r in some(effects, PlanReleased)] == [(0,)]


def test_an_answer_for_a_live_set_of_the_past_is_ignored(protocol: Protocol, peer: Peer) -> None:
    """The planner answers late; the team may have changed meanwhile."""
    protocol.handle(PlanningEnded())
    protocol.handle(Presence(1, 1, False))
    assert protocol.handle(Proposal(BOTH, PLANS, 5.0, GOOD)) == []


def test_a_release_of_others_is_followed(protocol: Protocol, peer: Peer) -> None:
    """They agreed with us once; the last word reached us late."""
    propose(protocol, BAD, 9.0)
    peer.says(theirs(GOOD, 5.0))
    peer.commits(GOOD, Stage.RELEASED)
    effects = protocol.handle(PlanResolved(BOTH, GOOD, GOOD, 5.0))
    assert some(effects, PlanReleased)[0].digest == GOOD


def test_a_release_of_an_unknown_plan_is_fetched_first(protocol: Protocol, peer: Peer) -> None:
    """To follow a plan one must hold it."""
    effects = peer.commits(GOOD, Stage.RELEASED)
    assert sent(effects, PlanRequest) == [PlanRequest(1, BOTH, GOOD)]
    peer.says(PlanReply(0, theirs()))
    effects = protocol.handle(PlanResolved(BOTH, GOOD, GOOD, 5.0))
    assert some(effects, PlanReleased)[0].digest == GOOD


def test_a_head_the_others_released_without_leaves_parked(protocol: Protocol, peer: Peer) -> None:
    """It was fenced: there is no work for it, and it must not make any."""
    effects = peer.says(Commit((1,), GOOD, Stage.RELEASED, 5, (0,)))
    assert some(effects, Left)
    assert sent(effects, Goodbye)[0].digest == ""
    assert protocol.handle(PlanningEnded()) == []


def test_a_goodbye_without_a_release_is_a_fence(protocol: Protocol, peer: Peer) -> None:
    """Who leaves by its own word stays parked; nobody has to pull its plug."""
    propose(protocol)
    peer.says(Goodbye("", "terminated"))
    effects = protocol.handle(Proposal((0,), PLANS, 9.0, GOOD))
    assert [r.live for r in some(effects, PlanReleased)] == [(0,)]


def test_what_may_be_lost_is_said_again_until_answered(protocol: Protocol, peer: Peer) -> None:
    """Loss costs time, not agreement."""
    propose(protocol)
    assert len(sent(protocol.handle(Tick()), Proposal)) == 1
    term = own_term(peer.says(theirs()))
    assert len(sent(protocol.handle(Tick()), Commit)) == 1
    peer.commits(GOOD, Stage.AGREED, heard=term)
    assert sent(protocol.handle(Tick()), Commit)[0].stage is Stage.RELEASED
    peer.commits(GOOD, Stage.RELEASED, heard=term)
    assert protocol.handle(Tick()) == []


@pytest.mark.parametrize(("numbers", "most"), [(1, 60), (40_000, 3), (100_000, 2)])
def test_long_plans_are_said_again_now_and_then_only(
    protocol: Protocol, peer: Peer, numbers: int, most: int
) -> None:
    """Eight busy agents sent each other 263 MB while they waited for the slowest."""
    plans = {0: np.zeros(numbers, np.int32), 1: np.int32([1])}
    protocol.handle(PlanningEnded())
    protocol.handle(Proposal(BOTH, plans, 5.0, GOOD))
    peer.says(theirs(BAD, 9.0))
    proposals = replies = 0
    for _ in range(60):
        effects = protocol.handle(Tick())
        proposals += len(sent(effects, Proposal))
        for _ in range(3):  # a peer whose request is answered late asks again
            replies += len(sent(peer.says(PlanRequest(0, BOTH, GOOD)), PlanReply))
    assert proposals == most  # fewer were never said again, more cost others their time
    assert most <= replies <= most + 1


@pytest.mark.parametrize(
    "event", [PlanningEnded(), Tick(), Leave("x"), HeadFenced(1, 1), HeadFenced(7, 1)]
)
def test_nothing_follows_after_leaving(protocol: Protocol, event: ProtocolEvent) -> None:
    """A head that left must not act."""
    protocol.handle(Leave("done"))
    assert protocol.handle(event) == []
