"""What a person may ask of a run: pause, resume, abort, and that a head is fenced."""

from __future__ import annotations

import queue
from dataclasses import dataclass

from agents.running.port import ABORTED, Abort
from decmcts.errors import InputError
from decmcts.planning.events import Note
from decmcts.planning.replanning.fenced import PARKED, stated_place
from decmcts.planning.running.failing import FENCED, Failing
from decmcts.planning.running.recorded import SEEN_MM
from decmcts.planning.running.team import Team
from decmcts.print.machine import Point


@dataclass(slots=True)
class Asking:
    """Does what people ask; `asked` is where their lines arrive, None when no more will."""

    team: Team
    failing: Failing
    asked: queue.Queue[str | None]
    is_open: bool = True  # more may be asked
    aborted: bool = False

    def obey(self) -> None:
        """Do what was asked since the last call; report what cannot be done."""
        while True:
            try:
                line = self.asked.get_nowait()
            except queue.Empty:
                return
            if line is None:
                self._end()
                continue
            try:
                self.do(line.split())
            except InputError as error:
                self.team.report(Note(f"{line.strip()}: {error}"))

    def _end(self) -> None:
        """Take that nobody can be asked any more; say whom nobody can have go on."""
        self.is_open = False
        if names := self.team.paused():
            self.team.report(Note(
                f"standard input has ended, so nobody can resume {', '.join(names)}: the run ends "
                "when all is done that needs nothing of them"
            ))  # fmt: skip

    def do(self, words: list[str]) -> None:
        """Do what a person asks.

        Raises
        ------
        InputError
            If it is nothing that can be done.
        """
        match words:
            case []:
                return
            case [("pause" | "resume" | "abort") as word]:
                self.aborted |= word == "abort"
                for h in range(len(self.team.heads)):
                    self._ask(h, word)
            case [("pause" | "resume" | "abort") as word, name]:
                h = self._named(name)
                if not self._ask(h, word):
                    raise InputError(f"{name} is off, or its controller is: it hears nothing")
            case ["fenced", name, place]:
                self._fenced(self._named(name), place, None if place == PARKED else place)
            case ["fenced", name, "park" as place, stopped]:
                self._fenced(self._named(name), place, stopped)
            case _:
                raise InputError(
                    "unknown", advice="say pause, resume or abort, with a head or for all, or "
                    "fenced HEAD park, or fenced HEAD X,Y,Z, or fenced HEAD park X,Y,Z",
                )  # fmt: skip

    def _ask(self, h: int, word: str) -> bool:
        """Ask a head something; False if it hears nothing any more."""
        team, head = self.team, self.team.heads[h]
        if head.controller_gone or (head.fenced and not head.parks):
            return False
        if word == "abort":  # its agent may hang
            team.processes[h].send_to_controller(Abort(ABORTED))
            return True
        head.paused = word == "pause"  # another agent, that takes it to its park, is told it too
        if h in team.listening():
            team.send(h, command=word)
        return True

    def _named(self, name: str) -> int:
        names = [head.name for head in self.team.heads]
        if name not in names:
            raise InputError(f"no head {name}", advice=f"heads are {', '.join(names)}")
        return names.index(name)

    def _fenced(self, h: int, place: str, stopped: str | None) -> None:
        """Take a person's word that a head is off, where it stands, and where it had stopped."""
        team, head, renewal = self.team, self.team.heads[h], self.failing.renewal
        if head.fenced and not renewal.reason:
            raise InputError(f"the rest is planned around {head.name}: leave it where it stands")
        at = self._place(head.name, place)
        stopped_at = None if stopped is None else self._place(head.name, stopped)
        self.failing.fail(h, FENCED)
        begun = [carried for carried in team.plans if h in carried.heads and carried.last(h)]
        since = head.failure
        if begun and stopped_at and since and not begun[-1].stop(h, stopped_at, since.noticed_s):
            team.report(Note(
                f"{head.name}: that is more than {SEEN_MM:g} mm from where it may have stopped; "
                "what the bead it was at lacks stays unknown"
            ))  # fmt: skip
        self.failing.fence(h, at, FENCED)
        team.moved[h] = (team.clock.now(), at)
        renewal.reason = ""

    def _place(self, name: str, text: str) -> Point:
        """Return a place that a person names for a head."""
        _, place = stated_place(f"{name}={text}", self.team.document.machine)
        assert place is not None  # it is named
        return place
