"""The port between an agent and the controller of its head: msgpack over two pipes.

To the controller: `start` (which plan, whose actions), `release` (how many of its actions may be
carried out), `pause`, `resume`, `abort`, `finish`. All are states, not steps: saying one twice
changes nothing, and `release` is said again and again, which tells that the agent lives. From the
controller: events (`agents.messages.event_stream`), `ready` behind a `start`, and `alive` all the
time. A `failed` event is the controller's word that its head is off: it stands at the place the
event names and moves no more, unless it is told to start a plan by which it goes to its park; one
that was aborted does not. docs/run.md has what a controller must keep.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import msgpack

from agents.messages.event_stream import MOST_BYTES, event_of
from agents.messages.rows import read_row, unpacker
from decmcts.print.print_events import PrintEvent

MOST_WAITING = 1 << 20  # bytes of one pipe that are kept

ABORTED = "aborted"  # why a head failed that is not to move any more
SILENT = "its agent is silent"
ALIVE_S = 0.1  # so often both sides say that they live
SILENT_S = 3.0  # and after so long without a word the other counts as gone
STARTS_S = 60.0  # that a controller may take to take up a plan


@dataclass(frozen=True, slots=True)
class Ready:
    """A controller holds a plan, and its head stands where that begins."""

    number: int  # of the plan
    digest: str


@dataclass(frozen=True, slots=True)
class Alive:
    """A controller lives; where its head is."""

    time_s: float
    at: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Start:
    """Hold this plan; begin nothing yet."""

    number: int
    path: str
    digest: str


@dataclass(frozen=True, slots=True)
class ReleaseActions:
    """Actions below `until` of plan `number` may be carried out."""

    number: int
    until: int


@dataclass(frozen=True, slots=True)
class Pause:
    """Stand at the end of the action that has begun."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Go on."""


@dataclass(frozen=True, slots=True)
class Abort:
    """Stop now, and be off."""

    why: str = ABORTED


@dataclass(frozen=True, slots=True)
class Finish:
    """Be off behind the action that has begun."""

    why: str


Command = Start | ReleaseActions | Pause | Resume | Abort | Finish
Statement = PrintEvent | Ready | Alive
_COMMANDS: dict[str, type[Command]] = {
    "start": Start, "release": ReleaseActions, "pause": Pause, "resume": Resume, "abort": Abort,
    "finish": Finish,
}  # fmt: skip
_STATED: dict[str, type[Ready | Alive]] = {"ready": Ready, "alive": Alive}
_WORDS = {kind: word for word, kind in (*_COMMANDS.items(), *_STATED.items())}
T = TypeVar("T")


def pack(stated: Command | Ready | Alive) -> bytes:
    """Return the bytes of a command, or of what a controller states besides events."""
    fields = [getattr(stated, name) for name in stated.__dataclass_fields__]
    return bytes(msgpack.packb([_WORDS[type(stated)], *fields]))


class Pipe:
    """Messages out of one end of a pipe; what is none of ours ends it, as if it had closed."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.open = True
        self._unpacker = unpacker(MOST_WAITING, items=16, text=MOST_BYTES)

    def statements(self) -> Iterator[Statement]:
        """Yield what a controller states; waits where the descriptor does."""
        return self._read(statement_of)

    def commands(self) -> Iterator[Command]:
        """Yield what an agent asks; waits where the descriptor does."""
        return self._read(command_of)

    def _read(self, parse: Callable[[Any], T]) -> Iterator[T]:
        try:
            chunk = os.read(self.descriptor, 1 << 16)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        if not chunk:
            self.open = False
            return
        try:
            self._unpacker.feed(chunk)
            for found in self._unpacker:
                yield parse(found)
        except (ValueError, UnicodeDecodeError, msgpack.UnpackException):
            self.open = False


def statement_of(found: Any) -> Statement:
    """Return what a controller states; raises ValueError for anything else."""
    match found:
        case [str(word), *fields] if word in _STATED:
            return read_row(_STATED[word], fields)
    return event_of(found)


def command_of(found: Any) -> Command:
    """Return a command; raises ValueError for anything else."""
    match found:
        case [str(word), *fields] if word in _COMMANDS:
            return read_row(_COMMANDS[word], fields)
    raise ValueError(f"{found!r:.80} is no command")


def write_all(descriptor: int, content: bytes) -> bool:
    """Write bytes; False where nobody reads any more."""
    view = memoryview(content)
    try:
        while view:
            view = view[os.write(descriptor, view) :]
    except OSError:
        return False
    return True
