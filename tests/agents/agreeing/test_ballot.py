"""Who wins and who stands where: the book-keeping of an agreement."""

from __future__ import annotations

import tracemalloc

import numpy as np

from agents.agreeing.ballot import VERIFIED, Ballot
from agents.messages.kinds import Commit, Proposal, Stage

A, B, C = "aa" * 8, "bb" * 8, "cc" * 8
LIVE = (0, 1)


def proposal(digest: str, makespan_s: float, live: tuple[int, ...] = LIVE) -> Proposal:
    return Proposal(live, {0: np.int32([1])}, makespan_s, digest)


def test_there_is_no_winner_before_every_live_head_proposed() -> None:
    """A winner among some would not be the winner among all."""
    ballot = Ballot()
    ballot.propose(0, proposal(A, 5.0), verified=True)
    assert ballot.best(LIVE) is None
    ballot.propose(1, proposal(B, 4.0, live=(1,)))
    assert ballot.best(LIVE) is None


def test_the_winner_has_the_smallest_makespan_then_digest() -> None:
    """Each head computes it alone, so it must be one rule without a tie."""
    ballot = Ballot()
    ballot.propose(0, proposal(B, 5.0), verified=True)
    ballot.propose(1, proposal(A, 5.0))
    won = ballot.best(LIVE)
    assert won is not None and won.digest == A
    ballot.propose(1, proposal(C, 4.0))
    won = ballot.best(LIVE)
    assert won is not None and won.digest == C


def test_a_plan_once_resolved_stays_a_candidate() -> None:
    """Choices for one live set only ever get better, so they settle."""
    ballot = Ballot()
    ballot.propose(0, proposal(B, 5.0), verified=True)
    ballot.propose(1, proposal(C, 9.0))
    assert ballot.begin_resolving(proposal(A, 4.0)) is not None
    assert ballot.begin_resolving(proposal(A, 4.0)) is None
    assert ballot.end_resolving((LIVE, A), A, 4.0)
    won = ballot.best(LIVE)
    assert won is not None and won.digest == A


def test_a_makespan_that_is_not_what_resolving_gives_is_a_lie() -> None:
    """It would win by a claim."""
    ballot = Ballot()
    ballot.propose(0, proposal(B, 5.0), verified=True)
    ballot.propose(1, proposal(A, 1.0))
    ballot.begin_resolving(proposal(A, 1.0))
    assert not ballot.end_resolving((LIVE, A), A, 6.0)
    won = ballot.best(LIVE)
    assert won is not None and won.digest == B


def test_an_agreement_counts_only_for_the_term_it_heard() -> None:
    """The rule that keeps two heads from releasing two plans."""
    ballot = Ballot()
    own = Commit(LIVE, A, Stage.AGREED, 8, (0, 3))
    for heard, counts in ((7, False), (8, True)):
        ballot.commits[1] = Commit(LIVE, A, Stage.AGREED, 3, (heard, 0))
        assert ballot.has_agreed(1, own, 0) is counts
    ballot.commits[1] = Commit(LIVE, A, Stage.COMMITTED, 3, (8, 0))
    assert not ballot.has_agreed(1, own, 0)
    assert ballot.heard((LIVE, A)) == (0, 3)
    assert ballot.heard((LIVE, B)) == (0, 0)


def test_a_commit_stands_in_for_a_proposal_that_is_missing() -> None:
    """A head that started over forgot the others' proposals; they do not propose again."""
    ballot = Ballot()
    ballot.propose(0, proposal(B, 5.0), verified=True)
    ballot.commits[1] = Commit(LIVE, A, Stage.COMMITTED, 3, (0, 0))
    assert ballot.best(LIVE) is None  # nobody has shown us plan A
    assert ballot.begin_resolving(proposal(A, 4.0)) is not None
    assert ballot.end_resolving((LIVE, A), A, 4.0)
    won = ballot.best(LIVE)
    assert won is not None and won.digest == A
    ballot.commits[1] = Commit((1,), A, Stage.COMMITTED, 3, (0,))
    assert ballot.best(LIVE) is None


def test_of_rejected_plans_their_digests_are_kept() -> None:
    """256 whole plans of a large print are gigabytes, and a peer may make them up."""
    ballot = Ballot()
    tracemalloc.start()
    try:
        for number in range(300):
            plans = {1: np.zeros(25_000, np.int32)}
            ballot.begin_resolving(Proposal((0, 1), plans, 1.0, f"{number:032x}"))
            assert not ballot.end_resolving(((0, 1), f"{number:032x}"), "", 0.0)
        left, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert left < 400_000


def test_plans_that_nobody_stands_by_any_more_are_forgotten() -> None:
    """Whatever is right is kept whole, for those who ask for it; but not for ever."""
    ballot, ours = Ballot(), ((0, 1), f"{0:032x}")
    ballot.ours = ours
    for number in range(3 * VERIFIED):
        ballot.propose(0, Proposal((0, 1), {}, 1.0, f"{number:032x}"), verified=True)
    assert len(ballot.verified) <= VERIFIED + 1
    assert ours in ballot.verified and ((0, 1), f"{3 * VERIFIED - 1:032x}") in ballot.verified
