"""The launcher's side of a witness: a process that tells which heads speak (`agents.witness`)."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.networks.meeting import Meeting

COMMAND = (sys.executable, "-P", "-m", "agents.witness", PIPED)
WITNESS = -1  # in the place of a head
MOST_S = 20.0  # after which one that says nothing is ended


class WitnessProcess:
    """Started anew whenever it is asked.

    Parameters
    ----------
    meeting : Meeting
        Of the heads, with a place for the witness behind theirs.
    epoch : int
        Of the run.
    hear : Callable
        Takes what it states, in a thread of its own.
    """

    def __init__(self, meeting: Meeting, epoch: int, hear: Callable[[AgentLine], None]) -> None:
        self._meeting, self._epoch, self._hear = meeting, epoch, hear
        self._process: AgentProcess | None = None
        self.is_asked = False
        self._until = -math.inf
        self.heard: tuple[int, ...] = ()

    def ask(self) -> None:
        """Have it listen for some seconds; what it hears comes as an `AgentLine` for `take`."""
        self.end()
        self.is_asked, self.heard = True, ()
        self._until = time.monotonic() + MOST_S
        self._process = AgentProcess(WITNESS, COMMAND, self._hear)
        heads = len(self._meeting.places) - 1
        self._process.begin(["--heads", str(heads), "--epoch", str(self._epoch)], self._meeting)

    @property
    def is_listening(self) -> bool:
        """Whether what it hears is still to come."""
        return self._process is not None and time.monotonic() < self._until

    def take(self, item: AgentLine) -> None:
        """Take what it states; once its output ends it listens no more."""
        match item.line:
            case None:
                self.end()
            case {"event": "heard", "heads": [*heads]}:
                self.heard = tuple(heads)

    def end(self) -> None:
        """End it if it runs."""
        process, self._process = self._process, None
        if process is not None:
            process.reap()
