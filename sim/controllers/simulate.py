"""Files or a plan run as controllers run them, once as they should and as often with errors.

The first run has no error of time; all else that is reported of heads is of that one. A run is
stated as events, in the schema of all who carry prints out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.brief import brief
from decmcts.print.machine import Head, Machine
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from sim.controllers.adversary import adversaries
from sim.controllers.carry_out import Run, carry_out
from sim.controllers.motion import QUEUE, Profile, profile_of
from sim.controllers.nearness import HeadContact, Near, course_of, nearness, positions
from sim.controllers.print_contacts import Material, PrintContact, print_contacts
from sim.controllers.program import HeadProgram, StopKind, place_of
from sim.controllers.timing import Error, Timing, draw, no_error
from sim.rules.cooling import TooSoon, too_soon_in


@dataclass(frozen=True, slots=True)
class SimulatedWait:
    """A head that stood for another."""

    head: int
    by: int  # whose signal it waited for
    begin_s: float
    seconds: float
    line: int  # of its file, from 1; 0: none
    action: int  # of its plan, or stretch of its file


@dataclass(frozen=True, slots=True)
class HeadFigures:
    """What one head did, in seconds of the print."""

    name: str
    printing_s: float
    travelling_s: float  # and all other moves
    waiting_s: float  # for other heads
    standing_s: float  # dwelling, starting again behind a stop, or with nothing left to do
    filament_mm: float  # pushed less pulled, start and end code included
    rests_in_beads: int  # times it came to rest within a bead


@dataclass(frozen=True, slots=True)
class Trial:
    """One run."""

    name: str
    makespan_s: float  # inf: some head waits for ever
    near: tuple[Near, ...]
    stuck: tuple[tuple[int, int], ...] = ()  # head and stop
    too_soon: tuple[TooSoon, ...] = ()  # what is printed over before it is cool
    on_print: tuple[PrintContact, ...] = ()  # of heads with what is printed by then

    @property
    def contacts(self) -> tuple[HeadContact, ...]:
        """Contacts of all pairs of heads."""
        return tuple(contact for near in self.near for contact in near.contacts)


@dataclass(frozen=True, slots=True)
class Simulation:
    """What was simulated."""

    programs: tuple[HeadProgram, ...]
    profiles: tuple[Profile, ...]
    run: Run  # without errors of time
    begin_s: float  # when the last head was set up: the print begins
    heads: tuple[HeadFigures, ...]
    waits: tuple[SimulatedWait, ...]
    trials: tuple[Trial, ...]  # the first without errors

    __repr__ = brief("makespan_s", "safe", "contacts", "heads")

    @property
    def makespan_s(self) -> float:
        """From when all heads are set up until all are done, without errors."""
        return self.trials[0].makespan_s

    def positions(self, times: Floats) -> tuple[Floats, ...]:
        """Return where each head is at ascending seconds into the print, (k, 3) each."""
        return tuple(
            positions(course_of(program, profile, no_error(program), head), times + self.begin_s)
            for program, profile, head in zip(
                self.programs, self.profiles, self.run.heads, strict=True
            )
        )

    @property
    def contacts(self) -> int:
        """How often heads touched, in all trials."""
        return sum(len(trial.contacts) for trial in self.trials)

    @property
    def print_contacts(self) -> int:
        """How often heads touched the print, in all trials."""
        return sum(len(trial.on_print) for trial in self.trials)

    @property
    def safe(self) -> bool:
        """Whether heads touched neither each other nor the print, and none waits for ever."""
        touched = self.contacts or self.print_contacts
        return not touched and not any(trial.stuck for trial in self.trials)


def simulate(
    programs: Sequence[HeadProgram], machine: Machine, *, timing: Timing = Timing.NONE,
    size: float = 0.2, trials: int = 1, seed: int = 0, queue: int = QUEUE,
    on_trial: Callable[[Sequence[Trial], int], None] = lambda _trials, _of: None,
    too_soon: Callable[[Run], tuple[TooSoon, ...]] = lambda _run: (),
    material: Material | None = None,
) -> Simulation:  # fmt: skip
    """Run programs of all heads of a machine together.

    Parameters
    ----------
    timing, size, trials, seed
        Which errors of time, how large (share of the time), how many draws and from which seed.
        Of `Timing.ADVERSARIAL` there are as many trials as pairs of legs come near, whatever
        `trials` says.
    queue : int
        Moves that a controller plans ahead.
    on_trial : Callable
        Called before each trial with errors of time: with the trials that were run, and of how
        many with errors it is one; 0: not known.
    too_soon : callable
        Returns what a run prints over before it is cool.
    material : Material | None
        What the programs print; None: contacts with it are not looked for. One head alone has
        the same in all trials, so they are those of the first.

    References
    ----------
    Timing errors that break central plans: JMD 145(1) 012003.
    """
    programs = tuple(programs)
    named, last = {head.name: head for head in machine.heads}, len(machine.heads) - 1
    heads = [named.get(p.name, machine.heads[min(k, last)]) for k, p in enumerate(programs)]
    profiles = tuple(profile_of(program, queue) for program in programs)
    rest_s = machine.rest_s if len(programs) > 1 else 0.0
    seconds = [profile.seconds for profile in profiles]

    errors = [no_error(program) for program in programs]
    nominal = carry_out(programs, seconds, errors, rest_s)
    judged = partial(_trial, programs, profiles, machine, heads, too_soon)
    found = [judged("no error", errors, nominal, material)]
    again = material if len(programs) > 1 else None
    drawn = _errors(programs, nominal, machine, heads, timing, size, trials, seed)
    expected = trials if timing not in (Timing.NONE, Timing.ADVERSARIAL) else 0
    for name, errors in drawn:
        on_trial(found, expected)
        found.append(judged(name, errors, carry_out(programs, seconds, errors, rest_s), again))
    span, waits = (_begin(programs, nominal), _end(programs, nominal)), _waits(programs, nominal)
    figures = tuple(_figures(nominal, h, each, span, waits) for h, each in enumerate(programs))
    return Simulation(programs, profiles, nominal, span[0], figures, waits, tuple(found))


def _errors(
    programs: Sequence[HeadProgram], run: Run, machine: Machine, heads: Sequence[Head],
    timing: Timing, size: float, trials: int, seed: int,
) -> Iterator[tuple[str, list[Error]]]:  # fmt: skip
    if timing == Timing.NONE:
        return
    if timing == Timing.ADVERSARIAL:
        for k, errors in enumerate(adversaries(programs, run, machine, heads), 1):
            yield f"{timing} {k}", errors
        return
    for k in range(trials):
        streams = np.random.default_rng([seed, k]).spawn(len(programs))
        drawn = zip(programs, streams, strict=True)
        yield f"{timing} {k}", [draw(timing, program, size, rng) for program, rng in drawn]


def _trial(
    programs: Sequence[HeadProgram], profiles: Sequence[Profile], machine: Machine,
    heads: Sequence[Head], soon: Callable[[Run], tuple[TooSoon, ...]], name: str,
    errors: Sequence[Error], run: Run, material: Material | None,
) -> Trial:  # fmt: skip
    """Return what one run came to; without `material` the print is not looked at."""
    courses = [course_of(*each) for each in zip(programs, profiles, errors, run.heads, strict=True)]
    begin, end = _begin(programs, run), _end(programs, run)
    until, touched = end, tuple[PrintContact, ...]()
    if end == np.inf:
        until = max(float(head.end[head.end < np.inf].max(initial=0.0)) for head in run.heads)
    if material is not None:
        touched = print_contacts(
            programs, run.heads, heads, material, clearance_mm=machine.clearance_mm,
            begin_s=begin, end_s=until,
        )  # fmt: skip
    near = nearness(machine, heads, courses, begin, until)
    return Trial(name, end - begin, near, run.stuck, soon(run), touched)


def _begin(programs: Sequence[HeadProgram], run: Run) -> float:
    """Return when all heads are set up, or a lone file lays its first bead."""
    found = [
        float(head.left[program.begins - 1])
        if program.begins
        else _of_beads(program, head.begin, 0)
        for program, head in zip(programs, run.heads, strict=True)
    ]
    return max(found, default=0.0)


def _end(programs: Sequence[HeadProgram], run: Run) -> float:
    """Return when all heads are done, or a lone file has laid its last bead."""
    found = []
    for program, head in zip(programs, run.heads, strict=True):
        if program.ends is not None:
            found.append(float(head.reached[program.ends]))
        elif program.line.any():
            found.append(_of_beads(program, head.end, -1))
        else:
            found.append(head.end_s)
    return max(found, default=0.0)


def _of_beads(program: HeadProgram, times: Floats, place: int) -> float:
    """Return the time of the first bead or the last; 0 for the begin of a plan."""
    beads = np.flatnonzero(program.prints)
    return float(times[beads[place]]) if len(beads) and program.line.any() else 0.0


def _figures(
    run: Run, h: int, program: HeadProgram, span: tuple[float, float],
    waits: Sequence[SimulatedWait],
) -> HeadFigures:  # fmt: skip
    (begin, end), head, prints = span, run.heads[h], program.prints
    within = (head.begin >= begin - 1e-9) & (head.end <= end + 1e-9)
    taken = np.where(within, head.end - head.begin, 0.0)
    printing, moving = float(taken[prints].sum()), float(taken[~prints].sum())
    waiting = sum(wait.seconds for wait in waits if wait.head == h and wait.begin_s >= begin)
    rest = max(0.0, end - begin - printing - moving - waiting)
    if program.line.any():
        stops = program.stops.before[program.stops.rests]
        stops = stops[(stops > 0) & (stops < len(prints))]
        inside = prints[stops] & prints[stops - 1]
    else:
        inside = program.rests[1:] & prints[1:] & prints[:-1] & (np.diff(program.action) == 0)
    return HeadFigures(
        program.name, printing, moving, waiting, rest, float(program.filament.sum()),
        int(inside.sum()),
    )  # fmt: skip


def _waits(programs: Sequence[HeadProgram], run: Run) -> tuple[SimulatedWait, ...]:
    found = []
    for h, (program, head) in enumerate(zip(programs, run.heads, strict=True)):
        stops = program.stops
        for j in np.flatnonzero((stops.kind == StopKind.WAIT) & (head.by >= 0)).tolist():
            move = min(int(stops.before[j]), len(program.line) - 1)
            line, action = int(program.line[move]), int(program.action[move])
            begin, seconds = float(head.reached[j]), float(head.left[j] - head.reached[j])
            found.append(SimulatedWait(h, int(head.by[j]), begin, seconds, line, action))
    return tuple(sorted(found, key=lambda wait: wait.begin_s))


def too_soon(
    document: PlanDocument, programs: Sequence[HeadProgram], run: Run
) -> tuple[TooSoon, ...]:
    """Return what a run of a plan's own actions prints over sooner than the plan's rule allows."""
    begin, end = np.full((2, len(document.contours)), np.inf)
    for actions, program, head in zip(document.plan.heads, programs, run.heads, strict=True):
        firsts, lasts = program.moves_of_actions()
        own = program.action[firsts]
        prints = actions.kind[own] == ActionKind.PRINT
        contours = actions.contour[own[prints]]
        begin[contours], end[contours] = head.begin[firsts[prints]], head.end[lasts[prints]]
    return tuple(too_soon_in(document, begin, end))


def events_of(simulation: Simulation, problem: str = "") -> EventLog:
    """Return what happened without errors of time, from when the print began."""
    found = sorted(_events(simulation), key=lambda event: (event.time_s, event.head))
    names = tuple(program.name for program in simulation.programs)
    return EventLog(problem, names, tuple(found))


def _events(simulation: Simulation) -> Iterator[PrintEvent]:
    zero = simulation.begin_s
    for h, (program, run) in enumerate(zip(simulation.programs, simulation.run.heads, strict=True)):
        firsts, lasts = program.moves_of_actions()
        for i, k in zip(firsts.tolist(), lasts.tolist(), strict=True):
            action = int(program.action[i])
            for kind, move, times, point in (
                (EventKind.BEGAN, i, run.begin, 0), (EventKind.ENDED, k, run.end, k - i + 1),
            ):  # fmt: skip
                if zero <= times[move] < np.inf:
                    place = program.points[move + (kind == EventKind.ENDED)]
                    yield PrintEvent(
                        kind, h, float(times[move]) - zero, action, point, place_of(place),
                        line=int(program.line[move]),
                    )  # fmt: skip
        first_of = dict(zip(program.action[firsts].tolist(), firsts.tolist(), strict=True))
        for j in range(len(program.stops)):
            move = min(int(program.stops.before[j]), len(program.action) - 1)
            stop, time = int(program.stops.kind[j]), float(run.reached[j]) - zero
            if not 0.0 <= time < np.inf or move < 0:
                continue
            place = place_of(program.points[program.stops.before[j]])
            line, action = int(program.line[move]), int(program.action[move])
            if stop == StopKind.WAIT and run.by[j] >= 0:
                by = int(run.by[j])
                yield PrintEvent(EventKind.WAITS, h, time, action, 0, place, by, line)
            elif stop == StopKind.PASS:
                point = int(program.stops.before[j]) - first_of[action]
                if point > 0:
                    yield PrintEvent(EventKind.PASSED, h, time, action, point, place, line=line)
