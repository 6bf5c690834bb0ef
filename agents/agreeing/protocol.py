"""The agreement between agents, as a state machine: events in, effects out.

Rules of this room: no sockets, no threads, no clock, no randomness, no planner.
Whoever drives it hands in the events of `agents.agreeing.events` and carries out the
effects.

Theory of operation
-------------------
*Peers.* A head is **present** while its liveliness token is there and
**greeted** once its `Hello` showed the same problem digest and version; a head
with another digest is refused by name and never heard. The **live set** is we
and the greeted. When a token vanishes (death, leave, lease) the head is
forgotten, when it returns it is greeted again.

*Planning.* Distributions are best effort: the latest by (epoch, seq) wins.

*Silence.* A token says that a head's network lives. That what plans lives is
said by its own thread (`Beat`, or any other message). A greeted head that stays
silent longer than it promised is forgotten like one that is gone, and greeted
again when it speaks. Ticks measure the silence: an agent that stood still itself
counts no time. An agent that can not agree because heads are neither with it nor
fenced says so after a while: the two may be unable to hear each other only.

*Bounds.* Each peer has a few messages kept, a message has a largest size, and a
tick has a largest number of plans resolved, whoever asks for it.

*Agreeing* and why it is safe opens `agents.agreeing.agreement`.
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.agreeing.agreement import Agreement, is_droppable
from agents.agreeing.events import (
    DistributionReady,
    Effect,
    Event,
    Fenced,
    Forget,
    JointReady,
    Leave,
    Left,
    LiveChanged,
    Note,
    Offer,
    PeerAppeared,
    PeerGone,
    Phase,
    PlanningEnded,
    PlanResolved,
    Proposed,
    Received,
    RosterComplete,
    Send,
    Take,
    Tick,
)
from agents.agreeing.roster import Roster
from agents.messages.kinds import (
    Beat,
    Commit,
    Distribution,
    Goodbye,
    Hello,
    Joint,
    Message,
    PlanReply,
    PlanRequest,
    Proposal,
)


class Protocol:
    """One head's side of the conversation.

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
        self._out: list[Effect] = []
        self._roster = Roster(head, names, problem, fenced)
        self._agreement = Agreement(head, epoch, self._roster, self._out)
        self._roster_told = False

    @property
    def phase(self) -> Phase:
        """Where we are."""
        return self._agreement.phase

    @property
    def live(self) -> tuple[int, ...]:
        """We and the greeted peers, ascending."""
        return self._roster.live

    @property
    def settled(self) -> bool:
        """Whether we released and every live peer said so too: we may go."""
        return self._agreement.settled

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
            self._agreement.advance()
        return self._take_out()

    def _take_in(self, event: Event) -> None:
        agreement = self._agreement
        match event:
            case PeerAppeared(head, epoch):
                self._out += self._roster.appeared(head, epoch)
            case PeerGone(head, epoch):
                self._out += self._roster.gone(head, epoch)
            case Received(envelope):
                self._receive(envelope.stamp.head, envelope.stamp.order, envelope.message)
            case DistributionReady(distribution):
                self._tell(distribution)
            case JointReady(joint):
                if joint.live == self.live:
                    self._tell(joint)
            case PlanningEnded():
                agreement.begin()
            case Proposed():
                agreement.proposed(event)
            case PlanResolved():
                agreement.resolved(event)
            case Fenced(head, epoch):
                self._roster.fence(head, epoch)
            case Tick(within):
                self._tick(within)
            case Leave(reason):
                self._leave(reason)

    # Peers ------------------------------------------------------------------

    def _sync(self) -> None:
        """Bring what we know of peers in line with who is greeted."""
        if not (changed := self._agreement.sync()):
            return
        self._out += [Forget(head) for head in changed.dropped]
        if self.phase in (Phase.PLANNING, Phase.AGREEING):
            self._out.append(LiveChanged(self.live))
        if self.phase is Phase.AGREEING:
            self._agreement.restart_round()

    def _check_roster(self) -> None:
        if not self._roster_told and not self._roster.missing(self.live):
            self._roster_told = True
            self._out.append(RosterComplete())

    # Messages ---------------------------------------------------------------

    def _receive(self, head: int, order: tuple[int, int], message: Message) -> None:
        if not self._roster.is_peer(head):
            return
        if isinstance(message, Hello):
            self._out += self._roster.hear(head, order, message)
            return
        if not self._roster.may_hear(head, order, type(message)):
            return
        match message:
            case Distribution() | Joint():
                self._be_told(head, message)
            case Beat(within):
                self._roster.promise(head, within)
            case Proposal() | Commit() | PlanRequest() | PlanReply():
                self._agreement.receive(head, message)
            case Goodbye():
                self._hear_goodbye(head, order[0], message)

    def _be_told(self, head: int, message: Distribution | Joint) -> None:
        if self.phase is not Phase.PLANNING:
            return
        if isinstance(message, Distribution):
            self._out.append(Take(head, message))
        elif message.live == self.live:
            self._out.append(Offer(head, message))

    def _hear_goodbye(self, head: int, epoch: int, goodbye: Goodbye) -> None:
        # Who takes leave without a release stays parked by its own word, which
        # is a fence. Who released prints on: it is gone but not off.
        self._out.append(Note(f"{self._roster.names[head]} left: {goodbye.reason}"))
        if goodbye.digest:
            self._agreement.hear_release(goodbye.digest)
        else:
            self._roster.fence(head, epoch)

    # Time, leaving, output ------------------------------------------------------

    def _tell(self, message: Distribution | Joint) -> None:
        if self.phase is Phase.PLANNING and len(self.live) > 1:
            self._send(message)

    def _tick(self, within: int) -> None:
        self._out += self._roster.tick()
        if len(self.live) > 1 and not self.settled:
            self._send(Beat(within))
        self._agreement.tick()

    def _leave(self, reason: str) -> None:
        self._send(Goodbye(self._agreement.released_digest, reason))
        self._out.append(Left(reason))
        self._agreement.phase = Phase.LEFT

    def _send(self, message: Message) -> None:
        self._out.append(Send(message, reliable=not is_droppable(message)))

    def _take_out(self) -> list[Effect]:
        out = list(self._out)
        self._out.clear()  # the agreement writes into the same list
        return out
