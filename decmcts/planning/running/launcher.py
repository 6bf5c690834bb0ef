"""Carries a plan out: starts the heads' processes, hears what happens, and knows the end.

What happens between heads is theirs: they tell each other over zenoh what has happened, and wait
for it. The launcher hears all controllers, and acts only where a head fails (`failing`), the rest
is to be planned anew (`renewing`), or a person asks (`Asking`).
"""

from __future__ import annotations

import math
import queue
import secrets
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from agents.launching.places import Places
from agents.launching.processes import AgentLine
from agents.launching.spawn import SECRET_BYTES
from agents.networks.meeting import Meeting
from agents.running.heads import HeadProcesses, Recorded, WitnessProcess
from agents.running.port import ABORTED, Abort, Ready
from decmcts.errors import InputError
from decmcts.planning.events import Note, Report, unheard
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.fenced import PARKED, stated_place
from decmcts.planning.running.failing import FENCED, Failing
from decmcts.planning.running.recorded import SEEN_MM, Carried, Keep, unkept
from decmcts.planning.running.renewing import News, NotRenewed, Parking, Renewal, Renewed
from decmcts.planning.running.team import RunOptions, Show, Team, unseen, view_of
from decmcts.print.machine import Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind, PrintEvent

CONTROLLER = (sys.executable, "-P", "-m", "sim.controllers.serve")
START_S = 60.0  # that all processes may take to start
QUIET_S = 2.0  # without an event, when nobody can be asked any more
SHOWN_S = 0.25
POLL_S = 0.02


