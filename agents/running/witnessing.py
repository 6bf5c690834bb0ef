"""The launcher's side of a witness: a process that tells which heads speak (`agents.witness`)."""

from __future__ import annotations

import math
import sys
import time

from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.networks.meeting import Meeting

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

    Parameters
    ----------
    meeting : Meeting
        Of the heads, with a place for the witness behind theirs.
    epoch : int
        Of the run.
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
        self._process.begin(["--heads", str(heads), "--epoch", str(self._epoch)], self._meeting)

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
