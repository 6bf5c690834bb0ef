"""The launcher's side of a witness: a process that tells which heads speak (`agents.witness`)."""

from __future__ import annotations

import sys
from collections.abc import Callable

from agents.launching.processes import PIPED, AgentLine, AgentProcess
from agents.networks.meeting import Meeting

COMMAND = (sys.executable, "-P", "-m", "agents.witness", PIPED)
WITNESS = -1  # in the place of a head


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
        self.is_listening = False
        self.heard: tuple[int, ...] = ()

    def ask(self) -> None:
        """Have it listen for some seconds; what it hears comes as an `AgentLine` for `take`."""
        self.is_asked = self.is_listening = True
        self.heard = ()
        self._process = AgentProcess(WITNESS, COMMAND, self._hear)
        heads = len(self._meeting.places) - 1
        self._process.begin(["--heads", str(heads), "--epoch", str(self._epoch)], self._meeting)

    def take(self, item: AgentLine) -> None:
        """Take what it states; once its output ends it listens no more."""
        match item.line:
            case None:
                self.is_listening = False
                self.end()
            case {"event": "heard", "heads": [*heads]}:
                self.heard = tuple(heads)

    def end(self) -> None:
        """End it if it runs."""
        process, self._process = self._process, None
        if process is not None:
            process.reap()
