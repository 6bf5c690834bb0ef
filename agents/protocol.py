"""The agreement between agents, as a state machine: events in, effects out.

Rules of this file, `agents.roster` and `agents.ballot`: no sockets, no threads,
no clock, no randomness, no planner. Whoever drives it hands in `agents.events`
events and carries out the effects.

Theory of operation
-------------------
*Peers.* A head is **present** while its liveliness token is there and
**greeted** once its `Hello` showed the same problem digest and version; a head
with another digest is refused by name and never heard. The **live set** is we
and the greeted. When a token vanishes (death, leave, lease) the head is
forgotten, when it returns it is greeted again.

*Planning.* Distributions are best effort: the latest by (epoch, seq) wins.

*Agreeing.* Begins when our time is up or a peer proposes. For the live set L
each head sends one `Proposal`. With all of L's proposals at hand the winner is
the smallest (makespan, digest), so its choice needs no further message. Each
head resolves the winner itself; equal digests are the proof that all hold the
same plan. Then three stages, each a `Commit` for (L, digest):

    COMMITTED  I resolved it and it is the best I know for L
    AGREED     the latest word of every other head of L is COMMITTED or more
    RELEASED   every other head of L is AGREED and says it heard my present
               term, and every head outside L is fenced

A change of L starts over with new proposals. A commit to a digest we lack is
answered by a `PlanRequest`. Every message is stated again on each tick until
its answer came; receivers keep only the sender's latest, so loss, delay,
reordering and repetition cost time, never agreement, and nothing is latched.

*Safety.* RELEASED is final. A **term** is one stretch in which a head stands by
one (L, digest). X releases in term t only when every Y of L said AGREED having
heard t. From then on Y has no older word of X to count, and X never says
another: Y can not release anything else, and had it done so before, it would
not have said AGREED. Hence two heads never release different plans. A head that
hears RELEASED follows. A head outside L is fenced before anyone releases, never
merely silent: an unreachable head is not a dead head. Alone (every other head
fenced from the start) the same machine runs through without a message.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from agents.ballot import Ballot, Key, key_of
from agents.events import (
    DistributionReady,
    Effect,
    Event,
    Fenced,
    Forget,
    Leave,
    Left,
    LiveChanged,
    Note,
    PeerAppeared,
    PeerGone,
    Phase,
    PlanningEnded,
    PlanResolved,
    Propose,
    Proposed,
    Received,
    Release,
    Resolve,
    RosterComplete,
    Send,
    Take,
    Tick,
    Unfenced,
)
from agents.messages import (
    Commit,
    Distribution,
    Goodbye,
    Hello,
    Message,
    PlanReply,
    PlanRequest,
    Proposal,
    Stage,
)
from agents.roster import Roster

_TERMS = 2**20
"""Terms of one incarnation; epochs are spaced so that terms never repeat."""


class Protocol:
    """One head's side of the agreement.

    Parameters
    ----------
    head, epoch : int
        Our index and incarnation.
    names : tuple of str
        Names of all heads of the machine.
    problem : str
        Digest of the problem we hold.
    fenced : iterable of int
        Heads known to be off or parked for good from the start.
    """

    def __init__(
        self,
        head: int,
        epoch: int,
        names: tuple[str, ...],
        problem: str,
        *,
        fenced: Iterable[int] = (),
    ) -> None:
        self.head = head
        self.phase = Phase.PLANNING
        self._term = epoch * _TERMS
        self._roster = Roster(head, names, problem, fenced)
        self._known: dict[int, int] = {}  # greeted peers (head -> epoch) as last looked at
        self._ballot = Ballot()
        self._own: Commit | None = None
        self._adopting: Commit | None = None  # released by others, to be followed
        self._may_ask = True  # one round of plan requests a tick
        self._roster_told = False
        self._unfenced_told: tuple[int, ...] = ()
        self._out: list[Effect] = []

    @property
    def live(self) -> tuple[int, ...]:
        """We and the greeted peers, ascending."""
        return self._roster.live

    @property
    def settled(self) -> bool:
        """Whether we released and every live peer said so too: we may go."""
        return self.phase is Phase.RELEASED and self._lowest() == Stage.RELEASED

    def start(self) -> list[Effect]:
        """Return the first effects; call once before any event."""
        self._out.append(LiveChanged(self.live))
        self._check_roster()
        return self._take_out()

    def handle(self, event: Event) -> list[Effect]:
        """Take in one event and return what is to be done, in order."""
        if self.phase is Phase.LEFT:
            return []
        self._take_in(event)
        self._sync()
        self._check_roster()
        if self.phase is Phase.AGREEING:
            self._advance()
        return self._take_out()

    def _take_in(self, event: Event) -> None:
        match event:
            case PeerAppeared(head, epoch):
                self._out += self._roster.appeared(head, epoch)
            case PeerGone(head, epoch):
                self._out += self._roster.gone(head, epoch)
            case Received(envelope):
                self._receive(envelope.stamp.head, envelope.stamp.order, envelope.message)
            case DistributionReady(distribution):
                if self.phase is Phase.PLANNING and len(self.live) > 1:
                    self._send(distribution)
            case PlanningEnded():
                self._begin_agreeing()
            case Proposed():
                self._proposed(event)
            case PlanResolved():
                self._resolved(event)
            case Fenced(head):
                self._roster.fence(head)
            case Tick():
                self._tick()
            case Leave(reason):
                self._leave(reason)

    # Peers ------------------------------------------------------------------

    def _sync(self) -> None:
        """Bring what we know of peers in line with who is greeted."""
        greeted = self._roster.greeted
        if greeted == self._known:
            return
        for head in [h for h, epoch in self._known.items() if greeted.get(h) != epoch]:
            self._ballot.drop(head)
            self._out.append(Forget(head))
        self._known = dict(greeted)
        if self.phase in (Phase.PLANNING, Phase.AGREEING):
            self._out.append(LiveChanged(self.live))
        if self.phase is Phase.AGREEING:
            self._restart_round()

    def _check_roster(self) -> None:
        if not self._roster_told and not self._roster.missing(self.live):
            self._roster_told = True
            self._out.append(RosterComplete())

    # Messages ---------------------------------------------------------------

    def _receive(self, head: int, order: tuple[int, int], message: Message) -> None:
        if not self._roster.is_peer(head):
            return
        if isinstance(message, Hello):
            self._out += self._roster.hear(head, order[0], message)
            return
        if not self._roster.may_hear(head, order, type(message)):
            return
        match message:
            case Distribution():
                if self.phase is Phase.PLANNING:
                    self._out.append(Take(head, message))
            case Proposal():
                self._ballot.propose(head, message)
                if self.head in message.live:
                    self._begin_agreeing()
            case Commit():
                self._ballot.commits[head] = message
                if message.stage is Stage.RELEASED:
                    self._follow(message)
            case PlanRequest():
                self._answer(head, message)
            case PlanReply():
                if message.target == self.head:
                    self._resolve(message.proposal)
            case Goodbye():
                self._hear_goodbye(head, message)

    def _answer(self, head: int, request: PlanRequest) -> None:
        known = self._ballot.verified.get((request.live, request.digest))
        if request.target == self.head and known is not None:
            self._send(PlanReply(head, known))

    def _hear_goodbye(self, head: int, goodbye: Goodbye) -> None:
        # Who takes leave without a release stays parked by its own word, which
        # is a fence. Who released prints on: it is gone but not off.
        self._out.append(Note(f"{self._roster.names[head]} left: {goodbye.reason}"))
        if not goodbye.digest:
            self._roster.fence(head)
        elif self._own is not None and self._own.digest == goodbye.digest:
            self._follow(self._own)

    # Agreeing ---------------------------------------------------------------

    def _begin_agreeing(self) -> None:
        if self.phase is Phase.PLANNING:
            self.phase = Phase.AGREEING
            self._restart_round()

    def _restart_round(self) -> None:
        self._own = None
        self._unfenced_told = ()
        if self._adopting is None:
            self._ballot.drop(self.head)
            self._out.append(Propose(self.live))

    def _proposed(self, event: Proposed) -> None:
        if self.phase is not Phase.AGREEING or event.live != self.live:
            return  # answers a live set that is history; another Propose is out
        own = Proposal(event.live, event.plans, event.makespan_s, event.digest)
        self._ballot.propose(self.head, own, verified=True)
        if self._known:
            self._send(own)

    def _resolve(self, proposal: Proposal) -> None:
        plans = self._ballot.begin_resolving(proposal)
        if plans is not None:
            self._out.append(Resolve(proposal.live, plans, proposal.digest))

    def _resolved(self, event: PlanResolved) -> None:
        key = (event.live, event.claimed)
        if not self._ballot.end_resolving(key, event.digest, event.makespan_s):
            here = event.digest[:12] or "nothing"
            text = f"plan {event.claimed[:12]} resolves to {here} here; not taken"
            self._out.append(Note(text))

    def _advance(self) -> None:
        if self._adopting is not None:
            self._adopt(self._adopting)
            return
        best = self._ballot.best(self.live)
        if best is None:
            return
        if key_of(best) not in self._ballot.verified:
            self._resolve(best)
            return
        if self._own is None or key_of(self._own) != key_of(best):
            self._term += 1
            self._state(Stage.COMMITTED, key_of(best))
        self._climb()

    def _climb(self) -> None:
        own = self._own
        if own is None:
            return
        if own.stage is Stage.COMMITTED and self._lowest() >= Stage.COMMITTED:
            own = self._state(Stage.AGREED, key_of(own))
        if own.stage is not Stage.AGREED:
            return
        if not all(self._ballot.has_agreed(h, own, self.head) for h in self._known):
            return
        missing = self._roster.missing(own.live)
        if not missing:
            self._release(key_of(own))
        elif missing != self._unfenced_told:
            self._unfenced_told = missing
            self._out.append(Unfenced(missing))

    def _lowest(self) -> int:
        """Return how far the slowest peer is with our plan; 0: not at all."""
        own = self._own
        if own is None:
            return 0
        stages = (self._ballot.stage(head, key_of(own)) for head in self._known)
        return min(stages, default=int(Stage.RELEASED))

    def _state(self, stage: Stage, key: Key) -> Commit:
        self._own = Commit(*key, stage, self._term, self._ballot.heard(key))
        self._say_own()
        return self._own

    def _say_own(self) -> None:
        if self._own is not None and self._known:
            # What we heard may have changed since we last said it.
            self._own = replace(self._own, heard=self._ballot.heard(key_of(self._own)))
            self._send(self._own)

    def _release(self, key: Key) -> None:
        plan = self._ballot.verified[key]
        self.phase = Phase.RELEASED
        self._adopting = None
        self._state(Stage.RELEASED, key)
        self._out.append(Release(plan.live, plan.plans, plan.makespan_s, plan.digest))

    # Following a release of others --------------------------------------------

    def _follow(self, commit: Commit) -> None:
        if self.phase is Phase.RELEASED:
            if self._own is not None and key_of(self._own) != key_of(commit):
                self._out.append(Note(f"a peer released another plan, {commit.digest[:12]}"))
        elif self.head not in commit.live:
            self._leave("the others released a plan without this head")
        else:
            self.phase = Phase.AGREEING
            self._adopting = commit

    def _adopt(self, commit: Commit) -> None:
        key = key_of(commit)
        plan = self._ballot.find(key)
        if key in self._ballot.verified:
            self._release(key)
        elif plan is not None:
            self._resolve(plan)
        else:
            self._ask_for(key)

    def _ask_for(self, key: Key) -> None:
        if self._may_ask and not self._ballot.is_pending(key):
            self._may_ask = False
            for head in self._ballot.holders(key):
                self._send(PlanRequest(head, *key))

    # Time, leaving, output ------------------------------------------------------

    def _tick(self) -> None:
        self._may_ask = True
        self._out += self._roster.remind()
        if self.phase is Phase.AGREEING and self._adopting is None:
            self._repeat()
        elif self.phase is Phase.RELEASED and not self.settled:
            self._say_own()

    def _repeat(self) -> None:
        """Say again what peers who are not with us may have missed."""
        own, mine = self._own, self._ballot.proposal(self.head)
        if mine is not None and self._known and self._lowest() < Stage.COMMITTED:
            self._send(mine)
        self._say_own()
        for head in self._known:
            theirs = self._ballot.commits.get(head)
            if theirs is None or theirs.live != self.live or self._ballot.find(key_of(theirs)):
                continue
            if own is None or key_of(theirs) != key_of(own):
                self._ask_for(key_of(theirs))

    def _leave(self, reason: str) -> None:
        released = self._own if self.phase is Phase.RELEASED else None
        self._send(Goodbye(released.digest if released else "", reason))
        self._out.append(Left(reason))
        self.phase = Phase.LEFT

    def _send(self, message: Message) -> None:
        # A distribution is soon out of date; all else must arrive.
        self._out.append(Send(message, reliable=not isinstance(message, Distribution)))

    def _take_out(self) -> list[Effect]:
        out, self._out = self._out, []
        return out
