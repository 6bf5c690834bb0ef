"""The two processes of each head while it prints: its controller, and its agent.

Controller and agent speak through two pipes. A third, the *record*, carries all a controller says
to the launcher too: so what happened is known whatever becomes of the agent. The launcher keeps the
ends of the agent's pipes, so that it can have the controller be off and start another agent.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
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

    Parameters
    ----------
    head : int
        Its place in the plan.
    controller : sequence of str
        The command of its controller; `--record` and a descriptor are added.
    receive : Callable
        Takes what both state, in threads of its own.
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
        with suppress(ProcessLookupError):
            os.kill(self.agent.pid, signal.SIGKILL)
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
