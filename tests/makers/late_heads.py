"""What happens to a joint plan when heads are late, with waits and without.

The delay experiment of the literature on printing with several robots, on any joint
plan: heads take other times than planned and are held up at random. With waits an action
begins when all it waits for has happened. *By the clock* there are no waits: an action begins
at its planned time, or as soon as its head is free if that is later. At planned times both do
the same. Counted are pairs of actions in which two heads come too near each other, and
contours begun before what they rest on has been printed.

References
----------
Journal of Mechanical Design 145(1) 012003, 2023: decentralised against centralised
planning of several printing robots, under timing error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import ActionKind, PlanDocument
from sim.content.legs import Legs, legs_of
from sim.replay.execution import (
    Course,
    arrivals_of,
    course_of,
    meetings,
    rail_breaks,
    shared_pieces,
)
from sim.rules.order import PartialOrder, order_of
from sim.verify import all_actions_of

HELD_UP = 0.01  # share of the actions that begin late
LATEST_S = 60.0
TROUBLES = {  # name: (timing error of an action at most, whether some are held up)
    "none": (1.0, False),
    "times 0.97 to 1.03": (1.03, False),
    "times 0.5 to 2": (2.0, False),
    "1 % held up": (1.0, True),
    "both": (2.0, True),
}
MOST_MEETINGS = 100_000

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Trouble:
    """What happens to the actions of each head."""

    factor: tuple[Floats, ...]  # per head (actions,) of its planned time
    late_s: tuple[Floats, ...]  # per head (actions,) for which it is held up before it begins


@dataclass(frozen=True, slots=True)
class Run:
    """One execution of a joint plan."""

    makespan_s: float
    contacts: int  # pairs of actions of two heads that touch
    too_near: int  # those, and pairs nearer than the clearance
    rail_breaks: int  # pairs of heads that broke a rail's separation at some time
    too_early: int  # contours begun before what they rest on had ended


def random_trouble(name: str, legs: Legs, seed: int) -> Trouble:
    """Return trouble of a kind of `TROUBLES`; equal seeds give equal trouble."""
    most, held = TROUBLES[name]
    rng = np.random.default_rng([seed, 23])
    sizes = [len(actions) for actions in legs.whole]
    factor = [most ** rng.uniform(-1.0, 1.0, n) for n in sizes]
    late = [(rng.random(n) < HELD_UP) * rng.uniform(0.0, LATEST_S, n) * held for n in sizes]
    return Trouble(tuple(factor), tuple(late))


class Rehearsal:
    """A joint plan made ready to be executed again and again."""

    def __init__(self, document: PlanDocument) -> None:
        """Cut a plan into legs; ValueError for one that can not be executed."""
        all_actions = all_actions_of(document)
        self.document, self.legs = document, legs_of(all_actions)
        order = order_of(self.legs.all_actions)
        if not isinstance(order, PartialOrder):
            raise ValueError("the plan deadlocks")
        self._sequence: list[list[int]] = order.sequence.tolist()
        arrivals = [arrivals_of(document, actions) for actions in all_actions]
        self._passing = [self.legs.arrivals(h, times) for h, times in enumerate(arrivals)]
        self._planned: list[Floats] | None = None
        self._planned = self._begins(random_trouble("none", self.legs, 0))

    def run(self, trouble: Trouble, *, by_the_clock: bool) -> Run:
        """Execute the plan in this trouble and count what goes wrong."""
        begin = self._begins(trouble, self._planned if by_the_clock else None)
        machine, courses = self.document.machine, self._courses(begin, trouble)
        shared = shared_pieces(courses)
        met = [m for at, p in shared.items() for m in meetings(machine, p, at, "", MOST_MEETINGS)]
        contacts = sum(m.gap_mm <= 0.0 for m in met)
        broken = len(rail_breaks(machine, shared, ""))
        end = max((float(c.time[-1]) for c in courses), default=0.0)
        return Run(end, contacts, len(met), broken, self._too_early(begin, trouble))

    def _seconds(self, trouble: Trouble) -> list[Floats]:
        """Return how long each leg takes."""
        return [
            factor[origin] * times[actions.path_offsets[1:] - 1]
            for factor, origin, times, actions in zip(
                trouble.factor, self.legs.origin, self._passing, self.legs.all_actions, strict=True
            )
        ]

    def _begins(self, trouble: Trouble, planned: list[Floats] | None = None) -> list[Floats]:
        """Return when each leg begins; by the clock if there are planned times."""
        seconds = self._seconds(trouble)
        begin = [np.zeros(len(s)) for s in seconds]
        first = [self.legs.begins(h) for h in range(len(seconds))]
        for h, k in self._sequence:
            at = begin[h][k - 1] + seconds[h][k - 1] if k else 0.0
            if first[h][k]:
                due = self._due(h, k, begin, seconds) if planned is None else planned[h][k]
                at = max(at, due) + trouble.late_s[h][self.legs.origin[h][k]]
            begin[h][k] = at
        return begin

    def _due(self, h: int, k: int, begin: list[Floats], seconds: list[Floats]) -> float:
        """Return when all that a leg waits for has happened."""
        actions, due = self.legs.all_actions[h], 0.0
        for row in range(int(actions.after_offsets[k]), int(actions.after_offsets[k + 1])):
            s, a = int(actions.after_head[row]), int(actions.after_action[row])
            due = max(due, begin[s][a] + seconds[s][a] + actions.after_lag_s[row])
        return float(due)

    def _courses(self, begin: list[Floats], trouble: Trouble) -> list[Course]:
        """Return where each head is over time."""
        seconds = self._seconds(trouble)
        ends = [float((b + s).max()) for b, s in zip(begin, seconds, strict=True) if len(b)]
        end_s, heads = max(ends, default=0.0), self.document.machine.heads
        return [
            course_of(
                actions, begin[h], trouble.factor[h][self.legs.origin[h]], self._passing[h],
                np.array(heads[h].park), end_s,
            )
            for h, actions in enumerate(self.legs.all_actions)
        ]  # fmt: skip

    def _too_early(self, begin: list[Floats], trouble: Trouble) -> int:
        """Return how many contours begin before some contour they rest on has ended."""
        n, seconds = len(self.document.contours), self._seconds(trouble)
        start, end = np.zeros(n), np.zeros(n)
        for h, actions in enumerate(self.legs.all_actions):
            prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
            opens = prints[self.legs.begins(h)[prints]]
            start[actions.contour[opens]] = begin[h][opens]
            np.maximum.at(end, actions.contour[prints], begin[h][prints] + seconds[h][prints])
        before, after = self.document.precedence.reshape(-1, 2).T
        return len(np.unique(after[start[after] < end[before] - 1e-6]))