@dataclass(slots=True)
class Launcher:
    """One run. `asked` is where a person's lines arrive, None when no more will."""

    document: PlanDocument
    source: Source | None
    options: RunOptions
    folder: Path
    asked: queue.Queue[str | None]
    report: Report = unheard
    show: Show = unseen
    on_start: Callable[[Mapping[str, tuple[int, int]]], None] = lambda _pids: None
    keep: Keep = unkept
    received: queue.Queue[AgentLine | Recorded | News] = field(default_factory=queue.Queue)
    team: Team = field(init=False)
    renewal: Renewal = field(init=False)
    failing: Failing = field(init=False)
    asking: Asking = field(init=False)
    _is_ending: bool = False
    _event_at: float = 0.0
    _shown_at: float = 0.0

    def __post_init__(self) -> None:
        sources = {} if self.source is None else {0: self.source}
        self.team = Team(self.document, self.folder, self.report)
        self.renewal = Renewal(self.team, self.options, self.received.put, sources)
        self.failing = Failing(self.team, self.renewal)
        self.asking = Asking(self.team, self.failing, self.asked)

    def run(self) -> None:
        """Carry the plan out to its end."""
        processes = self.team.processes
        with Places(len(self.team.heads) + 1) as places:  # and one for a witness
            try:
                self._spawn(places)
                self._start()
                while not self.is_over():
                    self.step()
            finally:
                self._is_ending = True
                for one in processes:
                    one.agent.send({"command": "exit"})
                for one in processes:
                    one.end()
                if self.team.witness is not None:
                    self.team.witness.end()
                self._receive(0.0)
                self.keep(self.team.prints())

    def _spawn(self, places: Places) -> None:
        """Start two processes a head; a head alone needs no place to meet others."""
        given, clock_path, n = self.options, self.team.clock_path, len(self.team.heads)
        epoch, meeting = time.time_ns() // 1_000_000, None
        if n > 1:
            all_places, secret = places.fresh(), secrets.token_bytes(SECRET_BYTES)
            meeting = Meeting(all_places[:n], secret)
            self.team.witness = WitnessProcess(Meeting(all_places, secret), epoch)
        for h, head in enumerate(self.team.heads):
            command = [*CONTROLLER, "--name", head.name, "--head", str(h), "--clock",
                       str(clock_path), "--timing", given.timing.value, "--error",
                       str(given.error), "--seed", str(given.seed), "--queue",
                       str(given.queue)]  # fmt: skip
            self.team.processes.append(HeadProcesses(h, command, self.received.put))
        more = ["--loss", str(given.loss), "--delay", str(given.delay_s / given.speed),
                "--seed", str(given.seed)]  # fmt: skip
        for one in self.team.processes:
            one.begin(epoch, clock_path, meeting, more)

    def _start(self) -> None:
        """Hand out the plan, and let time begin when all heads hold it."""
        heads = self.team.heads
        self.team.announce(self.document, is_print=True)
        until = time.monotonic() + START_S
        while not all(head.number == 0 for head in heads):
            if time.monotonic() > until or any(h.agent_gone or h.controller_gone for h in heads):
                ended = [(h.name, h.agent_gone or h.controller_gone) for h in heads]
                gone = [f"{name} ({why})" for name, why in ended if why]
                gone = gone or [h.name for h in heads if h.number < 0]
                raise InputError(f"the processes of {', '.join(gone)} did not start")
            self._receive()
        self.on_start(
            {head.name: (one.agent.pid, one.controller_pid)
             for head, one in zip(heads, self.team.processes, strict=True)}
        )  # fmt: skip
        self._event_at = time.monotonic()

    def step(self) -> None:
        """Take in what happened, and act where a head fails or a person asks."""
        self._receive()
        self._keep_pace()
        self.asking.obey()
        self.failing.find()
        self.renewal.step()
        self.keep(self.team.prints())
        now = time.monotonic()
        if now - self._shown_at > SHOWN_S:
            self._shown_at = now
            self.show(view_of(self.team.heads, self.team.plans, self.team.clock.now()))

    def _keep_pace(self) -> None:
        """Let time pass as in the world while heads are planned for, and take up what is planned.

        A faster clock would count the seconds of this computer many times.
        """
        team, last = self.team, self.team.plans[-1]
        is_new = last.number > 0 and not last.is_void
        takes_up = is_new and all(team.has_done(h, last.number) for h in team.living())
        begun = last.begun or not last.is_print
        real = self.renewal.is_busy or (takes_up and not begun)
        pace = min(1.0, self.options.speed) if real else self.options.speed
        if pace != team.clock.pace:
            team.clock.set_pace(pace)

    # What is heard ----------------------------------------------------------

    def _receive(self, timeout_s: float = POLL_S) -> None:
        """Take all that has arrived, waiting for the first."""
        try:
            self.take(self.received.get(timeout=timeout_s))
            while True:
                self.take(self.received.get_nowait())
        except queue.Empty:
            return

    def take(self, item: AgentLine | Recorded | News) -> None:
        """Take what a controller, an agent or the thread that plans states."""
        match item:
            case Recorded() if self._is_ending and isinstance(item.statement, PrintEvent | None):
                if item.statement is not None and item.statement.kind is not EventKind.FAILED:
                    self._take_record(item)
            case Recorded():
                self._take_record(item)
            case AgentLine():
                self._take_agent(item)
            case Parking() | Renewed() | NotRenewed():
                self.renewal.take(item)

    def _take_record(self, item: Recorded) -> None:
        head = self.team.heads[item.head]
        head.heard_at = time.monotonic()
        match item.statement:
            case None:
                head.controller_gone = head.controller_gone or "its controller ended"
            case Ready(number, _):
                head.number = number
            case PrintEvent() as event if head.number >= 0:
                self._take_event(item.head, event)

    def _take_event(self, h: int, event: PrintEvent) -> None:
        team, failure = self.team, self.team.heads[h].failure
        carried = team.plans[team.heads[h].number]
        if not self.failing.reported_off(h):  # it says so once more when it is aborted
            carried.take(h, replace(event, head=carried.heads.index(h)))
        if failure is not None and not carried.is_print and team.has_done(h):
            failure.at = team.park(h)
        self._event_at = time.monotonic()
        if event.kind is EventKind.FAILED:
            self.failing.fail(h, event.what)
            self.failing.fence(h, event.at, event.what)
        elif event.kind is EventKind.BEGAN:
            self._goes_on(carried, event.time_s)

    def _goes_on(self, carried: Carried, time_s: float) -> None:
        """Note when heads began the rest that was planned behind failures."""
        plans = self.team.plans
        is_rest = carried.is_print and carried.number == len(plans) - 1
        for failure in self.team.failures:
            if not math.isnan(failure.planned_s) and math.isnan(failure.on_s) and is_rest:
                ended = [e.time_s for p in plans[:-1] for e in p.events
                         if e.kind is EventKind.ENDED]  # fmt: skip
                failure.on_s = time_s
                failure.stood_s = max(0.0, time_s - max(ended, default=time_s))

    def _take_agent(self, item: AgentLine) -> None:
        head = self.team.heads[item.head]
        head.pulse_at = time.monotonic()
        match item.line:
            case None if self._is_ending:
                pass
            case None if head.replaced:
                head.replaced = False  # another has taken its place
            case None:
                process = self.team.processes[item.head].agent
                head.agent_gone = process.ending() or "its agent ended"
            case {"event": "stands"} as line:
                head.waits_for, head.missing = line["waits_for"], tuple(line["missing"])
            case {"event": "held", "count": count, "number": number, "released": released}:
                self.renewal.take_held(item.head, count, number, released)
            case {"event": "controller", "how": how}:
                head.controller_gone = head.controller_gone or f"its controller {how}"

    # The end ----------------------------------------------------------------

    def is_over(self) -> bool:
        """Tell whether nothing more happens, and nobody can be asked."""
        team, asking, renewal = self.team, self.asking, self.renewal
        if renewal.is_busy:
            return False
        living, lost = team.living(), team.lost()
        if not living:
            return True
        if renewal.unplanned and not lost:
            return False
        if all(map(team.has_done, living)) and not lost:
            return not (renewal.reason and asking.is_open and not asking.aborted)
        if asking.is_open or not (lost or team.paused()):
            return False
        quiet = time.monotonic() - self._event_at > QUIET_S
        return quiet and all(map(team.stands, team.listening()))


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
        """Do what a person asks; raises InputError if it is nothing that can be done."""
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
        _, place = stated_place(f"{name}={text}", self.team.document.machine)
        assert place is not None  # it is named
        return place
