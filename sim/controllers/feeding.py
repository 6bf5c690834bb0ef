"""A simulated controller that is fed action by action, as it would be behind the port of `run`.

It holds the program of one head, and carries out what is released, each action as long as its
motion and its errors of time make it last. Time is an argument: nothing here sleeps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.machine import Point
from decmcts.print.plan import HeadActions, PlanDocument
from decmcts.print.print_events import NO_ACTION, EventKind, PrintEvent
from sim.controllers.from_plan import HAIR_S, program_of_head
from sim.controllers.motion import QUEUE, Profile, profile_of
from sim.controllers.nearness import Course, positions
from sim.controllers.program import HeadProgram, StopKind, place_of
from sim.controllers.timing import Error, no_error

Draw = Callable[[HeadProgram], Error]


@dataclass(frozen=True, slots=True)
class Work:
    """What one head does in a plan, action by action."""

    program: HeadProgram
    profile: Profile
    error: Error
    first: Ints  # (k + 1,) the first move of each action
    before_s: Floats  # (k,) it stands so long before it moves
    passes: Mapping[int, Sequence[int]]  # points of an action's path that others wait for

    @classmethod
    def of_plan(
        cls, document: PlanDocument, name: str, queue: int = QUEUE, error: Draw = no_error
    ) -> Work:
        """Return the work of the head of that name."""
        h = [actions.head for actions in document.plan.heads].index(name)
        actions, program = document.plan.heads[h], program_of_head(document, h, queue)
        profile, wrong = profile_of(program, queue), error(program)
        first = np.searchsorted(program.action, np.arange(len(actions) + 1)).astype(np.int64)
        motion = np.diff(np.concatenate([[0.0], np.cumsum(profile.seconds)])[first])
        stalls = np.diff(np.concatenate([[0.0], np.cumsum(wrong.stall_s)])[first])
        due = actions.end_s - actions.begin_s - motion
        rests = document.machine.rest_s * _stood(actions, program, first, h)
        before = np.where(due > HAIR_S, due, 0.0) + stalls + rests
        passes: dict[int, list[int]] = {}
        stops = program.stops
        for place in stops.before[stops.kind == StopKind.PASS].tolist():
            k = int(np.searchsorted(first, place, side="right")) - 1
            if place > first[k]:
                passes.setdefault(k, []).append(place - int(first[k]))
        return cls(program, profile, wrong, first, before, passes)

    def __len__(self) -> int:
        return len(self.before_s)

    def ends(self, action: int) -> Floats:
        """Return the seconds at which the moves of an action end, from the first one's begin."""
        rows = slice(int(self.first[action]), int(self.first[action + 1]))
        return np.cumsum(self.profile.seconds[rows] * self.error.factor[rows])

    def events(self, action: int, head: int, begin_s: float) -> list[PrintEvent]:
        """Return what is reported of an action whose first move begins at a time."""
        ends = self.ends(action)

        def event(kind: EventKind, point: int) -> PrintEvent:
            time_s = begin_s + (float(ends[point - 1]) if point else 0.0)
            return PrintEvent(kind, head, time_s, action, point, self.corner(action, point))

        passes = [event(EventKind.PASSED, point) for point in self.passes.get(action, ())]
        return [event(EventKind.BEGAN, 0), *passes, event(EventKind.ENDED, len(ends))]

    def corner(self, action: int, point: int = 0) -> Point:
        """Return a point of an action's path."""
        return place_of(self.program.points[int(self.first[action]) + point])

    def at(self, action: int, seconds: float) -> Point:
        """Return where the nozzle is so long after an action's first move began."""
        if action >= len(self) or seconds <= 0.0:
            return self.corner(min(action, len(self)))
        a, b = int(self.first[action]), int(self.first[action + 1])
        if a == b:
            return self.corner(action)
        ends, factor, its = self.ends(action), self.error.factor[a:b], self.profile
        course = Course(
            self.program.points[a : b + 1], ends - factor * its.seconds[a:b], ends,
            its.length[a:b], its.enters[a:b], its.leaves[a:b], its.top[a:b], its.rate[a:b], factor,
        )  # fmt: skip
        return place_of(positions(course, np.array([seconds]))[0])


