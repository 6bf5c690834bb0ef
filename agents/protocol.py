"""The agreement between agents, as a state machine: events in, effects out.

Rules of this file: no sockets, no threads, no clock, no randomness, no planner.
Whoever drives it hands in `agents.events` events and carries out the effects.

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
    RELEASED   the latest word of every other head of L is AGREED or more, and
               every head outside L is fenced

A change of L starts over with new proposals. A commit to a digest we lack is
answered by a `PlanRequest`. Every message is stated again on each tick until
its answer came; receivers keep only the sender's latest, so loss, delay,
reordering and repetition cost time, never agreement, and nothing is latched.

*Safety.* RELEASED is final. X releases D only on Y's AGREED(D), which Y gives
only on X's own COMMITTED(D); both orders of D and D' cannot hold at once, so
two heads never release different plans. A head that hears RELEASED(D) adopts
D. A head outside L is fenced before anyone releases, never merely silent: an
unreachable head is not a dead head. Alone (every other head fenced from the
start) the same machine runs through at once, without a message.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

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
    PlanningEnded,
    PlanResolved,
    Propose,
    Proposed,
    Received,
    Refused,
    Release,
    Resolve,
    RosterComplete,
    Send,
    Take,
    Tick,
    Unfenced,
)
from agents.messages import (
    VERSION,
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


class Phase(Enum):
    """Where one agent is."""

    PLANNING = "planning"
    AGREEING = "agreeing"
    RELEASED = "released"
    LEFT = "left"


class Protocol:
    """One head's side of the agreement.

    Parameters
    ----------
    head : int
        Our index.
    names : tuple of str
        Names of all heads of the machine.
    problem : str
        Digest of the problem we hold.
    fenced : iterable of int
        Heads known to be off or parked for good from the start.
    """

    def __init__(
        self, head: int, names: tuple[str, ...], problem: str, *, fenced: Iterable[int] = ()
    ) -> None:
        self.head = head
        self.names = names
        self.problem = problem
        self.phase = Phase.PLANNING
        self.fenced = set(fenced) - {head}
        self._present: dict[int, int] = {}  # head -> epoch of its token
        self._greeted: dict[int, int] = {}  # head -> epoch of its hello
        self._refused: dict[int, str] = {}
        self._latest: dict[tuple[int, type[Message]], tuple[int, int]] = {}
        self._proposals: dict[int, Proposal] = {}  # latest of each live head, ours included
        self._commits: dict[int, Commit] = {}  # latest of each greeted peer
        self._verified: dict[tuple[tuple[int, ...], str], Proposal] = {}
        self._rejected: set[tuple[tuple[int, ...], str]] = set()
        self._pending: dict[tuple[tuple[int, ...], str], Proposal] = {}  # being resolved
        self._own: Commit | None = None
        self._adopting: Commit | None = None  # released by others, to be followed
        self._roster_told = False
        self._unfenced_told: tuple[int, ...] = ()
        self._out: list[Effect] = []

    @property
    def live(self) -> tuple[int, ...]:
        """We and the greeted peers, ascending."""
        return tuple(sorted({self.head, *self._greeted}))

    @property
    def stage(self) -> Stage | None:
        """How far we are with the current digest."""
        return self._own.stage if self._own else None

    @property
    def settled(self) -> bool:
        """Whether we released and every live peer said so too: we may go."""
        return self.phase is Phase.RELEASED and all(
            self._peer_stage(h) is Stage.RELEASED for h in self._greeted
        )

    def start(self) -> list[Effect]:
        """Return the first effects; call once before any event."""
        self._out.append(LiveChanged(self.live))
        self._check_roster()
        return self._take_out()

    def handle(self, event: Event) -> list[Effect]:
        """Take in one event and return what is to be done, in order."""
        if self.phase is Phase.LEFT:
            return []
        match event:
            case PeerAppeared(head, epoch):
                self._appeared(head, epoch)
            case PeerGone(head, epoch):
                self._gone(head, epoch)
            case Received(envelope):
                self._received(envelope.stamp.head, envelope.stamp.order, envelope.message)
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
                self._fence(head)
            case Tick():
                self._tick()
            case Leave(reason):
                self._leave(reason)
        return self._take_out()

    # Peers ------------------------------------------------------------------

    def _appeared(self, head: int, epoch: int) -> None:
        if head == self.head or not head < len(self.names):
            return
        if self._present.get(head, -1) < epoch:
            self._present[head] = epoch
            if self._greeted.get(head, epoch) != epoch:
                self._drop(head)
            self._send(self._hello(wants_answer=True))

    def _gone(self, head: int, epoch: int) -> None:
        # A late delete of an old incarnation must not remove the new one.
        if self._present.get(head) == epoch:
            del self._present[head]
            if head in self._greeted:
                self._out.append(Note(f"{self.names[head]} is gone"))
                self._drop(head)

    def _drop(self, head: int) -> None:
        if self._greeted.pop(head, None) is None:
            return
        self._proposals.pop(head, None)
        self._commits.pop(head, None)
        self._out.append(Forget(head))
        self._live_changed()

    def _hello(self, *, wants_answer: bool) -> Hello:
        return Hello(self.problem, VERSION, self.names[self.head], wants_answer)

    def _hear_hello(self, head: int, epoch: int, hello: Hello) -> None:
        if self._present.get(head) != epoch:
            return  # its token comes first; our next tick asks again
        if hello.wants_answer:
            self._send(self._hello(wants_answer=False))
        if reason := self._mismatch(hello):
            if self._refused.get(head) != reason:
                self._refused[head] = reason
                self._out.append(Refused(head, reason))
            self._drop(head)
        elif self._greeted.get(head) != epoch:
            self._greet(head, epoch)

    def _mismatch(self, hello: Hello) -> str:
        who = hello.name
        if hello.version != VERSION:
            return f"{who} speaks version {hello.version} of the protocol, we {VERSION}"
        if hello.problem != self.problem:
            return f"{who} holds problem {hello.problem[:12]}, we hold {self.problem[:12]}"
        return ""

    def _greet(self, head: int, epoch: int) -> None:
        self._drop(head)
        self._greeted[head] = epoch
        self._refused.pop(head, None)
        self.fenced.discard(head)  # whoever speaks is not off
        self._out.append(Note(f"{self.names[head]} is here"))
        self._live_changed()
        self._check_roster()

    def _fence(self, head: int) -> None:
        if head == self.head or not head < len(self.names):
            return
        self.fenced.add(head)
        self._present.pop(head, None)
        self._drop(head)
        self._check_roster()
        self._advance()

    def _check_roster(self) -> None:
        missing = set(range(len(self.names))) - self.fenced - set(self.live)
        if not missing and not self._roster_told:
            self._roster_told = True
            self._out.append(RosterComplete())

    def _live_changed(self) -> None:
        if self.phase in (Phase.PLANNING, Phase.AGREEING):
            self._out.append(LiveChanged(self.live))
        if self.phase is Phase.AGREEING:
            self._restart_round()

    # Messages ---------------------------------------------------------------

    def _received(self, head: int, order: tuple[int, int], message: Message) -> None:
        if head == self.head or not head < len(self.names):
            return
        if isinstance(message, Hello):
            self._hear_hello(head, order[0], message)
            return
        # Not greeted: unknown or other problem. Our ticks ask for its hello.
        if self._greeted.get(head) != order[0] or not self._is_latest(head, order, message):
            return
        match message:
            case Distribution():
                if self.phase is Phase.PLANNING:
                    self._out.append(Take(head, message))
            case Proposal():
                self._hear_proposal(head, message)
            case Commit():
                self._hear_commit(head, message)
            case PlanRequest():
                self._hear_request(head, message)
            case PlanReply():
                if message.target == self.head and self.phase is Phase.AGREEING:
                    self._verify(message.proposal)
            case Goodbye():
                self._hear_goodbye(head, message)

    def _is_latest(self, head: int, order: tuple[int, int], message: Message) -> bool:
        key = (head, type(message))
        if self._latest.get(key, (-1, -1)) >= order:
            return False
        self._latest[key] = order
        return True

    def _hear_proposal(self, head: int, proposal: Proposal) -> None:
        self._proposals[head] = proposal
        if self.phase is Phase.PLANNING and self.head in proposal.live:
            self._begin_agreeing()
        else:
            self._advance()

    def _hear_commit(self, head: int, commit: Commit) -> None:
        self._commits[head] = commit
        if commit.stage is Stage.RELEASED:
            self._follow(commit)
        else:
            self._advance()

    def _hear_request(self, head: int, request: PlanRequest) -> None:
        known = self._verified.get((request.live, request.digest))
        if request.target == self.head and known is not None:
            self._send(PlanReply(head, known))

    def _hear_goodbye(self, head: int, goodbye: Goodbye) -> None:
        # Who takes leave stays parked by its own word; that is a fence. If it
        # released before, it first said so, or says so here.
        own = self._own
        self._out.append(Note(f"{self.names[head]} left: {goodbye.reason}"))
        if goodbye.digest and own is not None and own.digest == goodbye.digest:
            self._commits[head] = Commit(own.live, own.digest, Stage.RELEASED)
            self._follow(self._commits[head])
        elif not goodbye.digest:
            self._fence(head)

    # Agreeing ---------------------------------------------------------------

    def _begin_agreeing(self) -> None:
        if self.phase is Phase.PLANNING:
            self.phase = Phase.AGREEING
            self._restart_round()

    def _restart_round(self) -> None:
        self._own = None
        self._unfenced_told = ()
        if self._adopting is None:
            self._proposals.pop(self.head, None)
            self._pending.clear()
            self._out.append(Propose(self.live))

    def _proposed(self, event: Proposed) -> None:
        if self.phase is not Phase.AGREEING or event.live != self.live:
            return  # answers a live set that is history; another Propose is out
        own = Proposal(event.live, event.plans, event.makespan_s, event.digest)
        self._proposals[self.head] = own
        self._verified[own.live, own.digest] = own
        if len(self.live) > 1:
            self._send(own)
        self._advance()

    def _resolved(self, event: PlanResolved) -> None:
        key = (event.live, event.claimed)
        proposal = self._pending.pop(key, None)
        if proposal is None:
            return
        if (event.digest, event.makespan_s) == (proposal.digest, proposal.makespan_s):
            self._verified[key] = proposal
        else:
            self._rejected.add(key)
            text = f"plan {event.claimed[:12]} resolves to {event.digest[:12]} here; not taken"
            self._out.append(Note(text))
        self._advance()

    def _verify(self, proposal: Proposal) -> None:
        key = (proposal.live, proposal.digest)
        if key not in self._verified | self._pending and key not in self._rejected:
            self._pending[key] = proposal
            self._out.append(Resolve(proposal.live, proposal.plans, proposal.digest))

    def _advance(self) -> None:
        if self.phase is not Phase.AGREEING:
            return
        if self._adopting is not None:
            self._adopt(self._adopting)
            return
        best = self._best()
        if best is None:
            return
        if (best.live, best.digest) not in self._verified:
            self._verify(best)
            return
        if self._own is None or self._own.digest != best.digest:
            self._state(Commit(best.live, best.digest, Stage.COMMITTED))
        self._climb()

    def _best(self) -> Proposal | None:
        """Return the winner, or None while a live head's proposal is missing."""
        live = self.live
        stated = [self._proposals.get(head) for head in live]
        if any(p is None or p.live != live for p in stated):
            return None
        fetched = [p for (of, _), p in self._verified.items() if of == live]
        known = [p for p in stated if p is not None] + fetched
        taken = [p for p in known if (p.live, p.digest) not in self._rejected]
        return min(taken, key=lambda p: (p.makespan_s, p.digest), default=None)

    def _climb(self) -> None:
        own = self._own
        if own is None:
            return
        lowest = min((self._peer_stage(h) for h in self._greeted), default=Stage.RELEASED)
        if own.stage is Stage.COMMITTED and lowest >= Stage.COMMITTED:
            own = self._state(Commit(own.live, own.digest, Stage.AGREED))
        if own.stage is not Stage.AGREED or lowest < Stage.AGREED:
            return
        missing = tuple(sorted(set(range(len(self.names))) - self.fenced - set(own.live)))
        if not missing:
            self._release(own)
        elif missing != self._unfenced_told:
            self._unfenced_told = missing
            self._out.append(Unfenced(missing))

    def _peer_stage(self, head: int) -> int:
        """Return how far a peer is with our digest and live set; 0: not at all."""
        own, commit = self._own, self._commits.get(head)
        if own is None or commit is None or (commit.live, commit.digest) != (own.live, own.digest):
            return 0
        return int(commit.stage)

    def _state(self, commit: Commit) -> Commit:
        self._own = commit
        if len(self.live) > 1:
            self._send(commit)
        return commit

    def _release(self, commit: Commit) -> None:
        proposal = self._verified[commit.live, commit.digest]
        self.phase = Phase.RELEASED
        self._adopting = None
        self._state(Commit(commit.live, commit.digest, Stage.RELEASED))
        self._out.append(
            Release(proposal.live, proposal.plans, proposal.makespan_s, proposal.digest)
        )

    # Following a release of others --------------------------------------------

    def _follow(self, commit: Commit) -> None:
        if self.phase is Phase.RELEASED:
            if self._own is not None and self._own.digest != commit.digest:
                self._out.append(Note(f"a peer released another plan, {commit.digest[:12]}"))
        elif self.head not in commit.live:
            self._leave("the others released a plan without this head")
        else:
            self.phase = Phase.AGREEING
            self._adopting = commit
            self._adopt(commit)

    def _adopt(self, commit: Commit) -> None:
        key = (commit.live, commit.digest)
        if key in self._verified:
            self._release(commit)
            return
        for proposal in self._proposals.values():
            if (proposal.live, proposal.digest) == key:
                self._verify(proposal)
                return
        self._ask_for(key)

    def _ask_for(self, key: tuple[tuple[int, ...], str]) -> None:
        if key in self._pending:
            return
        for head, commit in self._commits.items():
            if (commit.live, commit.digest) == key:
                self._send(PlanRequest(head, *key))

    # Time, leaving, output ------------------------------------------------------

    def _tick(self) -> None:
        heard = self._greeted.keys() | self._refused.keys()
        if any(head not in heard for head in self._present):
            self._send(self._hello(wants_answer=True))
        if self.phase is Phase.AGREEING:
            self._repeat()
        elif self.phase is Phase.RELEASED and not self.settled and self._own is not None:
            self._send(self._own)

    def _repeat(self) -> None:
        if self._adopting is not None:
            self._adopt(self._adopting)
            return
        mine = self._proposals.get(self.head)
        behind = [h for h in self._greeted if self._peer_stage(h) < Stage.COMMITTED]
        if mine is not None and behind:
            self._send(mine)
        if self._own is not None and self._greeted:
            self._send(self._own)
        for head in behind:
            commit = self._commits.get(head)
            if commit is not None and commit.live == self.live and not self._knows(commit.digest):
                self._ask_for((commit.live, commit.digest))

    def _knows(self, digest: str) -> bool:
        return any(p.digest == digest for p in self._proposals.values())

    def _leave(self, reason: str) -> None:
        digest = self._own.digest if self.phase is Phase.RELEASED and self._own else ""
        self._send(Goodbye(digest, reason))
        self._out.append(Left(reason))
        self.phase = Phase.LEFT

    def _send(self, message: Message) -> None:
        self._out.append(Send(message, reliable=not isinstance(message, Distribution)))

    def _take_out(self) -> list[Effect]:
        out, self._out = self._out, []
        return out
