"""What a head tells the others while it prints: where it stands, said again and again.

A report is a state, not a step: it names the plan a head holds and the last event of its
controller. Both only grow. So a report that is lost, late, doubled or overtaken costs time and
nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import msgpack

from agents.messages.event_stream import MOST_BYTES, pack_event, unpack_event
from agents.messages.kinds import DIGEST_LENGTHS, MAX_HEADS
from decmcts.print.plan import ACTION_END
from decmcts.print.print_events import NO_ACTION, EventKind, PrintEvent

KIND = "run"  # in keys
VERSION = 1
_MOST = 2**53


@dataclass(frozen=True, slots=True, order=True)
class Reached:
    """How far a head has come in a plan; what is further is greater."""

    ended: int = 0  # actions that have ended
    begun: bool = False  # the next has begun
    point: int = 0  # of its path behind the first that the nozzle has passed

    def after(self, event: PrintEvent) -> Reached:
        """Return what an event of the plan's actions leads to: never less."""
        if event.action == NO_ACTION:
            return self
        match event.kind:
            case EventKind.ENDED:
                found = Reached(event.action + 1)
            case EventKind.BEGAN | EventKind.PASSED:
                found = Reached(event.action, True, event.point)
            case _:
                found = self
        return max(self, found)

    def passed(self, action: int, point: int) -> bool:
        """Tell whether the nozzle has moved past a point of an action, or its end."""
        if action < self.ended:
            return True
        return action == self.ended and point != ACTION_END and self.begun and point <= self.point


NOTHING = Reached()


@dataclass(frozen=True, slots=True)
class HeadReport:
    """Where one head stands."""

    head: int  # in the first plan
    seq: int  # a later report has more
    number: int = -1  # of the plan it holds; -1: none yet
    digest: str = ""  # of that plan
    reached: Reached = NOTHING  # in that plan
    event: PrintEvent | None = None  # the last of its controller
    off: bool = False  # it prints no more

    def pack(self) -> bytes:
        """Return the bytes of a report."""
        event = b"" if self.event is None else pack_event(self.event)
        at = [self.reached.ended, self.reached.begun, self.reached.point]
        fields = [VERSION, self.head, self.seq, self.number, self.digest, at, self.off, event]
        return bytes(msgpack.packb(fields))


def unpack_report(head: int, payload: bytes) -> HeadReport:
    """Return the report of a head; raises ValueError where there is none."""
    if len(payload) > 2 * MOST_BYTES:
        raise ValueError(f"{len(payload)} bytes are more than a report has")
    try:
        found: Any = msgpack.unpackb(
            payload, max_str_len=DIGEST_LENGTHS.stop, max_bin_len=MOST_BYTES, max_array_len=8,
            max_map_len=0, max_ext_len=0,
        )  # fmt: skip
    except (ValueError, UnicodeDecodeError, msgpack.UnpackException) as error:
        raise ValueError(f"no report ({error})") from error
    match found:
        case [
            int(version), int(of), int(seq), int(number), str(digest),
            [int(ended), bool(begun), int(point)], bool(off), bytes(event),
        ] if version == VERSION and of == head < MAX_HEADS:  # fmt: skip
            if not all(-1 <= value <= _MOST for value in (seq, number, ended, point)):
                raise ValueError("a count that is none")
            reached = Reached(ended, begun, point)
            last = unpack_event(event) if event else None
            return HeadReport(head, seq, number, digest, reached, last, off)
    raise ValueError("no report of this head and version")


def newer(known: HeadReport | None, found: HeadReport) -> HeadReport:
    """Return the newer of two reports of a head; in the same plan it has come no less far."""
    if known is None:
        return found
    if found.seq <= known.seq:
        return known
    if (found.number, found.digest) == (known.number, known.digest):
        return replace(found, reached=max(known.reached, found.reached), off=known.off or found.off)
    return found
