"""How live heads come to one joint plan: the core of the agreement's state machine.

The rules of `agents.agreeing.protocol` hold here too. Peers, silence and fences are
`agents.agreeing.roster`'s, book-keeping of what was said `agents.agreeing.ballot`'s.

Theory of operation
-------------------
*Agreeing.* Begins when our time is up or a peer proposes. For the live set L
each head sends one `Proposal`. With all of L's proposals at hand the winner is
the smallest (makespan, digest), so its choice needs no further message. Each
head resolves the winner itself; equal digests are the proof that all hold the
same plan. Then three stages, each a `Commit` for (L, digest):

    COMMITTED  I resolved it and it is the best I know for L
    AGREED     the latest word of every other head of L is COMMITTED or more
    RELEASED   every other head of L is AGREED and says it heard my present
               term, and every head outside L is fenced

A change of L starts over with new proposals. A head may start over for a change of L that
the others never saw; those do not propose again. But they still say what they committed to:
the winner of all proposals then, theirs included. So a commit stands in for a proposal that
we lack. A commit to a digest we lack is answered by a `PlanRequest`. Every message is stated
again on each tick, long plans every few ticks, until its answer came; receivers keep only
the sender's latest, so loss, delay, reordering and repetition cost time, never agreement,
and nothing is latched.

*Serial order.* The same plans may resolve differently on two hosts (another
processor, another library). Then each takes the other's proposal for a lie and
would stand by its own for ever. So a head that hears a live head stand by a plan
which is another one here proposes, instead of its best, an explicit order of
contours and heads. With one such proposal in L only such proposals count. An
order is checked, not computed: its digest is of whole numbers only. A head that
can not accept even that refuses the peer by name.

*Safety.* RELEASED is final. A **term** is one period in which a head stands by
one (L, digest). X releases in term t only when every Y of L said AGREED having
heard t. From then on Y has no older word of X to count, and X never says
another: Y can not release anything else, and had it done so before, it would
not have said AGREED. Hence two heads never release different plans. A head that
hears RELEASED follows. A head outside L is fenced before anyone releases, never
merely silent: an unreachable head is not a dead head. Alone (every other head
fenced from the start) the same machine runs through without a message.
"""

from __future__ import annotations

from dataclasses import replace

from agents.agreeing import events
from agents.agreeing.ballot import Ballot, PlanKey, key_of
from agents.agreeing.roster import Roster
from agents.messages.kinds import (
    Commit,
    Goodbye,
    Message,
    PlanReply,
    PlanRequest,
    Proposal,
    Stage,
    apart,
)

_TERMS = 2**20  # terms of one incarnation; epochs are spaced so that terms never repeat
STALLED_TICKS = 50  # ticks of agreeing after which the heads that are missing are named: 5 s

LONG_PLAN = 2048
"""Numbers in plans that one tick's pause stands for before they are said again. So an
agent repeats its own plan at 20 480 numbers a second at most, however long it is."""

LONGEST_PAUSE_TICKS = 30
"""No plan is said again later than this: lost words must not hold up a release."""


