"""The two processes of each head while it prints: its controller, and its agent.

Controller and agent speak through two pipes. A third, the *record*, carries all a controller says
to the launcher too: so what happened is known whatever becomes of the agent. The launcher keeps the
ends of the agent's pipes, so that it can have the controller be off and start another agent.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.networks.meeting import Meeting
from agents.running.port import Abort, Finish, Pipe, Statement, pack, write_all

RUNNER = (sys.executable, "-P", "-m", "agents.runner", PIPED)
_END_S = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """What a controller stated, None when its record ended."""

    head: int
    statement: Statement | None


class HeadProcesses:
    """The processes of one head.

    `controller` is a command, to which `--record` and a descriptor are added. `receive` takes what
    both state, in threads of its own.
    """

    def __init__(
        self, head: int, controller: Sequence[str], receive: Callable[[AgentLine | Recorded], None]
    ) -> None:
        self.head = head
        asks, to = os.pipe()
        of, answers = os.pipe()
        record, keeps = os.pipe()
        self._controller = subprocess.Popen(
            [*controller, "--record", str(keeps)], stdin=asks, stdout=answers, pass_fds=[keeps],
            start_new_session=True,
        )  # fmt: skip
        self._ends, self._receive = (to, of), receive
        self._start_agent()
        for descriptor in (asks, answers, keeps):
            os.close(descriptor)
        self._reader = threading.Thread(target=self._read, args=(record,), daemon=True)
        self._reader.start()

    def _start_agent(self) -> None:
        self.agent = AgentProcess(self.head, RUNNER, self._receive, inherits=self._ends)

    def restart(self) -> None:
        """Start another agent in the place of one that is gone, or is ended here."""
        self.agent.kill()
        self.agent.reap()
        self._start_agent()
        self.agent.begin(*self._begun)

    def send_to_controller(self, command: Finish | Abort) -> None:
        """Have the controller be off, whatever becomes of its agent."""
        write_all(self._ends[0], pack(command))

    @property
    def controller_pid(self) -> int:
        """Process id of the controller."""
        return self._controller.pid

    def begin(self, epoch: int, clock: Path, meeting: Meeting | None, more: Sequence[str]) -> None:
        """Hand its arguments to the agent."""
        to, of = map(str, self._ends)
        words = ["--head", str(self.head), "--epoch", str(epoch), "--clock", str(clock)]
        self._begun = [*words, "--to", to, "--of", of, *more], meeting
        self.agent.begin(*self._begun)

    def kill(self) -> None:
        """End both for sure: after this the head does nothing any more. Waits for neither."""
        self._controller.kill()
        with suppress(ProcessLookupError):
            os.kill(self.agent.pid, signal.SIGKILL)

    def end(self) -> None:
        """End both in order, the controller when its agent is gone."""
        self.agent.send({"command": "exit"})
        self.agent.reap()
        for descriptor in self._ends:
            os.close(descriptor)
        with suppress(subprocess.TimeoutExpired):
            self._controller.wait(_END_S)
        self._controller.kill()
        self._controller.wait()
        self._reader.join(_END_S)

    def _read(self, record: int) -> None:
        pipe = Pipe(record)
        while pipe.open:
            for statement in pipe.statements():
                self._receive(Recorded(self.head, statement))
        os.close(record)
        self._receive(Recorded(self.head, None))


COMMAND = (sys.executable, "-P", "-m", "agents.witness", PIPED)
WITNESS = -1  # in the place of a head
MOST_S = 20.0  # after which one that says nothing is given up


class _Stated:
    """What one process states, taken in a thread of its own."""

    def __init__(self) -> None:
        self.heads: tuple[int, ...] = ()
        self.is_over = False

    def take(self, item: AgentLine) -> None:
        match item.line:
            case None:
                self.is_over = True
            case {"event": "heard", "heads": [*heads]}:
                self.heads = tuple(heads)


class WitnessProcess:
    """Started anew whenever it is asked. What an earlier process states late counts for nothing.

    The `meeting` has a place for it behind those of the heads.
    """

    def __init__(self, meeting: Meeting, epoch: int) -> None:
        self._meeting, self._epoch = meeting, epoch
        self._process: AgentProcess | None = None
        self._stated = _Stated()
        self._until = -math.inf
        self.is_asked = False

    def ask(self) -> None:
        """Have it listen for some seconds."""
        self.end()
        self.is_asked, self._stated = True, _Stated()
        self._until = time.monotonic() + MOST_S
        self._process = AgentProcess(WITNESS, COMMAND, self._stated.take)
        heads = len(self._meeting.places) - 1
        self._process.begin([str(heads), str(self._epoch)], self._meeting)

    @property
    def is_listening(self) -> bool:
        """Whether what it hears is still to come."""
        return not self._stated.is_over and time.monotonic() < self._until

    @property
    def heard(self) -> tuple[int, ...]:
        """Which heads it heard when it was asked last."""
        return self._stated.heads

    def end(self) -> None:
        """End it if it runs: at once, as nobody waits for what it would say."""
        self.is_asked = False
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.reap()
