"""What every head proposed and committed to, and what follows from it.

A part of the agreement's state machine (`agents.agreeing.protocol` states the rules);
pure book-keeping: no messages are sent from here.
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.messages.kinds import Commit, Plans, Proposal, Stage

PlanKey = tuple[tuple[int, ...], str]  # live set and digest: names a plan

REMEMBERED = 256
"""Plans of which is known that they resolve to something else: their digests only, for a
peer may make them up."""

VERIFIED = 64  # plans kept whole that were resolved here, besides those that somebody stands by


def key_of(stated: Proposal | Commit) -> PlanKey:
    """Return the plan a message speaks of."""
    return stated.live, stated.digest


class Ballot:
    """The latest word of every head, ours included."""

    def __init__(self) -> None:
        self.commits: dict[int, Commit] = {}
        self.verified: dict[PlanKey, Proposal] = {}  # resolved here, with the digest they claim
        self.proposals: dict[int, Proposal] = {}
        self.pending: dict[PlanKey, Proposal] = {}  # being resolved
        self._rejected: dict[PlanKey, bool] = {}  # whether it was a serial order
        self.ours: PlanKey | None = None  # what we stand by

    def propose(self, head: int, proposal: Proposal, *, verified: bool = False) -> None:
        """Note a head's proposal; our own is verified."""
        self.proposals[head] = proposal
        if verified:
            self._keep(proposal)

    def drop(self, head: int) -> None:
        """Forget a head's words."""
        self.proposals.pop(head, None)
        self.commits.pop(head, None)

    def best(self, live: tuple[int, ...]) -> Proposal | None:
        """Return the winner, or None while a live head neither proposed nor committed.

        Smallest makespan, ties by digest: every head that knows the same
        proposals picks the same. Once one head proposes a serial order, only
        serial orders count.
        """
        words = (self._word(head, live) for head in live)
        stated = [proposal for proposal in words if proposal is not None]
        if len(stated) < len(live):
            return None
        fetched = [p for (of, _), p in self.verified.items() if of == live]
        taken = [p for p in stated + fetched if key_of(p) not in self._rejected]
        if any(p.serial for p in stated):
            taken = [p for p in taken if p.serial]
        return min(taken, key=lambda p: (p.makespan_s, p.digest), default=None)

    def _word(self, head: int, live: tuple[int, ...]) -> Proposal | None:
        """Return what a head proposes for a live set, or else what it stands by."""
        proposal, commit = self.proposals.get(head), self.commits.get(head)
        if proposal is not None and proposal.live == live:
            return proposal
        if commit is not None and commit.live == live:
            return self.find(key_of(commit))
        return None

    def find(self, key: PlanKey) -> Proposal | None:
        """Return the proposal behind a plan, if some head stated it."""
        stated = (p for p in self.proposals.values() if key_of(p) == key)
        return self.verified.get(key) or next(stated, None)

    def begin_resolving(self, proposal: Proposal) -> Plans | None:
        """Return the plans to resolve, None if that is done or under way."""
        key = key_of(proposal)
        if key in self.verified or key in self.pending or key in self._rejected:
            return None
        self.pending[key] = proposal
        return proposal.plans

    def end_resolving(self, key: PlanKey, digest: str, makespan_s: float) -> bool:
        """Note what a plan resolved to; return whether it is what was claimed."""
        proposal = self.pending.pop(key, None)
        if proposal is None:
            return True
        # Of an explicit order the makespan is an estimate of each host's own.
        if digest == proposal.digest and (proposal.serial or makespan_s == proposal.makespan_s):
            self._keep(proposal)
            return True
        if len(self._rejected) >= REMEMBERED:
            del self._rejected[next(iter(self._rejected))]
        self._rejected[key] = proposal.serial
        return False

    def _keep(self, proposal: Proposal) -> None:
        """Keep a plan that was resolved here, and drop the oldest that nobody stands by."""
        self.verified[key_of(proposal)] = proposal
        stood_by = {key_of(each) for each in self.proposals.values()}
        stood_by |= {key_of(each) for each in self.commits.values()}
        old = [key for key in self.verified if key not in stood_by and key != self.ours]
        for key in old[: max(0, len(self.verified) - VERIFIED)]:
            del self.verified[key]

    def disputed(self, live: tuple[int, ...]) -> tuple[int, bool] | None:
        """Return a live head that stands by a plan which is another one here, and if a serial."""
        for head, commit in sorted(self.commits.items()):
            is_serial = self._rejected.get(key_of(commit))
            if is_serial is not None and commit.live == live and head in live:
                return head, is_serial
        return None

    def stage(self, head: int, key: PlanKey) -> int:
        """Return how far a head's latest word goes with a plan; 0: not at all."""
        commit = self.commits.get(head)
        return int(commit.stage) if commit is not None and key_of(commit) == key else 0

    def heard(self, key: PlanKey) -> tuple[int, ...]:
        """Return, for each head of the plan, the term of its commit to it; 0: none."""
        words = (self.commits.get(head) for head in key[0])
        return tuple(c.term if c is not None and key_of(c) == key else 0 for c in words)

    def has_agreed(self, head: int, own: Commit, me: int) -> bool:
        """Whether a head agreed to our plan knowing our present term."""
        commit = self.commits.get(head)
        if commit is None or key_of(commit) != key_of(own) or commit.stage < Stage.AGREED:
            return False
        return commit.heard[commit.live.index(me)] == own.term

    def holders(self, key: PlanKey) -> Iterable[int]:
        """Return the heads that committed to a plan: they can send it."""
        return [head for head, commit in self.commits.items() if key_of(commit) == key]