class HeadAgreement:
    """One head's side of the agreement; effects go to the end of `out`.

    The protocol changes the `roster`; `epoch` is our incarnation.
    """

    def __init__(self, head: int, epoch: int, roster: Roster, out: list[events.Effect]) -> None:
        self.head = head
        self.phase = events.Phase.PLANNING
        self._term = epoch * _TERMS
        self._roster, self._out = roster, out
        self._known: dict[int, int] = {}  # greeted peers (head -> epoch) as last looked at
        self._ballot = Ballot()
        self._own: Commit | None = None
        self._adopting: Commit | None = None  # released by others, to be followed
        self._may_ask = True  # one round of plan requests a tick
        self._answered: set[tuple[int, PlanKey]] = set()  # plans sent again since the last pause
        self._may_resolve = len(roster.names)  # so many plans of others a tick
        self._serial = False  # we propose the explicit order
        self._ticks = self._agreeing_ticks = 0
        self._unfenced_reported: tuple[int, ...] = ()

    @property
    def settled(self) -> bool:
        """Whether we released and every live peer said so too."""
        return self.phase is events.Phase.RELEASED and self._lowest() == Stage.RELEASED

    def sync(self) -> tuple[int, ...] | None:
        """Forget what peers stated who are not greeted any more; None: all are as before.

        Returns the heads that are gone, or another incarnation now.
        """
        greeted = self._roster.greeted
        if greeted == self._known:
            return None
        dropped = tuple(h for h, epoch in self._known.items() if greeted.get(h) != epoch)
        for head in dropped:
            self._ballot.drop(head)
        self._known = dict(greeted)
        return dropped

    # Messages ---------------------------------------------------------------

    def receive(self, head: int, message: Proposal | Commit | PlanRequest | PlanReply) -> None:
        """Take in a message of a greeted peer."""
        match message:
            case Proposal():
                self._ballot.propose(head, message)
                if self.head in message.live:
                    self.begin()
            case Commit():
                self._ballot.commits[head] = message
                if message.stage is Stage.RELEASED:
                    self._follow(message)
            case PlanRequest():
                self._answer(head, message)
            case PlanReply():
                # Only what someone stands by: else every reply would cost a resolve.
                key = key_of(message.proposal)
                if message.target == self.head and self._ballot.holders(key):
                    self._resolve(message.proposal)

    def receive_release(self, digest: str) -> None:
        """Take in that a peer released this plan and left."""
        if self._own is not None and self._own.digest == digest:
            self._follow(self._own)

    def _answer(self, head: int, request: PlanRequest) -> None:
        key = request.live, request.digest
        known = self._ballot.verified.get(key)
        if request.target == self.head and known is not None and (head, key) not in self._answered:
            self._answered.add((head, key))
            self._send(PlanReply(head, known))

    # Agreeing ---------------------------------------------------------------

    def begin(self) -> None:
        """End planning."""
        if self.phase is events.Phase.PLANNING:
            self.phase = events.Phase.AGREEING
            self.restart_round()

    def restart_round(self) -> None:
        """Begin again for the live heads of now."""
        self._own = None
        self._serial = False
        self._unfenced_reported = ()
        if self._adopting is not None and not self._may_adopt(key_of(self._adopting)):
            self._adopting = None  # who released it is gone, and nobody else has the plan
        if self._adopting is None:
            self._ballot.drop(self.head)
            self._out.append(events.Propose(self._roster.live))

    def proposed(self, own: Proposal) -> None:
        """Take in our planner's own proposal."""
        asked = (self._roster.live, self._serial)
        if self.phase is not events.Phase.AGREEING or (own.live, own.serial) != asked:
            return  # answers what is history; another Propose is out
        self._ballot.propose(self.head, own, verified=True)
        if self._known:
            self._send(own)

    def _resolve(self, proposal: Proposal) -> None:
        if not self._may_resolve:
            return  # what still counts comes again after the next tick
        plans = self._ballot.begin_resolving(proposal)
        if plans is not None:
            self._may_resolve -= 1
            self._out.append(events.Resolve(proposal.live, plans, proposal.digest))

    def resolved(self, event: events.PlanResolved) -> None:
        """Take in what a plan of others gives here."""
        key = (event.live, event.claimed)
        if not self._ballot.end_resolving(key, event.digest, event.makespan_s):
            claimed, here = apart(event.claimed, event.digest)
            text = f"plan {claimed} resolves to {here or 'nothing'} here; not taken"
            self._out.append(events.LogNote(text))

    def advance(self) -> None:
        """Go as far as what we know allows."""
        if self._adopting is not None:
            self._adopt(self._adopting)
            return
        self._settle_dispute()
        best = self._ballot.best(self._roster.live)
        if best is None:
            return
        if key_of(best) not in self._ballot.verified:
            self._resolve(best)
            return
        own = self._own
        if own is None or key_of(own) != key_of(best):
            self._term += 1
            own = self._state(Stage.COMMITTED, key_of(best))
        self._climb(own)

    def _settle_dispute(self) -> None:
        """Fall back to the explicit order if a live head stands by what is another plan here."""
        disputed = self._ballot.disputed(self._roster.live)
        if disputed is None:
            return
        head, is_serial = disputed
        name = self._roster.names[head]
        if is_serial:
            self._out += self._roster.refuse(head, f"the serial order of {name} is no order here")
        elif not self._serial:
            self._serial = True
            text = f"{name} resolves plans to others than we do: serial order proposed"
            self._out += [events.LogNote(text), events.Propose(self._roster.live, serial=True)]

    def _climb(self, own: Commit) -> None:
        if own.stage is Stage.COMMITTED and self._lowest() >= Stage.COMMITTED:
            own = self._state(Stage.AGREED, key_of(own))
        if own.stage is not Stage.AGREED:
            return
        if not all(self._ballot.has_agreed(h, own, self.head) for h in self._known):
            return
        missing = self._roster.missing(own.live)
        if not missing:
            self._release(key_of(own))
        elif missing != self._unfenced_reported:
            self._report_unfenced(missing)

    def _report_unfenced(self, missing: tuple[int, ...]) -> None:
        self._unfenced_reported = missing
        if missing:
            self._out.append(events.Unfenced(missing))

    def _lowest(self) -> int:
        """Return how far the slowest peer is with our plan; 0: not at all."""
        own = self._own
        if own is None:
            return 0
        stages = (self._ballot.stage(head, key_of(own)) for head in self._known)
        return min(stages, default=int(Stage.RELEASED))

    def _state(self, stage: Stage, key: PlanKey) -> Commit:
        self._ballot.ours = key
        self._own = Commit(*key, stage, self._term, self._ballot.heard(key))
        self._send_own()
        return self._own

    def _send_own(self) -> None:
        if self._own is not None and self._known:
            # What we heard may have changed since we last said it.
            self._own = replace(self._own, heard=self._ballot.heard(key_of(self._own)))
            self._send(self._own)

    def _release(self, key: PlanKey) -> None:
        plan = self._ballot.verified[key]
        self.phase = events.Phase.RELEASED
        self._adopting = None
        self._state(Stage.RELEASED, key)
        self._out.append(events.PlanReleased(plan.live, plan.plans, plan.makespan_s, plan.digest))

    # Following a release of others --------------------------------------------

    def _follow(self, commit: Commit) -> None:
        if self.phase is events.Phase.RELEASED:
            if self._own is not None and key_of(self._own) != key_of(commit):
                theirs, ours = apart(commit.digest, self._own.digest)
                text = f"a peer released another plan: {theirs}, not {ours}"
                self._out.append(events.LogNote(text))
        elif self.head not in commit.live:
            self.leave("the others released a plan without this head")
        else:
            self.phase = events.Phase.AGREEING
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

    def _may_adopt(self, key: PlanKey) -> bool:
        """Whether we have a plan, or somebody who is here does."""
        ballot = self._ballot
        return ballot.find(key) is not None or key in ballot.pending or bool(ballot.holders(key))

    def _ask_for(self, key: PlanKey) -> None:
        if self._may_ask and key not in self._ballot.pending:
            self._may_ask = False
            for head in self._ballot.holders(key):
                self._send(PlanRequest(head, *key))

    # Time, leaving, output ------------------------------------------------------

    def tick(self) -> None:
        """Say again what may have been lost; long plans now and then only."""
        self._ticks += 1
        self._may_resolve = len(self._roster.names)
        plans_too = self._may_send_plans()
        if plans_too:
            self._may_ask = True
            self._answered.clear()
        if self.phase is events.Phase.RELEASED and not self.settled:
            self._send_own()
        if self.phase is not events.Phase.AGREEING:
            return
        self._agreeing_ticks += 1
        if self._agreeing_ticks % STALLED_TICKS == 0:
            self._report_unfenced(self._roster.missing(self._roster.live))
        if self._adopting is None:
            self._repeat(plans_too=plans_too)

    def _may_send_plans(self) -> bool:
        """Whether plans may be said again, or asked for again, in this tick."""
        mine = self._ballot.proposals.get(self.head)
        length = sum(map(len, mine.plans.values())) if mine is not None else 0
        pause = min(1 + length // LONG_PLAN, LONGEST_PAUSE_TICKS)
        return self._ticks % pause == 0

    def _repeat(self, *, plans_too: bool) -> None:
        """Say again what peers who are not with us may have missed."""
        own, mine = self._own, self._ballot.proposals.get(self.head)
        if mine is not None and plans_too and self._known and self._lowest() < Stage.COMMITTED:
            self._send(mine)
        self._send_own()
        ours = None if own is None else key_of(own)
        commits = (self._ballot.commits.get(head) for head in self._known)
        for key in [key_of(commit) for commit in commits if commit is not None]:
            if key[0] == self._roster.live and key != ours and not self._ballot.find(key):
                self._ask_for(key)

    def leave(self, reason: str) -> None:
        """Take leave, with the digest of the plan that we released."""
        released = self._own.digest if self._own and self.phase is events.Phase.RELEASED else ""
        self._send(Goodbye(released, reason))
        self._out.append(events.Left(reason))
        self.phase = events.Phase.LEFT

    def _send(self, message: Message) -> None:
        self._out.append(events.Send(message))
