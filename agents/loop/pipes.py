"""The agent's side of the pipes to its launcher: JSON lines both ways.

Out (stdout): `ready`, `progress`, `note`, `refused`, `unfenced`, `released`,
`left`, `shut` (nobody can listen at its place). In (stdin): `{"command": "fence", "head": n,
"epoch": e}`, `{"command": "stop"}` (agree on the best so far), `{"command": "meet", "places":
[...]}` (meet elsewhere), `{"command": "exit"}`. The end of stdin means the launcher is gone:
the agent leaves, so no orphan plans on.

A launcher may start agents before there is a problem. Such an agent is handed its command
line as a first line, `{"command": "begin", "arguments": [...], "meeting": {...}}`. Until it is
ready a thread watches the pipe, and ends the process with its launcher.
"""

from __future__ import annotations

import json
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from agents.agreeing import events
from agents.loop.agent import AgentProgress, FrontEnd, Meet
from agents.networks.meeting import Meeting, checked_places
from agents.networks.transport import Traffic
from decmcts.errors import InputError
from decmcts.formats.files.names import harmless

_NAMES: dict[type[events.Notice], str] = {
    events.LogNote: "note", events.Refused: "refused", events.Unfenced: "unfenced",
    events.PlanReleased: "released", events.Left: "left",
}  # fmt: skip
_MAX_LINE = 65536
_WATCH_MS = 100
PULSE_S = 0.5
LEAVE_S = 3.0  # so long an agent has to take leave after its launcher is gone, whatever it computes


class PipeFront(FrontEnd):
    """A front end over file descriptors."""

    def __init__(
        self, read_fd: int = 0, write_fd: int = 1, parse: Callable[[bytes], Any] | None = None
    ) -> None:
        super().__init__()
        self._read_fd, self._write_fd = read_fd, write_fd
        self._parse = parse_command if parse is None else parse  # of lines of another launcher
        self._rest = b""
        self._open = True
        self._is_ready = threading.Event()
        self._writing = threading.Lock()
        self.sweep: Callable[[], None] = lambda: None  # before the process ends itself
        self.meeting: Meeting | None = None  # where a launcher has us meet the others

    def watch(self) -> None:
        """End the process after its launcher, whatever it does.

        Importing, reading and building look at no pipe for seconds, and neither does a round:
        so a thread looks. Until `ready` no peer knows the agent, and it need not say goodbye.
        Where pipes cannot be asked without being read (Windows), it finds out when it next
        reads them.
        """
        if hasattr(select, "poll"):
            threading.Thread(target=self._end_with_launcher, name="launcher", daemon=True).start()

    def beat(self) -> None:
        """Say all the time that this process runs: in a long round it does, stopped not."""
        threading.Thread(target=self._beat, name="pulse", daemon=True).start()

    def _beat(self) -> None:
        while self._open:
            self.write({"event": "pulse"})
            time.sleep(PULSE_S)

    def _end_with_launcher(self) -> None:
        pipe = select.poll()
        pipe.register(self._read_fd, 0)  # what is written is not read: only hang-ups are told
        while not pipe.poll(_WATCH_MS):
            pass
        if self._is_ready.is_set():
            time.sleep(LEAVE_S)
        self.sweep()
        os._exit(0)

    def arguments(self) -> list[str] | None:
        """Wait for the launcher to hand over this agent's command line; None: it ends us.

        InputError if the first line is anything else, or names no place to meet.
        """
        while b"\n" not in self._rest and len(self._rest) < _MAX_LINE:
            chunk = os.read(self._read_fd, _MAX_LINE)
            if not chunk:
                return None
            self._rest += chunk
        line, _, self._rest = self._rest.partition(b"\n")
        self._take(b"")
        match any_command(line):
            case {"command": "exit"}:
                return None
            case {"command": "begin", "arguments": [*words], **more}:
                if "meeting" in more:
                    self.meeting = Meeting.from_dict(more["meeting"])
                return [str(word) for word in words]
        raise InputError(
            "the first line on stdin hands over no arguments",
            advice='write {"command": "begin", "arguments": [...]}',
        )

    def commands(self) -> list[events.ProtocolEvent | Meet]:
        """Return what the launcher or a signal asked since the last call."""
        # select + os.read instead of a reader thread: a thread blocked in a
        # buffered read aborts the interpreter's shutdown.
        while self._open and select.select([self._read_fd], [], [], 0)[0]:
            chunk = os.read(self._read_fd, _MAX_LINE)
            if not chunk:
                self._open = False
                self.ask(events.Leave("the launcher is gone"))
            self._take(chunk)
        return super().commands()

    def shut(self, reason: str) -> None:
        """Say that we cannot meet the others where we were told to."""
        self.write({"event": "shut", "reason": reason})

    def _take(self, chunk: bytes) -> None:
        """Take the commands of all lines that are complete."""
        *lines, self._rest = (self._rest + chunk).split(b"\n")
        self.asked += [event for line in lines if (event := self._parse(line))]

    def ready(self, problem: str) -> None:
        """Say that the problem is loaded and the network open."""
        self._is_ready.set()
        self.write({"event": "ready", "problem": problem})

    def progress(self, progress: AgentProgress, traffic: Traffic) -> None:
        """Say where the agent stands."""
        self.write({"event": "progress", **asdict(progress), "traffic": traffic.counts()})

    def notify(self, effect: events.Notice) -> None:
        """Say one event."""
        self.write(line_of(effect))

    def write(self, line: dict[str, Any]) -> None:
        """Write one JSON line."""
        view = memoryview(json.dumps(line).encode() + b"\n")
        try:
            with self._writing:
                while view:
                    view = view[os.write(self._write_fd, view) :]
        except BrokenPipeError:
            self._open = False
            self.ask(events.Leave("the launcher is gone"))


