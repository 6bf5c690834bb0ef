"""Carries a plan out: starts the heads' processes, fences heads that fail, has the rest planned.

What happens between heads is theirs: they tell each other over zenoh what has happened, and wait
for it. The launcher hears all controllers, and acts only where a head fails, or a person asks.

A head that fails is *lost* until it is *fenced*: by its controller's word, or a person's. Then all
others hold, the launcher says how far each goes on with what every plan contains, and the rest is
planned meanwhile.
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
from agents.launching.processes import Said as AgentSaid
from agents.launching.spawn import SECRET_BYTES
from agents.networks.meeting import Meeting
from agents.running.carrier import committed
from agents.running.clock import PrintClock
from agents.running.heads import HeadProcesses, Recorded
from agents.running.port import ABORTED, SILENT, SILENT_S, Ready
from agents.running.report import Reached
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.events import Note, Report, unheard
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.fenced import PARKED, fenced_places
from decmcts.planning.running.options import (
    Failure,
    RunOptions,
    Show,
    unseen,
)
from decmcts.planning.running.parking import same_place
from decmcts.planning.running.recorded import SEEN_MM, Carried
from decmcts.planning.running.renewing import Begin, News, NotRenewed, Parking, Renewed, renew
from decmcts.planning.running.standing import Standing, view_of
from decmcts.print.figures import clock_time
from decmcts.print.machine import Point
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, PrintEvent
from decmcts.print.print_state import PrintState, state_of_heads

CONTROLLER = (sys.executable, "-P", "-m", "sim.controllers.serve")
START_S = 60.0  # that all processes may take to start
MORE_S = 30.0  # nominal seconds that heads go on for, besides those of the search
QUIET_S = 2.0  # without an event, when nobody can be asked any more
SHOWN_S = 0.25
WAITING = 1e-6  # pace of the clock until all heads are there
AGENT, BUS = "its agent was lost", "it lost the bus"
PERSON = (
    "say `fenced {name} X,Y,Z` once it is sure to be off, or `fenced {name} park X,Y,Z` if you "
    "have put it to its park: X,Y,Z is where it had stopped"
)


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
    heard: queue.Queue[AgentSaid | Recorded | News] = field(default_factory=queue.Queue)
    plans: list[Carried] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    moved: dict[int, tuple[float, Point]] = field(default_factory=dict)
    left: list[str] = field(default_factory=list)  # what is not finished, in words
    left_out: int = 0  # contours that no living head could finish
    reason: str = ""  # why the rest is not planned
    aborted: bool = False
    heads: list[Standing] = field(default_factory=list)
    processes: list[HeadProcesses] = field(default_factory=list)
    clock: PrintClock = field(init=False)
    _held: dict[int, tuple[int, int]] = field(default_factory=dict)
    _holding: bool = False
    _planning: int = 0  # token of the plan that is being made; 0: none
    _token: int = 0
    _unplanned: set[int] = field(default_factory=set)  # fenced, and no plan is without them yet
    _is_asked: bool = True
    _is_ending: bool = False
    _event_at: float = 0.0
    _shown_at: float = 0.0
    _begin: Begin | None = None
    _sources: dict[int, Source] = field(default_factory=dict)

    def run(self) -> None:
        """Carry the plan out to its end."""
        names = [head.head for head in self.document.plan.heads]
        self.heads = [Standing(name) for name in names]
        clock_path = self.folder / "clock"
        self.clock = PrintClock.made(clock_path, WAITING)
        n, given = len(names), self.options
        with Places(n) as places:
            meeting = Meeting(places.fresh(), secrets.token_bytes(SECRET_BYTES)) if n > 1 else None
            epoch = time.time_ns() // 1_000_000
            more = ["--loss", str(given.loss), "--delay", str(given.delay_s / given.speed),
                    "--seed", str(given.seed)]  # fmt: skip
            try:
                for h, name in enumerate(names):
                    command = [*CONTROLLER, "--name", name, "--head", str(h), "--clock",
                               str(clock_path), "--timing", given.timing.value, "--error",
                               str(given.error), "--seed", str(given.seed), "--queue",
                               str(given.queue)]  # fmt: skip
                    self.processes.append(HeadProcesses(h, command, self.heard))  # type: ignore[arg-type] # it takes News besides
                for one in self.processes:
                    one.begin(epoch, clock_path, meeting, more)
                self._start()
                while not self._is_over():
                    self._step()
            finally:
                self._is_ending = True
                for one in self.processes:
                    one.agent.tell({"command": "exit"})
                for one in self.processes:
                    one.end()
                self._drain()

    def _start(self) -> None:
        """Hand out the plan, and let time begin when all heads hold it."""
        if self.source is not None:
            self._sources[0] = self.source
        self._announce(self.document, is_print=True)
        until = time.monotonic() + START_S
        while not all(head.number == 0 for head in self.heads):
            if time.monotonic() > until or any(
                h.agent_gone or h.controller_gone for h in self.heads
            ):
                gone = [h.name for h in self.heads if h.number < 0]
                why = next((h.agent_gone for h in self.heads if h.agent_gone), "")
                raise InputError(f"the processes of {', '.join(gone)} did not start {why}".strip())
            self._hear()
        self.on_start(
            {p.name: (one.agent.pid, one.controller_pid)
             for p, one in zip(self.heads, self.processes, strict=True)}
        )  # fmt: skip
        self._event_at = time.monotonic()

    def _announce(self, document: PlanDocument, *, is_print: bool) -> Carried:
        """Hand a plan to all heads that live; they begin it when all of them hold it."""
        number = len(self.plans)
        path = self.folder / f"plan-{number}.json"
        write_plan(document, path)
        names = [head.name for head in self.heads]
        heads = tuple(names.index(actions.head) for actions in document.plan.heads)
        self.plans.append(Carried(number, read_plan(path), heads, is_print))
        for h in self._told():
            self._tell(h, command="plan", number=number, path=str(path), heads=list(heads))
        return self.plans[-1]

    def _tell(self, head: int, /, **command: object) -> None:
        self.processes[head].agent.tell(command)

    def _living(self) -> list[int]:
        """Return the heads that work."""
        return [h for h, head in enumerate(self.heads) if head.failure is None]

    def _told(self) -> list[int]:
        """Return the heads whose agents are told of plans: those that work, or go to their park."""
        return [h for h, head in enumerate(self.heads) if head.failure is None or head.parks]

    def _lost(self) -> list[int]:
        """Return the heads that failed and are not fenced."""
        return [h for h, head in enumerate(self.heads) if head.failure and not head.fenced]

    # What is heard ----------------------------------------------------------

    def _step(self) -> None:
        self._hear()
        self._keep_pace()
        self._obey()
        self._find_failures()
        self._settle_missing()
        if self._unplanned and not self._lost() and not self._holding and not self._planning:
            self._hold()
        if self._holding and all(h in self._held for h in self._told()):
            self._divide()
        now = time.monotonic()
        if now - self._shown_at > SHOWN_S:
            self._shown_at = now
            self.show(view_of(self.heads, self.plans, self.clock.now()))

    def _keep_pace(self) -> None:
        """Let time pass as in the world while heads are planned for, and take up what is planned.

        A faster clock would count the seconds of this computer many times.
        """
        takes_up = len(self.plans) > 1 and all(
            self._has_done(h, before=len(self.plans) - 1) for h in self._living()
        )
        begun = self.plans[-1].events or not self.plans[-1].is_print
        real = self._planning or self._holding or (takes_up and not begun)
        pace = min(1.0, self.options.speed) if real else self.options.speed
        if pace != self.clock.pace:
            self.clock.set_pace(pace)

    def _hear(self) -> None:
        try:
            item = self.heard.get(timeout=0.02)
        except queue.Empty:
            return
        self._take(item)
        self._drain()

    def _drain(self) -> None:
        while True:
            try:
                self._take(self.heard.get_nowait())
            except queue.Empty:
                return

    def _take(self, item: AgentSaid | Recorded | News) -> None:
        match item:
            case Recorded() if self._is_ending and isinstance(item.said, PrintEvent | None):
                if item.said is not None and item.said.kind is not EventKind.FAILED:
                    self._take_record(item)
            case Recorded():
                self._take_record(item)
            case AgentSaid():
                self._take_agent(item)
            case Parking() | Renewed() | NotRenewed() if item.token == self._planning:
                self._take_news(item)

    def _take_record(self, item: Recorded) -> None:
        head = self.heads[item.head]
        match item.said:
            case None:
                head.controller_gone = head.controller_gone or "its controller ended"
            case Ready(number, _):
                head.number = number
            case PrintEvent() as event if head.number >= 0:
                carried = self.plans[head.number]
                place = carried.heads.index(item.head)
                carried.take(item.head, replace(event, head=place))
                if head.failure is not None and not carried.is_print and self._has_done(item.head):
                    head.failure.at = self._park(item.head)
                self._event_at = time.monotonic()
                if event.kind is EventKind.FAILED:
                    self._fail(item.head, event.what)
                    self._fence(item.head, event.at, event.what)
                elif event.kind is EventKind.BEGAN:
                    self._goes_on(carried, event.time_s)

    def _goes_on(self, carried: Carried, time_s: float) -> None:
        """Note when heads began the rest that was planned behind failures."""
        is_rest = carried.is_print and carried.number == len(self.plans) - 1
        for failure in self.failures:
            if not math.isnan(failure.planned_s) and math.isnan(failure.on_s) and is_rest:
                ended = [e.time_s for p in self.plans[:-1] for e in p.events
                         if e.kind is EventKind.ENDED]  # fmt: skip
                failure.on_s = time_s
                failure.stood_s = max(0.0, time_s - max(ended, default=time_s))

    def _take_agent(self, item: AgentSaid) -> None:
        head, now = self.heads[item.head], time.monotonic()
        head.pulse_at = now
        match item.line:
            case None if self._is_ending:
                pass
            case None if head.replaced:
                head.replaced = False  # another has taken its place
            case None:
                process = self.processes[item.head].agent
                head.agent_gone = process.ending() or "its agent ended"
            case {"event": "stands"} as line:
                head.paused, head.waits_for = bool(line["paused"]), line["waits_for"]
                head.missing = tuple(line["missing"])
            case {"event": "held", "number": number, "released": released}:
                self._held[item.head] = (number, released)
            case {"event": "controller", "how": how}:
                head.controller_gone = head.controller_gone or f"its controller {how}"

    # Failures ---------------------------------------------------------------

    def _find_failures(self) -> None:
        for h, head in enumerate(self.heads):
            if not head.parks or not (head.controller_gone or head.agent_gone):
                continue
            head.parks = False
            if self._is_parked(h):
                last = [carried for carried in self.plans if h in carried.heads][-1]
                self._tell_fenced(last, h)
                continue
            head.fenced = False  # it stands who knows where
            self._drop_plans()
            self.report(Note(f"{head.name}: {PERSON.format(name=head.name)}"))
        for h in self._living():
            head = self.heads[h]
            if head.controller_gone:
                self._fail(h, head.controller_gone)
                self.report(Note(f"{head.name}: {PERSON.format(name=head.name)}"))
            elif head.agent_gone:
                self._fail(h, f"{AGENT} ({head.agent_gone})")
                self.processes[h].finish(f"{AGENT} ({head.agent_gone})")

    def _fail(self, h: int, why: str) -> None:
        """Note that a head prints no more; it may still move."""
        head, now_s = self.heads[h], self.clock.now()
        if head.failure is not None:
            return
        mine = [e.time_s for p in self.plans if h in p.heads
                for e in p.events if e.head == p.heads.index(h)]  # fmt: skip
        head.failure = Failure(head.name, why, max(mine, default=0.0), now_s)
        self.failures.append(head.failure)
        self._held.pop(h, None)
        self.report(Note(f"{clock_time(now_s)}: head {head.name} failed: {why}"))

    def _fence(self, h: int, at: Point, why: str = ABORTED) -> None:
        """Make sure that a head does nothing any more but go to its park, if it can do that."""
        head = self.heads[h]
        assert head.failure is not None
        head.parks = why != ABORTED
        if not head.parks:
            self.processes[h].kill()
        elif head.agent_gone or why in (BUS, SILENT):
            self.processes[h].restart()
            head.replaced, head.agent_gone = not head.agent_gone, ""
        head.fenced, head.failure.at = True, at
        head.failure.fenced_s = self.clock.now()
        self._unplanned.add(h)
        self._drop_plans()  # what is planned has this head in it

    def _drop_plans(self) -> None:
        """Leave what is planned: it is not true any more."""
        self._planning, self._holding = 0, False

    def _settle_missing(self) -> None:
        """Have a head stop that the others do not hear although its process lives: its bus is."""
        now, living = time.monotonic(), self._living()
        count = dict.fromkeys(living, 0)
        for h in living:
            for other in self.heads[h].missing:
                if other in count and now - self.heads[other].pulse_at < SILENT_S / 2.0:
                    count[h], count[other] = count[h] + 1, count[other] + 1
        worst = max(living, key=lambda h: (count[h], h), default=None)
        if worst is not None and count[worst]:
            self._tell(worst, command="abort", why=BUS)
            for h in living:
                self.heads[h].missing = ()

    # The rest ---------------------------------------------------------------

    def _hold(self) -> None:
        self._held, self._holding = {}, True
        for h in self._told():
            self._tell(h, command="hold")

    def _goes_on_in(self, carried: Carried, h: int) -> bool:
        """Tell whether a head may do more of a plan: it works, or it travels to its park."""
        head, last = self.heads[h], carried.last(h)
        if head.failure is None:
            return True
        failed = last is not None and last.kind is EventKind.FAILED
        return head.parks and not carried.is_print and not failed

    def _divide(self) -> None:
        """Say how far each head goes on, and have the rest planned."""
        self._holding = False
        living = self._living()
        if not living:
            return
        begun = [number for number, released in self._held.values() if released]
        base = max([0, *begun, *(p.number for p in self.plans if p.events)])
        carried = self.plans[base]
        stopped = self._all_stopped(carried)
        least = [
            carried.count(h) if self._held.get(h, (-1, 0))[0] > base
            else self._held[h][1] if k not in stopped and self._held[h][0] == base else 0
            for k, h in enumerate(carried.heads)
        ]  # fmt: skip
        plan = carried.document.plan
        whole = committed(plan, least, stopped, math.inf)
        state = self._state(carried, whole)
        if self._lost():  # what is planned without knowing where it is might meet it
            self._limit(carried, whole)
            return
        if _is_whole(state) or (not carried.is_print and self._is_all_printed()):
            self._limit(carried, whole)
            self._unplanned.clear()
            return
        until = committed(plan, least, stopped, self.options.replan_s + MORE_S)
        self._limit(carried, until)
        self._plan_rest(carried)

    def _stopped(self, carried: Carried, h: int) -> Reached:
        """Return how far a head that failed came in a plan."""
        if self.heads[h].number > carried.number:
            return Reached(carried.count(h))
        return carried.reached.get(h, Reached())

    def _all_stopped(self, carried: Carried) -> dict[int, Reached]:
        """Return how far those heads of a plan came that do no more of it, by place in it."""
        return {
            k: self._stopped(carried, h)
            for k, h in enumerate(carried.heads)
            if not self._goes_on_in(carried, h)
        }

    def _limit(self, carried: Carried, until: list[int]) -> None:
        for h, k in zip(carried.heads, until, strict=True):
            carried.until[h] = k
        for gone in carried.heads:
            if self.heads[gone].fenced and not self._goes_on_in(carried, gone):
                self._tell_fenced(carried, gone)
        for h in self._told():
            until_h = carried.until.get(h, 0)
            self._tell(h, command="limit", number=carried.number, until=until_h)

    def _tell_fenced(self, carried: Carried, gone: int) -> None:
        """Tell all that a head does no more of a plan, and how far it came."""
        reached = self._stopped(carried, gone)
        for h in self._told():
            self._tell(
                h, command="fence", head=gone, number=carried.number,
                reached=[reached.ended, reached.begun, reached.point],
            )  # fmt: skip

    def _printing(self) -> Carried:
        """Return the last plan that prints and that heads began."""
        return next(p for p in reversed(self.plans) if p.is_print and (p.events or not p.number))

    def _is_all_printed(self) -> bool:
        carried = self._printing()
        return _is_whole(self._state(carried, [carried.count(h) for h in carried.heads]))

    def _state(self, carried: Carried, until: list[int]) -> PrintState:
        """Return what is printed when each head has gone on up to an action."""
        found = []
        for h, k in zip(carried.heads, until, strict=True):
            state = carried.state(h)
            if h in self._living():
                state = replace(state, ended=k, begun=False, point=0)
            elif not state.failed:
                state = replace(state, at=None)
            found.append(state)
        return state_of_heads(carried.document, found)

    def _plan_rest(self, carried: Carried) -> None:
        printing = self._printing()
        standing = {
            self.heads[h].name: carried.stands(h, carried.until[h])
            if h in carried.heads
            else self._park(h)
            for h in self._living()
        }
        fenced = {
            head.name: carried.stands(h, carried.until[h])
            if h in carried.heads and self._goes_on_in(carried, h)
            else head.failure.at
            for h, head in enumerate(self.heads)
            if head.fenced and head.failure is not None and head.failure.at is not None
        }
        parking = {head.name: fenced[head.name] for head in self.heads if head.parks}
        names = {actions.head for actions in printing.document.plan.heads}
        machine = self.document.machine
        beside = {
            name: machine.head(name).park if name in parking else at for name, at in fenced.items()
        }
        self._unplanned.clear()
        source = self._sources.get(printing.number)
        if source is None:
            self.reason = "the source is not named (--source), so the rest cannot be planned"
            self._give_up(carried)
            return
        self._token += 1
        self._planning = self._token
        state = self._state(printing, [printing.count(h) for h in printing.heads])
        begin = Begin(
            printing.document, machine, source, state, {**standing, **parking},
            {name: at for name, at in beside.items() if name in names},
            {name: at for name, at in fenced.items() if name not in parking},
        )  # fmt: skip
        self.report(Note(f"{clock_time(self.clock.now())}: the rest is planned for "
                         f"{', '.join(standing)}"))  # fmt: skip
        renew(
            self._token, begin, self.options.replan_s, self.options.seed, self.options.left_beads,
            self.heard.put,
        )  # fmt: skip

    def _park(self, h: int) -> Point:
        return self.document.machine.head(self.heads[h].name).park

    def _give_up(self, carried: Carried) -> None:
        """Have heads go on with all that needs no head that failed."""
        stopped = self._all_stopped(carried)
        least = [carried.until.get(h, 0) for h in carried.heads]
        self._limit(carried, committed(carried.document.plan, least, stopped, math.inf))
        self.report(Note(self.reason))

    def _take_news(self, news: News) -> None:
        match news:
            case Parking(_, document):
                self._announce(document, is_print=False)
            case Renewed(_, document, source, left_out, lines):
                self._planning, now_s = 0, self.clock.now()
                self.reason = ""
                self.left += [line for line in lines if line not in self.left]
                self.left_out += left_out
                self._sources[len(self.plans)] = source
                self._announce(document, is_print=True)
                for failure in self.failures:
                    if math.isnan(failure.planned_s):
                        failure.planned_s = now_s
                self.report(Note(f"{clock_time(now_s)}: the rest is planned"))
            case NotRenewed(_, why, parked):
                self._planning = 0
                self.reason = f"the rest is not planned: {why}"
                if parked:
                    self.report(Note(self.reason))
                else:
                    self._give_up(max((p for p in self.plans if p.events),
                                      key=lambda p: p.number))  # fmt: skip

    def _is_parked(self, h: int) -> bool:
        """Tell whether a head that failed stands at its park."""
        failure = self.heads[h].failure
        at = None if failure is None else failure.at
        return at is not None and same_place(at, self._park(h))

    # People -----------------------------------------------------------------

    def _obey(self) -> None:
        while True:
            try:
                line = self.asked.get_nowait()
            except queue.Empty:
                return
            if line is None:
                self._is_asked = False
                continue
            try:
                self._do(line.split())
            except InputError as error:
                self.report(Note(f"{line.strip()}: {error}"))

    def _do(self, words: list[str]) -> None:
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
                for h in self._living():
                    self._ask(h, word)
            case [("pause" | "resume" | "abort") as word, name]:
                self._ask(self._named(name), word)
            case ["fenced", name, place]:
                self._fenced(self._named(name), place, None if place == PARKED else place)
            case ["fenced", name, "park" as place, stopped]:
                self._fenced(self._named(name), place, stopped)
            case _:
                raise InputError(
                    "unknown", advice="say pause, resume or abort, with a head or for all, or "
                    "fenced HEAD park, or fenced HEAD X,Y,Z, or fenced HEAD park X,Y,Z",
                )  # fmt: skip

    def _ask(self, h: int, word: str) -> None:
        if self.heads[h].failure is None:
            self._tell(h, command=word, **({"why": "aborted"} if word == "abort" else {}))

    def _named(self, name: str) -> int:
        names = [head.name for head in self.heads]
        if name not in names:
            raise InputError(f"no head {name}", advice=f"heads are {', '.join(names)}")
        return names.index(name)

    def _fenced(self, h: int, place: str, stopped: str | None) -> None:
        """Take a person's word that a head is off, where it stands, and where it had stopped."""
        head = self.heads[h]
        if head.fenced and not self.reason:
            raise InputError(f"the rest is planned around {head.name}: leave it where it stands")
        at = self._place(head.name, place)
        stopped_at = None if stopped is None else self._place(head.name, stopped)
        self._fail(h, "fenced by a person")
        begun = [carried for carried in self.plans if h in carried.heads and carried.last(h)]
        since = head.failure
        if begun and stopped_at and since and not begun[-1].stop(h, stopped_at, since.noticed_s):
            self.report(Note(
                f"{head.name}: that is more than {SEEN_MM:g} mm from where it may have stopped; "
                "what the bead it was at lacks stays unknown"
            ))  # fmt: skip
        self._fence(h, at)
        self.moved[h] = (self.clock.now(), at)
        self.reason = ""

    def _place(self, name: str, text: str) -> Point:
        """Return a place that a person names for a head."""
        none = PrintState((), self._printing().document.contours.layer < 0)
        machine = self.document.machine
        return fenced_places([f"{name}={text}"], machine, none, seen=False)[name]

    # The end ----------------------------------------------------------------

    def _is_over(self) -> bool:
        if self._planning or self._holding:
            return False
        living = self._living()
        if not living:
            return True
        if self._unplanned and not self._lost():
            return False
        if all(self._has_done(h) for h in living) and not self._lost():
            return not (self.reason and self._is_asked and not self.aborted)
        if not self._is_asked and self._lost():
            quiet = time.monotonic() - self._event_at > QUIET_S
            return quiet and not any(self.heads[h].paused for h in living)
        return False

    def _has_done(self, h: int, before: int | None = None) -> bool:
        """Tell whether a head has done its share of the last plan it is in (before one)."""
        last = [p for p in self.plans[:before] if h in p.heads][-1]
        return last.reached.get(h, Reached()).ended >= last.count(h)

    @property
    def makespan_s(self) -> float:
        """When the last action ended."""
        return max((e.time_s for p in self.plans for e in p.events if e.kind is EventKind.ENDED),
                   default=0.0)  # fmt: skip

    @property
    def unprinted(self) -> int:
        """Contours of the last plan that are not printed, and those that were left out."""
        carried = self._printing()
        contours = len(carried.document.contours)
        done = set[int]()
        for k, h in enumerate(carried.heads):
            actions = carried.document.plan.heads[k]
            ended = carried.reached.get(h, Reached()).ended
            rows = actions.kind[:ended] == ActionKind.PRINT
            done.update(actions.contour[:ended][rows].tolist())
        return contours - len(done) + self.left_out


def _is_whole(state: PrintState) -> bool:
    """Tell whether nothing is left to print, broken beads included."""
    return bool(state.done.all()) and not state.broken
