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

from agents.agreeing import events
from agents.agreeing.agreement import HeadAgreement
from agents.agreeing.roster import Roster
from agents.messages import kinds


class Protocol:
    """One head's side of the conversation, in its incarnation `epoch`.

    `names` are of all heads of the machine, `problem` is the digest of the problem we hold, and
    heads that are `fenced` are off or parked for good from the start.
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
        self._out: list[events.Effect] = []
        self._roster = Roster(head, names, problem, fenced)
        self._agreement = HeadAgreement(head, epoch, self._roster, self._out)
        self._roster_reported = False

    @property
    def phase(self) -> events.Phase:
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

    def start(self) -> list[events.Effect]:
        """Return the first effects; call once before any event."""
        self._out.append(events.LiveChanged(self.live))
        self._check_roster()
        return self._take_out()

    def handle(self, event: events.ProtocolEvent) -> list[events.Effect]:
        """Take in one event and return what is to be done, in order."""
        if self.phase is events.Phase.LEFT:
            return []
        agreement = self._agreement
        match event:
            case kinds.Presence(head, epoch, alive):
                change = self._roster.appeared if alive else self._roster.gone
                self._out += change(head, epoch)
            case kinds.Envelope(head, epoch, seq, message):
                self._receive(head, (epoch, seq), message)
            case kinds.Distribution() | kinds.Joint():
                plans = self.phase is events.Phase.PLANNING and len(self.live) > 1
                if plans and self._is_of_now(event):
                    self._send(event)
            case events.PlanningEnded():
                agreement.begin()
            case kinds.Proposal():
                agreement.proposed(event)
            case events.PlanResolved():
                agreement.resolved(event)
            case events.HeadFenced(head, epoch):
                self._roster.fence(head, epoch)
            case events.Tick(within):
                self._out += self._roster.tick()
                if len(self.live) > 1 and not self.settled:
                    self._send(kinds.Beat(within))
                agreement.tick()
            case events.Leave(reason):
                agreement.leave(reason)
        self._sync()
        self._check_roster()
        if self.phase is events.Phase.AGREEING:
            agreement.advance()
        return self._take_out()

    # Peers ------------------------------------------------------------------

    def _sync(self) -> None:
        """Bring what we know of peers in line with who is greeted."""
        if (dropped := self._agreement.sync()) is None:
            return
        self._out += [events.Forget(head) for head in dropped]
        if self.phase in (events.Phase.PLANNING, events.Phase.AGREEING):
            self._out.append(events.LiveChanged(self.live))
        if self.phase is events.Phase.AGREEING:
            self._agreement.restart_round()

    def _check_roster(self) -> None:
        if not self._roster_reported and not self._roster.missing(self.live):
            self._roster_reported = True
            self._out.append(events.RosterComplete())

    # Messages ---------------------------------------------------------------

    def _receive(self, head: int, order: tuple[int, int], message: kinds.Message) -> None:
        if not self._roster.is_peer(head):
            return
        if isinstance(message, kinds.Hello):
            self._out += self._roster.receive_hello(head, order, message)
            return
        if not self._roster.may_receive(head, order, type(message)):
            return
        match message:
            case kinds.Distribution() | kinds.Joint():
                if self.phase is events.Phase.PLANNING and self._is_of_now(message):
                    self._out.append(events.Take(head, message))
            case kinds.Beat(within):
                self._roster.promise(head, within)
            case kinds.Proposal() | kinds.Commit() | kinds.PlanRequest() | kinds.PlanReply():
                self._agreement.receive(head, message)
            case kinds.Goodbye():
                self._receive_goodbye(head, order[0], message)

    def _is_of_now(self, message: kinds.Distribution | kinds.Joint) -> bool:
        """Whether a message is of use to those that are live: a joint plan is of all of them."""
        return isinstance(message, kinds.Distribution) or message.live == self.live

    def _receive_goodbye(self, head: int, epoch: int, goodbye: kinds.Goodbye) -> None:
        # Who takes leave without a release stays parked by its own word, which
        # is a fence. Who released prints on: it is gone but not off.
        self._out.append(events.LogNote(f"{self._roster.names[head]} left: {goodbye.reason}"))
        if goodbye.digest:
            self._agreement.receive_release(goodbye.digest)
        else:
            self._roster.fence(head, epoch)

    def _send(self, message: kinds.Message) -> None:
        self._out.append(events.Send(message))

    def _take_out(self) -> list[events.Effect]:
        out = list(self._out)
        self._out.clear()  # the agreement writes into the same list
        return out
