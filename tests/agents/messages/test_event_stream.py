"""Events survive the way to a file and back, and nothing else is taken for one."""

from __future__ import annotations

from pathlib import Path

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.messages.event_stream import (
    MOST_BYTES,
    header,
    pack_event,
    read_events,
    stream_of,
    unpack_event,
)
from decmcts.errors import InputError
from decmcts.print.print_events import EventKind, EventLog, PrintEvent

BEGAN = PrintEvent(EventKind.BEGAN, 0, 1.5, 7, 0, (1.0, 2.0, 0.2), line=12)
CLOGGED = PrintEvent(EventKind.FAILED, 1, 2.5, what="clogged")
LOG = EventLog("digest", ("left", "right"), (BEGAN, CLOGGED))


def written(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "events.msgpack"
    path.write_bytes(content)
    return path


def test_a_stream_reads_back_as_it_was(tmp_path):
    """Replanning starts from it."""
    assert read_events(written(tmp_path, stream_of(LOG))) == LOG


def test_a_stream_that_breaks_off_ends_before_the_broken_event(tmp_path):
    """Whoever wrote it may have been killed."""
    whole = stream_of(LOG)
    assert read_events(written(tmp_path, whole[:-3])).events == (BEGAN,)


@pytest.mark.parametrize(
    "content",
    [
        b"", b"G1 X1\n", msgpack.packb([1, 2]), msgpack.packb({"format": "decmcts-events"}),
        header("", ("left",)) + pack_event(CLOGGED),  # of a head that is not there
        header("", ("left",)) + msgpack.packb(["began", 0, 1e400, 0, 0, [0, 0, 0], -1, 0, ""]),
        header("", ("left",)) + msgpack.packb(["flew", 0, 1.0, 0, 0, [0, 0, 0], -1, 0, ""]),
        header("", ("left",)) + b"\xc1",
        b"\xdc\xff\xff",
        b"\xdb\xff\xff\xff\xff", b"\xa2\xff\xff", b"\xd4\x01\x00", bytes(range(256)),
    ],
)  # fmt: skip
def test_what_is_no_stream_is_refused_in_one_line(tmp_path, content):
    with pytest.raises(InputError, match=r"events\.msgpack: is no stream of events") as refused:
        read_events(written(tmp_path, content))
    theirs = ("Unpack", "max_", "codec", "ext_type", "exceeds")  # words of the library
    assert not any(word in str(refused.value) for word in theirs)


@given(st.binary(max_size=200))
def test_bytes_of_a_peer_are_an_event_or_a_value_error(payload):
    """A peer's message never ends an agent."""
    try:
        event = unpack_event(payload)
    except ValueError:
        return
    assert unpack_event(pack_event(event)) == event


def test_messages_longer_than_an_event_are_not_even_unpacked():
    with pytest.raises(ValueError, match="more than an event"):
        unpack_event(b"\x99" * (MOST_BYTES + 1))