class TerminalFront(FrontEnd):
    """A front end for a person who runs one agent by hand: a log without progress."""

    def ready(self, problem: str) -> None:
        """Say that the agent is up."""
        print(f"problem {problem[:12]} loaded", file=sys.stderr)

    def notify(self, effect: events.Notice) -> None:
        """Print one line."""
        match effect:
            case events.LogNote(text):
                line = text
            case events.Refused(_, reason):
                line = f"refused: {reason}"
            case events.Unfenced(heads):
                line = f"agreed, but heads {list(heads)} are neither here nor fenced: not released"
            case events.PlanReleased():
                line = f"released plan {effect.digest}, makespan {effect.makespan_s:.1f} s"
            case events.Left(reason):
                line = f"left: {reason}"
        print(harmless(line), file=sys.stderr)


def any_command(line: bytes) -> dict[str, Any] | None:
    """Return a line as it is, a mapping; None for anything else."""
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def parse_command(line: bytes) -> events.ProtocolEvent | Meet | None:
    """Return the event a command line stands for, None for anything else."""
    match any_command(line):
        case {"command": "fence", "head": int(head), "epoch": int(epoch)}:
            return events.HeadFenced(head, epoch)
        case {"command": "meet", "places": [*places]}:
            with suppress(ValueError):
                return Meet(checked_places(places))
        case {"command": "stop"}:
            return events.PlanningEnded()
        case {"command": "exit"}:
            return events.Leave("done")
    return None


def line_of(effect: events.Notice) -> dict[str, Any]:
    """Return an event as a JSON object: its name, and its fields."""
    line = {name: _plain(getattr(effect, name)) for name in effect.__dataclass_fields__}
    return {"event": _NAMES[type(effect)], **line}


def _plain(value: Any) -> Any:
    """Return a field as JSON has it."""
    if isinstance(value, Mapping):
        return {str(head): value[head].tolist() for head in sorted(value)}
    return list(value) if isinstance(value, tuple) else value
