"""Who is there and who is off: incarnations, fences and silence."""

from __future__ import annotations

from itertools import count

import pytest

from agents.agreeing.events import Effect, LogNote, Refused, Send
from agents.agreeing.roster import Roster
from agents.messages.kinds import SILENCE_TICKS, VERSION, Commit, Hello

PROBLEM = "ab" * 16
NUMBERS = count(1)  # of messages


@pytest.fixture
def roster() -> Roster:
    return Roster(0, ("left", "middle", "right"), PROBLEM, ())


def greets(roster: Roster, head: int, epoch: int) -> list[Effect]:
    roster.appeared(head, epoch)
    return roster.receive_hello(
        head, (epoch, next(NUMBERS)), Hello(PROBLEM, VERSION, f"h{head}", False)
    )


def test_nothing_late_of_a_fenced_incarnation_brings_it_back(roster: Roster) -> None:
    """Its token and its hello may still be on their way when the launcher has killed it."""
    greets(roster, 1, 7)
    roster.fence(1, 7)
    assert greets(roster, 1, 7) == []
    assert roster.live == (0,) and roster.fenced == {1}


def test_another_incarnation_is_not_fenced(roster: Roster) -> None:
    """Who speaks moves: to release without it would be a crash."""
    greets(roster, 1, 7)
    roster.fence(1, 7)
    greets(roster, 1, 8)
    assert roster.live == (0, 1) and roster.fenced == set()
    roster.fence(1, 7)  # said again
    assert roster.live == (0, 1) and roster.fenced == set()


def test_a_fence_of_the_old_incarnation_waits_for_the_hello_of_the_new(roster: Roster) -> None:
    """A token alone says that something runs there."""
    roster.appeared(1, 8)
    roster.fence(1, 7)
    assert roster.missing((0, 2)) == (1,)


@pytest.mark.parametrize("epoch", [3, 9])
def test_a_restart_is_greeted_whatever_its_clock_says(roster: Roster, epoch: int) -> None:
    """A computer without a battery begins in 1970: its epoch is smaller than before."""
    greets(roster, 1, 7)
    roster.appeared(1, epoch)
    assert roster.gone(1, 7) or epoch > 7
    greets(roster, 1, epoch)
    assert roster.greeted == {1: epoch}
    assert roster.may_receive(1, (epoch, 1), Commit)
    assert not roster.may_receive(1, (7, 99), Commit)


def test_an_earlier_restart_counts_its_messages_anew(roster: Roster) -> None:
    """Its first word must not count as older than the last of the old incarnation."""
    greets(roster, 1, 7)
    assert roster.may_receive(1, (7, 500), Commit)
    roster.gone(1, 7)
    greets(roster, 1, 3)
    assert roster.may_receive(1, (3, 1), Commit)
    assert not roster.may_receive(1, (3, 1), Commit)


def test_of_two_tokens_of_a_head_the_larger_counts_in_any_order(roster: Roster) -> None:
    """All agents must look at the same incarnation."""
    for first, second in ((7, 8), (8, 7)):
        roster = Roster(0, ("left", "middle", "right"), PROBLEM, ())
        roster.appeared(1, first)
        roster.appeared(1, second)
        assert roster.present(1) == 8
        roster.gone(1, 8)
        assert roster.present(1) == 7


def test_who_is_silent_longer_than_promised_is_dropped_until_it_speaks(roster: Roster) -> None:
    """A planner stuck in a kernel keeps its token alive: zenoh's threads go on."""
    greets(roster, 1, 7)
    roster.promise(1, 5)
    assert not any(roster.tick() for _ in range(5))
    assert roster.live == (0, 1)
    effects = roster.tick()
    assert LogNote("middle is silent") in effects and roster.live == (0,)
    assert roster.missing(roster.live) == (1, 2)  # not fenced: it may be moving
    assert any(isinstance(e, Send) for e in roster.tick())  # asked to say hello
    roster.receive_hello(1, (7, next(NUMBERS)), Hello(PROBLEM, VERSION, "h1", False))
    assert roster.live == (0, 1)


def test_any_word_is_a_sign_of_life(roster: Roster) -> None:
    """Nobody who talks is stuck."""
    greets(roster, 1, 7)
    for seq in range(3):
        for _ in range(SILENCE_TICKS):
            roster.tick()
        assert roster.may_receive(1, (7, seq), Commit)
    assert roster.live == (0, 1)


def test_what_is_refused_is_said_once_for_each_incarnation(roster: Roster) -> None:
    """A restart with the right print must get in, and one with another wrong one be named."""
    wrong = Hello("cd" * 16, VERSION, "h1", False)
    roster.appeared(1, 7)
    assert len(roster.receive_hello(1, (7, 1), wrong)) == 1
    assert roster.receive_hello(1, (7, 2), wrong) == []
    roster.appeared(1, 8)
    assert [type(e) for e in roster.receive_hello(1, (8, 1), wrong)] == [Refused]
    roster.gone(1, 8)
    roster.gone(1, 7)
    greets(roster, 1, 9)
    assert roster.live == (0, 1)


def test_a_hello_that_somebody_says_again_keeps_no_dead_head_here(roster: Roster) -> None:
    """It has the right seal: whoever listens in can say it again, but not with a new number."""
    hello = Hello(PROBLEM, VERSION, "h1", False)
    roster.appeared(1, 7)
    roster.receive_hello(1, (7, 1), hello)
    for _ in range(SILENCE_TICKS + 1):
        roster.receive_hello(1, (7, 1), hello)
        roster.tick()
    assert roster.live == (0,)
    roster.receive_hello(1, (7, 1), hello)
    assert roster.live == (0,)
    roster.receive_hello(1, (7, 2), hello)
    assert roster.live == (0, 1)
