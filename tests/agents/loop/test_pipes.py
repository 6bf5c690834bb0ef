"""The JSON lines between an agent and its launcher."""

from __future__ import annotations

import json
import os
import select
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from agents.agreeing.events import Event, Fenced, Leave, PlanningEnded, Release
from agents.loop.pipes import PipeFront, parse_command
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
        (b'{"command": "fence", "head": 2, "epoch": 7}', Fenced(2, 7)),
        (b'{"command": "stop"}', PlanningEnded()),
        (b'{"command": "exit"}', Leave("done")),
        (b'{"command": "fence", "head": "2"}', None),
        (b'{"command": "dance"}', None),
        (b"[1]", None),
        (b"\\xff{", None),
        (b"", None),
    ],
)
def test_commands(line: bytes, event: Event | None) -> None:
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
    front.tell(Release((0, 1), {1: np.int32([3, 4]), 0: np.int32([])}, 9.5, "ab" * 16))
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
