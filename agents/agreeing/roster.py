"""Who is there, who may be heard, who is surely off: the peers as one agent sees them.

A part of the agreement's state machine (`agents.agreeing.protocol` states the rules):
events in, effects out, nothing else. A head is *present* while a token of it is
there, *greeted* once its hello fits, *fenced* when it is known to be off.

An epoch names one incarnation of a head and says nothing about time: clocks go
back. Of several tokens of one head the largest epoch counts, so that all agents
look at the same one. A fence is for one incarnation and for good: nothing late
of that incarnation undoes it, only another one speaking does.
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.agreeing.events import Effect, LogNote, Refused, Send
from agents.messages.kinds import SILENCE_TICKS, VERSION, Hello, Message, apart


class Roster:
    """Peers of one head; who holds another `problem`, by its digest, is not heard."""

    def __init__(
        self, head: int, names: tuple[str, ...], problem: str, fenced: Iterable[int]
    ) -> None:
        self.head, self.names, self.problem = head, names, problem
        self.fenced = set(fenced) - {head}
        self.greeted: dict[int, int] = {}  # head -> epoch of its hello
        self._tokens: dict[int, set[int]] = {}  # head -> epochs whose token is there
        self._dead: set[tuple[int, int]] = set()  # (head, epoch) fenced
        self._refused: dict[int, tuple[int, str]] = {}  # head -> epoch, why
        self._latest: dict[tuple[int, type[Message]], tuple[int, int]] = {}  # epoch, seq
        self._silent: dict[int, int] = {}  # head -> our ticks since its last word
        self._promised: dict[int, int] = {}  # head -> ticks within which it speaks again

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

    def present(self, head: int) -> int | None:
        """Return the incarnation of a head that counts, None if it has no token."""
        return max(self._tokens.get(head, ()), default=None)

    def appeared(self, head: int, epoch: int) -> list[Effect]:
        """Take in a liveliness token; greet the head."""
        known = self._tokens.get(head, set())
        if not self.is_peer(head) or (head, epoch) in self._dead or epoch in known:
            return []
        self._tokens[head] = known | {epoch}
        return self._look_again(head)

    def gone(self, head: int, epoch: int) -> list[Effect]:
        """Take in that a token vanished."""
        # A late end of one incarnation must not remove another.
        if epoch not in self._tokens.get(head, ()):
            return []
        self._tokens[head].remove(epoch)
        was = self.greeted.get(head)
        out = self._look_again(head)
        return [LogNote(f"{self.names[head]} is gone"), *out] if was == epoch else out

    def _look_again(self, head: int) -> list[Effect]:
        """Drop what is known of another incarnation than the present one, greet that."""
        epoch = self.present(head)
        if self.greeted.get(head, epoch) != epoch:
            del self.greeted[head]
        if self._refused.get(head, (epoch,))[0] != epoch:
            del self._refused[head]
        return [] if epoch is None or head in self.greeted else [self._hello(wants_answer=True)]

    def fence(self, head: int, epoch: int) -> None:
        """Count one incarnation as off for good, and its head as off until another one speaks."""
        if not self.is_peer(head):
            return
        self._dead.add((head, epoch))
        self._tokens.get(head, set()).discard(epoch)
        if self.greeted.get(head) == epoch:
            del self.greeted[head]
        if self.present(head) is None:
            self.fenced.add(head)

    def receive_hello(self, head: int, order: tuple[int, int], hello: Hello) -> list[Effect]:
        """Take in a hello: greet or refuse the head, answer if asked."""
        epoch = order[0]
        if self.present(head) != epoch:
            return []  # its token comes first; our next tick asks again
        if not self._is_news(head, order, Hello):
            return []  # said again by somebody else, it must keep no dead head here
        out: list[Effect] = [self._hello(wants_answer=False)] if hello.wants_answer else []
        self._silent[head] = 0
        if reason := self._mismatch(hello):
            if self._refused.get(head) != (epoch, reason):
                out.append(Refused(head, reason))
            self._refused[head] = epoch, reason
            self.greeted.pop(head, None)
        elif self.greeted.get(head) != epoch:
            self.greeted[head] = epoch
            self._promised[head] = SILENCE_TICKS
            self._refused.pop(head, None)
            self.fenced.discard(head)  # whoever speaks is not off
            out.append(LogNote(f"{self.names[head]} is here"))
        return out

    def refuse(self, head: int, reason: str) -> list[Effect]:
        """Say once why a head that is greeted cannot be worked with."""
        refusal = (self.greeted[head], reason)
        if self._refused.get(head) == refusal:
            return []
        self._refused[head] = refusal
        return [Refused(head, reason)]

    def may_receive(self, head: int, order: tuple[int, int], kind: type[Message]) -> bool:
        """Whether to take a message: its sender is greeted and sent nothing newer of its kind."""
        # Not greeted: unknown or another problem. Our ticks ask for its hello.
        if self.greeted.get(head) != order[0] or not self._is_news(head, order, kind):
            return False
        self._silent[head] = 0
        return True

    def _is_news(self, head: int, order: tuple[int, int], kind: type[Message]) -> bool:
        """Whether this is the latest of its kind that a head sent; if so it is from now on."""
        epoch, seq = order
        of, latest = self._latest.get((head, kind), (epoch, -1))
        if of == epoch and latest >= seq:
            return False
        self._latest[head, kind] = order
        return True

    def promise(self, head: int, ticks: int) -> None:
        """Note within how many ticks a head will speak again."""
        self._promised[head] = ticks

    def tick(self) -> list[Effect]:
        """Drop who broke its promise to speak, say hello to who is present but not greeted."""
        out: list[Effect] = []
        for head in sorted(self.greeted):
            self._silent[head] += 1
            if self._silent[head] > self._promised[head]:
                # Its token only says that its network lives; what plans may be stuck.
                del self.greeted[head]
                out.append(LogNote(f"{self.names[head]} is silent"))
        present = {head for head in self._tokens if self.present(head) is not None}
        ungreeted = present - self.greeted.keys() - self._refused.keys()
        return [*out, self._hello(wants_answer=True)] if ungreeted else out

    def _hello(self, *, wants_answer: bool) -> Send:
        return Send(Hello(self.problem, VERSION, self.names[self.head], wants_answer))

    def _mismatch(self, hello: Hello) -> str:
        if hello.version != VERSION:
            return f"{hello.name} speaks version {hello.version} of the protocol, we {VERSION}"
        if hello.problem != self.problem:
            theirs, ours = apart(hello.problem, self.problem)
            return f"{hello.name} holds problem {theirs}, we hold {ours}"
        return ""
