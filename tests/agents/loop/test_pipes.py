"""The JSON lines between an agent and its launcher."""

from __future__ import annotations

import json
import os
import select
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from agents.agreeing.events import HeadFenced, Leave, PlanningEnded, PlanReleased, ProtocolEvent
from agents.loop.agent import Meet
from agents.loop.pipes import PipeFront, parse_command
from agents.networks.meeting import Meeting
from decmcts.errors import InputError


@pytest.fixture
def pipes() -> Iterator[tuple[PipeFront, int, int]]:
    """A front end, the descriptor that commands it and the one that hears it."""
    commands_out, commands_in = os.pipe()
    lines_out, lines_in = os.pipe()
    yield PipeFront(commands_out, lines_in), commands_in, lines_out
    for descriptor in (commands_out, lines_out, lines_in):
        os.close(descriptor)


@pytest.mark.parametrize(
    ("line", "event"),
    [
        (b'{"command": "fence", "head": 2, "epoch": 7}', HeadFenced(2, 7)),
        (b'{"command": "stop"}', PlanningEnded()),
        (b'{"command": "exit"}', Leave("done")),
        (b'{"command": "fence", "head": "2"}', None),
        (b'{"command": "dance"}', None),
        (b"[1]", None),
        (b"\\xff{", None),
        (b"", None),
    ],
)
def test_commands(line: bytes, event: ProtocolEvent | None) -> None:
    """A command that is not understood is not obeyed."""
    assert parse_command(line) == event


def test_a_command_in_two_pieces_is_one(pipes: tuple[PipeFront, int, int]) -> None:
    """Pipes keep bytes, not lines."""
    front, commands, _ = pipes
    os.write(commands, b'{"comm')
    assert front.commands() == []
    os.write(commands, b'and": "stop"}\n{"command": "exit"}\n')
    assert front.commands() == [PlanningEnded(), Leave("done")]
    os.close(commands)


def test_the_end_of_the_pipe_means_leave_once(pipes: tuple[PipeFront, int, int]) -> None:
    """An agent must not outlive its launcher."""
    front, commands, _ = pipes
    os.close(commands)
    assert front.commands() == [Leave("the launcher is gone")]
    assert front.commands() == []


def test_a_release_carries_the_plan(pipes: tuple[PipeFront, int, int]) -> None:
    """The launcher prints what the agents agreed on, so it must get all of it."""
    front, commands, lines = pipes
    front.notify(PlanReleased((0, 1), {1: np.int32([3, 4]), 0: np.int32([])}, 9.5, "ab" * 16))
    assert json.loads(os.read(lines, 4096)) == {
        "event": "released",
        "live": [0, 1],
        "digest": "ab" * 16,
        "makespan_s": 9.5,
        "plans": {"0": [], "1": [3, 4]},
    }
    os.close(commands)


def test_arguments_come_first_and_commands_behind_them(pipes: tuple[PipeFront, int, int]) -> None:
    """A launcher that is stopped early writes both at once."""
    front, commands_in, _ = pipes
    begin = json.dumps({"command": "begin", "arguments": ["--head", "1"]}).encode()
    os.write(commands_in, begin + b'\n{"command": "stop"}\n{"comm')
    assert front.arguments() == ["--head", "1"]
    assert front.commands() == [PlanningEnded()]
    os.write(commands_in, b'and": "exit"}\n')
    assert front.commands() == [Leave("done")]
    os.close(commands_in)


def test_where_to_meet_comes_with_the_arguments(pipes: tuple[PipeFront, int, int]) -> None:
    """Its secret stands on no command line and in no environment."""
    front, commands_in, _ = pipes
    meeting = Meeting(("tcp/127.0.0.1:7001", "unixsock-stream//tmp/x/1"), bytes(range(32)))
    told = {"command": "begin", "arguments": [], "meeting": meeting.to_dict()}
    moved = {"command": "meet", "places": ["tcp/127.0.0.1:7002"] * 2}
    os.write(commands_in, f"{json.dumps(told)}\n{json.dumps(moved)}\n".encode())
    assert front.arguments() == []
    assert front.meeting == meeting
    assert front.commands() == [Meet(("tcp/127.0.0.1:7002",) * 2)]
    os.close(commands_in)


@pytest.mark.parametrize("places", [["nowhere"], ["udp/127.0.0.1:7"], ["tcp/h:1?x"], [7], "tcp"])
def test_a_meeting_that_is_none_is_refused(
    places: object, pipes: tuple[PipeFront, int, int]
) -> None:
    """It would end as an error of zenoh's."""
    front, commands_in, _ = pipes
    told = {"places": places, "secret": "ab" * 32}
    line = json.dumps({"command": "begin", "arguments": [], "meeting": told})
    os.write(commands_in, line.encode() + b"\n")
    with pytest.raises(InputError, match="names no place to meet"):
        front.arguments()
    os.close(commands_in)


def test_a_pulse_goes_on_while_others_write(pipes: tuple[PipeFront, int, int]) -> None:
    """Lines of two threads must not mix."""
    front, commands_in, lines_out = pipes
    front.beat()
    front.shut("cannot listen")
    read = b""
    while read.count(b"\n") < 2:
        read += os.read(lines_out, 4096)
    lines = [json.loads(line) for line in read.splitlines()]
    assert sorted(line["event"] for line in lines) == ["pulse", "shut"]
    front._open = False
    os.close(commands_in)


@pytest.mark.parametrize("line", [b"", b'{"command": "exit"}\n', b'{"comma'])
def test_without_arguments_there_is_nothing_to_run(
    line: bytes, pipes: tuple[PipeFront, int, int]
) -> None:
    """A launcher that was refused before planning ends its agents or goes."""
    front, commands_in, _ = pipes
    os.write(commands_in, line)
    os.close(commands_in)
    assert front.arguments() is None


@pytest.mark.parametrize(
    "line", [b"garbage\n", b"[1]\n", b"--head 0\n", b'{"command": "begin"}\n', b"x" * 65536]
)
def test_a_first_line_that_is_no_arguments_is_refused(
    line: bytes, pipes: tuple[PipeFront, int, int]
) -> None:
    """Who starts an agent by hand would wait for a plan of one that ended as if all were well."""
    front, commands_in, _ = pipes
    os.write(commands_in, line)
    os.close(commands_in)
    with pytest.raises(InputError, match="the first line on stdin"):
        front.arguments()


def test_nothing_is_watched_where_pipes_cannot_be_asked(
    pipes: tuple[PipeFront, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows has no poll: the end of the pipe is met by who reads it."""
    front, commands_in, _ = pipes
    monkeypatch.delattr(select, "poll")
    before = threading.active_count()
    front.watch()
    assert threading.active_count() == before
    os.close(commands_in)
    assert front.arguments() is None
