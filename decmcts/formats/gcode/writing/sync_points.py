"""Numbers for the places where one head waits for another, the same in every file.

The heads of a plan start one after the other (numbers 1 to H: head i is homed
and parked), then every end of an action and every point within one that another
head waits for has a number, in the order of nominal ends. Last come H numbers for
heads that have printed all they have to, and H for heads whose end code has run:
it turns off the bed and the motors, so it must wait for the others, and it may
move, so one head goes after the other.

The waiting head dwells behind its waits for as long as its lags ask, whenever the signal came:
files keep no time among each other. It dwells too, retracted, where the plan rests for cooling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.formats.gcode.dialects.dialect import IDLE_MARK, WAIT_MARK
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.print.job import PrintJob
from decmcts.print.machine import Release, SyncWords, with_number
from decmcts.print.plan import ACTION_END, JointPlan
from decmcts.print.signals import Action, Place, place_of, signals_of
from decmcts.print.stands import Standby

LONGEST_DWELL_S = 600.0  # of one G4


@dataclass(frozen=True, slots=True)
class SyncPoints:
    """Which action signals which numbers, and which numbers each action waits for."""

    signals: Mapping[Action, int]  # number, given after it ends,
    at_rest: frozenset[Action]  # for which the head stands still: behind the others it goes on
    passed: Mapping[Action, Mapping[int, int]]  # vertex of its path -> number, given in motion
    waits: Mapping[Action, tuple[int, ...]]  # numbers, ascending; each once in a file
    lags: Mapping[Action, float]  # seconds to dwell after these; 0 is left out
    done: tuple[int, ...]  # (heads,) given when a head has nothing left to print and is parked
    ended: tuple[int, ...]  # (heads,) given when a head's end code has run
    apart: frozenset[Action]  # before whose signal the head has to stand a while;
    # the action behind its last one: before that it is done
    given: Mapping[int, tuple[int, int]]  # number -> place of the file it is given in, from 1, and
    # how many signals that file has up to it


def number_sync_points(
    plan: JointPlan, job: PrintJob, release: Release, interval_s: float = 0.0
) -> SyncPoints:
    """Return the synchronisation points of a joint plan.

    Signals nearer than `interval_s` are one, at the later point of the same action.
    """
    signals, heads = signals_of(plan, job, interval_s), len(plan.heads)
    given = sorted(set(signals.at.values()), key=lambda at: _due(plan, at))
    numbers = {at: heads + 1 + n for n, at in enumerate(given)}
    last = heads + 1 + len(numbers)
    done, ended = tuple(range(last, last + heads)), tuple(range(last + heads, last + 2 * heads))
    at_end, passed = dict[Action, int](), dict[Action, dict[int, int]]()
    for (head, action, point), number in numbers.items():
        if point == ACTION_END:
            at_end[head, action] = number
        else:
            passed.setdefault((head, action), {})[point] = number
    waits, lags = _waits(plan, {at: numbers[place] for at, place in signals.at.items()})
    return SyncPoints(
        at_end, frozenset(signals.at_rest(plan, release)), passed, waits, lags, done, ended,
        signals.apart, _counted(heads, numbers, done, ended),
    )  # fmt: skip


def _waits(
    plan: JointPlan, numbers: Mapping[Place, int]
) -> tuple[dict[Action, tuple[int, ...]], dict[Action, float]]:
    """Return what each action waits for that no earlier one of its head has, and its lags, s."""
    waits, lags = dict[Action, tuple[int, ...]](), dict[Action, float]()
    for h, head in enumerate(plan.heads):
        known = set[int]()
        for k in np.flatnonzero(np.diff(head.after_offsets)).tolist():
            edges = [edge for edge in head.after_edges(k) if edge.head != h]
            due = {numbers[place_of(plan, edge)] for edge in edges} - known
            if due:
                waits[h, k] = tuple(sorted(due))
            known |= due
            if (lag_s := max((edge.lag_s for edge in edges), default=0.0)) > 0.0:
                lags[h, k] = lag_s
    return waits, lags


def _counted(
    heads: int, numbers: Mapping[Place, int], done: Sequence[int], ended: Sequence[int]
) -> dict[int, tuple[int, int]]:
    """Return the file and the count of each number, in the order in which files have them."""
    found = {}
    places = sorted(numbers, key=lambda p: (p[0], p[1], p[2] == ACTION_END, p[2]))
    for h in range(heads):
        own = (numbers[place] for place in places if place[0] == h)
        every = [h + 1, *own, done[h], ended[h]]
        found.update({number: (h + 1, count) for count, number in enumerate(every, 1)})
    return found


def _due(plan: JointPlan, place: Place) -> tuple[float, int, int, bool, int]:
    """Return what sorts the numbers: nominal end of the action, and within it the points."""
    head, action, point = place
    end_s = float(plan.heads[head].end_s[action])
    return end_s, head, action, point == ACTION_END, point


class HeadWaits:
    """Writes the waits, dwells and signals of one head, counted from 0 in the plan.

    It stands `apart_s` before a signal at rest that is too near to the one before.
    """

    def __init__(
        self, emitter: Emitter, points: SyncPoints, words: SyncWords, head: int, apart_s: float
    ) -> None:
        self.emitter, self.points, self.words = emitter, points, words
        self.head, self._apart_s = head, apart_s

    def signal(self, number: int) -> None:
        """Signal at rest."""
        self.emitter.emit("M400")
        self.emitter.emit(self._line(self.words.signal, number))

    def wait(self, number: int) -> None:
        """Wait for a number; the moves above run out by themselves."""
        self.emitter.emit(self._line(self.words.wait, number))

    def any_before(self, action: int) -> bool:
        """Tell whether an action waits for another head."""
        return (self.head, action) in self.points.waits

    def take_turn(self) -> None:
        """Signal that this head is parked, and wait until all are."""
        heads = len(self.points.done)
        if heads > 1:
            self.signal(self.head + 1)
            if self.head + 1 < heads:
                self.wait(heads)

    def passed(self, action: int) -> dict[int, str] | None:
        """Return what is to be said, by the points of an action's path, as the head passes them."""
        given = self.points.passed.get((self.head, action))
        if given is None:
            return None
        return {point: self._line(self.words.passed, number) for point, number in given.items()}

    def stand(
        self, action: int, rested_s: float, standby: Standby | None, *, hot: float, cold: float
    ) -> None:
        """Write what an action waits for, and for how long the head stands before it.

        With a `standby` the hot end, at `hot` degrees, is at `cold` meanwhile.
        """
        numbers = self.points.waits.get((self.head, action), ())
        lag_s = self.points.lags.get((self.head, action), 0.0)
        if standby is None:
            self._wait_for(numbers, lag_s, rested_s)
            return
        self.emitter.emit("M400")
        self.emitter.emit(f"M104 S{cold:g} {IDLE_MARK}")
        if not standby.behind:
            self._dwell(standby.cool_s, IDLE_MARK)
            self.emitter.emit(f"M104 S{hot:g}")
            self._wait_for(numbers, lag_s, rested_s)
        else:
            self._wait_for(numbers, standby.cool_s)
            self.emitter.emit(f"M104 S{hot:g}")
            self._dwell(standby.heat_s)
        self.emitter.emit(f"M109 S{hot:g}")

    def ended(self, action: int) -> None:
        """Signal that an action has ended if any head waits for it, without a stop where it can."""
        place = self.head, action
        if (number := self.points.signals.get(place, 0)) <= 0:
            return
        if place in self.points.at_rest:
            self._stand_apart(action)
            self.signal(number)
        else:
            self.emitter.emit(self._line(self.words.passed, number))

    def wait_for_all(self, count: int) -> None:
        """Signal that all `count` actions are done, and wait for all heads and the turn to end."""
        done, ended = self.points.done, self.points.ended
        if len(done) == 1:
            return
        self._stand_apart(count)
        self.signal(done[self.head])
        for number in done[: self.head] + done[self.head + 1 :]:
            self.wait(number)
        if self.head > 0:
            self.wait(ended[self.head - 1])
        if self.head + 1 < len(ended):
            self._dwell(self._apart_s)  # a signal stands below the end code, too

    def pass_turn(self) -> None:
        """Signal that the end code has run, if a head waits for its turn."""
        if self.head + 1 < len(self.points.ended):
            self.signal(self.points.ended[self.head])

    def _stand_apart(self, action: int) -> None:
        if (self.head, action) in self.points.apart:
            self._dwell(self._apart_s)

    def _wait_for(self, numbers: tuple[int, ...], *seconds: float) -> None:
        """Wait for numbers, and stand still behind them."""
        for number in numbers:
            self.wait(number)
        for part in seconds:
            self._dwell(part)

    def _dwell(self, seconds: float, mark: str = WAIT_MARK) -> None:
        """Stand still, in as many parts as controllers take."""
        while seconds > 0.0:
            part = min(seconds, LONGEST_DWELL_S)
            self.emitter.dwell(part, mark)
            seconds -= part

    def _line(self, words: str, number: int) -> str:
        return with_number(words, number, *self.points.given[number])
