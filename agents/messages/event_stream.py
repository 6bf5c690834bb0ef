"""Events of a print to bytes and back: one schema, on the bus and in files.

A stream is a msgpack map that names format, version, plan and heads, and then one msgpack array
for each event (docs/events.md). Whatever bytes hold, reading returns valid events or raises
InputError, in bounded memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack

from agents.messages.kinds import MAX_HEADS
from agents.messages.rows import unpacker
from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_MM, LARGEST_SECONDS
from decmcts.formats.files.reading import read_bytes
from decmcts.print.print_events import EventKind, EventLog, PrintEvent

FORMAT, VERSION = "decmcts-events", 1
MOST_BYTES = 4096  # of one event
MOST_TEXT = 1024  # of a text in one
_MOST_COUNT = 2**31 - 1
_NAMES = {kind.value: kind for kind in EventKind}


def header(problem: str, heads: tuple[str, ...]) -> bytes:
    """Return what a stream begins with."""
    contents = {"format": FORMAT, "version": VERSION, "problem": problem, "heads": list(heads)}
    return bytes(msgpack.packb(contents))


def pack_event(event: PrintEvent) -> bytes:
    """Return the bytes of one event."""
    fields = [
        event.kind.value, event.head, event.time_s, event.action, event.point, list(event.at),
        event.by, event.line, event.what[:MOST_TEXT],
    ]  # fmt: skip
    return bytes(msgpack.packb(fields))


def unpack_event(payload: bytes) -> PrintEvent:
    """Return the event in a message of a peer; raises ValueError where there is none."""
    if len(payload) > MOST_BYTES:
        raise ValueError(f"{len(payload)} bytes are more than an event has")
    try:
        return event_of(_unpacked(_reader(payload)))
    except msgpack.OutOfData as error:
        raise ValueError("it breaks off") from error


def stream_of(log: EventLog) -> bytes:
    """Return a whole stream."""
    return b"".join([header(log.problem, log.heads), *map(pack_event, log.events)])


def read_events(path: Path) -> EventLog:
    """Read a stream; InputError when it cannot be read, or holds anything but events.

    One that breaks off within an event ends before it: whoever wrote it was stopped.
    """
    reader = _reader(read_bytes(path))
    try:
        problem, heads = _header(_unpacked(reader))
        events = tuple(_events(reader, len(heads)))
    except (ValueError, msgpack.OutOfData) as error:
        raise InputError(
            f"is no stream of events ({error})", path=path,
            advice="name what `--events` of `simulate` or `run` wrote",
        ) from error  # fmt: skip
    return EventLog(problem, heads, events)


def _events(reader: Any, heads: int) -> Iterator[PrintEvent]:
    while True:
        try:
            event = event_of(_unpacked(reader))
        except msgpack.OutOfData:
            return
        if not event.head < heads or not event.by < heads:
            raise ValueError(f"an event of head {max(event.head, event.by)} of {heads}")
        yield event


def _reader(content: bytes) -> Any:
    size = max(len(content), 1)
    reader = unpacker(size, items=max(MAX_HEADS, 16), text=4 * MOST_TEXT, pairs=8)
    reader.feed(content)
    return reader


def _unpacked(reader: Any) -> Any:
    """Return the next value; raises ValueError in words of ours where bytes are none."""
    try:
        return reader.unpack()
    except msgpack.OutOfData:
        raise
    except (ValueError, UnicodeDecodeError, msgpack.UnpackException) as error:
        raise ValueError("its bytes are no msgpack, or a value in it is too long") from error


def _header(found: Any) -> tuple[str, tuple[str, ...]]:
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise ValueError(f"it does not begin with format {FORMAT}")
    if found.get("version") != VERSION:
        raise ValueError(f"version {found.get('version')}; this program reads {VERSION}")
    problem, heads = found.get("problem"), found.get("heads")
    if not isinstance(problem, str) or not isinstance(heads, list) or not heads:
        raise ValueError("problem or heads are missing")
    if not all(isinstance(name, str) for name in heads):
        raise ValueError("heads are no names")
    return problem, tuple(heads)


def event_of(found: Any) -> PrintEvent:
    """Return the event that an array is; raises ValueError for anything else."""
    if not isinstance(found, list) or len(found) != 9:
        raise ValueError("an event has nine fields")
    kind, head, time_s, action, point, at, by, line, what = found
    if not isinstance(kind, str) or kind not in _NAMES:
        raise ValueError(f"kind {kind!r}")
    if not isinstance(at, list) or len(at) != 3 or not isinstance(what, str):
        raise ValueError("place or text")
    return PrintEvent(
        _NAMES[kind], _count(head, 0, MAX_HEADS - 1), _number(time_s, LARGEST_SECONDS),
        _count(action, -1, _MOST_COUNT), _count(point, 0, _MOST_COUNT),
        (_number(at[0], LARGEST_MM), _number(at[1], LARGEST_MM), _number(at[2], LARGEST_MM)),
        _count(by, -1, MAX_HEADS - 1), _count(line, 0, _MOST_COUNT), what,
    )  # fmt: skip


def _count(value: Any, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{value!r} is no whole number from {least} to {most}")
    return value


def _number(value: Any, most: float) -> float:
    if type(value) not in (int, float) or not math.isfinite(value) or abs(value) > most:
        raise ValueError(f"{value!r} is no number up to {most:g}")
    return float(value)