def _stood(actions: HeadActions, program: HeadProgram, first: Ints, h: int) -> Flags:
    """Tell which actions begin behind a rest for another head, (k,)."""
    signals = set(program.stops.before[program.stops.kind == StopKind.SIGNAL].tolist())
    stood, rests = np.zeros(len(actions), np.bool_), False
    for k in range(len(actions)):
        waits = any(edge.head != h for edge in actions.after_edges(k))
        rests = rests or waits or int(first[k]) in signals
        if first[k + 1] > first[k]:
            stood[k], rests = rests, False
    return stood


@dataclass(slots=True)
class Feeding:
    """One head's controller; changes in place."""

    head: int  # in the events
    work: Work
    free_s: float = 0.0  # when the last action ended
    released: int = 0
    paused: bool = False
    ending: str = ""  # why it is off behind the action that has begun
    word: PrintEvent | None = None  # its last: that it is off
    action: int = 0
    begin_s: float = math.nan  # of the action's first move; NaN: it has not begun
    _since: list[float] = field(default_factory=list)  # when each action was released
    _resumed_s: float = -math.inf  # when it was told to go on last
    _due: list[PrintEvent] = field(default_factory=list)  # of the action, not reported yet

    @property
    def off(self) -> bool:
        """Whether it does nothing any more."""
        return self.word is not None

    @property
    def begun(self) -> bool:
        """Whether an action has begun and not ended."""
        return not math.isnan(self.begin_s)

    def release(self, until: int, now_s: float) -> None:
        """Let actions below `until` be carried out."""
        more = min(until, len(self.work)) - self.released
        self._since += [now_s] * more
        self.released += max(more, 0)

    def pause(self) -> None:
        """Stand at the end of the action that has begun."""
        self.paused = True

    def resume(self, now_s: float) -> None:
        """Go on."""
        if self.paused:
            self._resumed_s = now_s
        self.paused = False

    def end(self, why: str) -> None:
        """Be off behind the action that has begun."""
        self.ending = self.ending or why

    def fail(self, why: str, now_s: float) -> PrintEvent:
        """Stop at once and be off; return its last word, of one that is off the same again."""
        if self.word is not None:
            return replace(self.word, what=why)
        action, point = NO_ACTION, 0
        if self.action < len(self.work):
            action = self.action
            if self.begun:
                ends = self.work.ends(action)
                point = int(np.searchsorted(ends, now_s - self.begin_s, side="right"))
        at = self.at(now_s)
        self.word = PrintEvent(EventKind.FAILED, self.head, now_s, action, point, at, what=why)
        return self.word

    def step(self, now_s: float) -> Iterator[PrintEvent]:
        """Yield all events up to a time, in their order."""
        while not self.off and (self.begun or self._begin(now_s)):
            while self._due and self._due[0].time_s <= now_s:
                self.free_s = self._due[0].time_s
                yield self._due.pop(0)
            if self._due:
                return
            self.begin_s = math.nan
            self.action += 1
        if self.ending and not self.begun and not self.off:
            yield self.fail(self.ending, now_s)

    def _begin(self, now_s: float) -> bool:
        """Begin the next action if it is released and it is time; tell whether it has begun."""
        if self.action >= self.released or self.paused or self.ending or self.free_s > now_s:
            return False
        # It may be told to go on before it was asked whether the last action has ended.
        free_s = max(self.free_s, self._since[self.action], self._resumed_s)
        self.begin_s = free_s + float(self.work.before_s[self.action])
        self._due = self.work.events(self.action, self.head, self.begin_s)
        return True

    def next_s(self) -> float:
        """Return when it says something next, of its own; inf: never."""
        if self.begun:
            return self._due[0].time_s
        waits = self.off or self.paused or self.action >= self.released
        return math.inf if waits else self.free_s

    def at(self, now_s: float) -> Point:
        """Return where the nozzle is."""
        if self.begun:
            return self.work.at(self.action, now_s - self.begin_s)
        return self.work.corner(self.action)
