"""Who is there, who may be heard, who is off: the peers as one agent sees them.

A part of the agreement's state machine (`agents.protocol` states the rules):
events in, effects out, nothing else. A head is *present* while its token is
there, *greeted* once its hello fits, *fenced* when it is known to be off.
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.events import Effect, Note, Refused, Send
from agents.messages import VERSION, Hello, Message


class Roster:
    """Peers of one head.

    Parameters
    ----------
    head : int
        Our index.
    names : tuple of str
        Names of all heads of the machine.
    problem : str
        Digest a peer must hold to be heard.
    fenced : iterable of int
        Heads off from the start.
    """

    def __init__(
        self, head: int, names: tuple[str, ...], problem: str, fenced: Iterable[int]
    ) -> None:
        self.head, self.names, self.problem = head, names, problem
        self.fenced = set(fenced) - {head}
        self.greeted: dict[int, int] = {}  # head -> epoch of its hello
        self._present: dict[int, int] = {}  # head -> epoch of its token
        self._refused: dict[int, str] = {}  # head -> why
        self._latest: dict[tuple[int, type[Message]], tuple[int, int]] = {}

    @property
    def live(self) -> tuple[int, ...]:
        """We and the greeted, ascending."""
        return tuple(sorted({self.head, *self.greeted}))

    def missing(self, live: Iterable[int]) -> tuple[int, ...]:
        """Return the heads that are neither in `live` nor fenced."""
        return tuple(sorted(set(range(len(self.names))) - self.fenced - set(live)))

    def is_peer(self, head: int) -> bool:
        """Whether the machine has this head and it is not us."""
        return head != self.head and head < len(self.names)

    def appeared(self, head: int, epoch: int) -> list[Effect]:
        """Take in a liveliness token; greet the head."""
        if not self.is_peer(head) or self._present.get(head, -1) >= epoch:
            return []
        self._present[head] = epoch
        if self.greeted.get(head, epoch) != epoch:
            del self.greeted[head]  # an older incarnation
        return [self._hello(wants_answer=True)]

    def gone(self, head: int, epoch: int) -> list[Effect]:
        """Take in that a token vanished."""
        # A late delete of an old incarnation must not remove the new one.
        if self._present.get(head) != epoch:
            return []
        del self._present[head]
        self._refused.pop(head, None)
        known = self.greeted.pop(head, None)
        return [] if known is None else [Note(f"{self.names[head]} is gone")]

    def fence(self, head: int) -> None:
        """Count a head as off until it speaks again."""
        if self.is_peer(head):
            self.fenced.add(head)
            self._present.pop(head, None)
            self.greeted.pop(head, None)

    def hear(self, head: int, epoch: int, hello: Hello) -> list[Effect]:
        """Take in a hello: greet or refuse the head, answer if asked."""
        if self._present.get(head) != epoch:
            return []  # its token comes first; our next tick asks again
        out: list[Effect] = [self._hello(wants_answer=False)] if hello.wants_answer else []
        if reason := self._mismatch(hello):
            if self._refused.get(head) != reason:
                out.append(Refused(head, reason))
            self._refused[head] = reason
            self.greeted.pop(head, None)
        elif self.greeted.get(head) != epoch:
            self.greeted[head] = epoch
            self._refused.pop(head, None)
            self.fenced.discard(head)  # whoever speaks is not off
            out.append(Note(f"{self.names[head]} is here"))
        return out

    def may_hear(self, head: int, order: tuple[int, int], kind: type[Message]) -> bool:
        """Whether to hear a message: its sender is greeted and said nothing newer of its kind."""
        # Not greeted: unknown or another problem. Our ticks ask for its hello.
        if self.greeted.get(head) != order[0]:
            return False
        if self._latest.get((head, kind), (-1, -1)) >= order:
            return False
        self._latest[head, kind] = order
        return True

    def remind(self) -> list[Effect]:
        """Say hello again while someone present has not been heard."""
        unheard = self._present.keys() - self.greeted.keys() - self._refused.keys()
        return [self._hello(wants_answer=True)] if unheard else []

    def _hello(self, *, wants_answer: bool) -> Send:
        hello = Hello(self.problem, VERSION, self.names[self.head], wants_answer)
        return Send(hello, reliable=True)

    def _mismatch(self, hello: Hello) -> str:
        if hello.version != VERSION:
            return f"{hello.name} speaks version {hello.version} of the protocol, we {VERSION}"
        if hello.problem != self.problem:
            return f"{hello.name} holds problem {hello.problem[:12]}, we hold {self.problem[:12]}"
        return ""
