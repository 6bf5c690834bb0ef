"""Numbers for the places where one head waits for another, the same in every file.

The heads of a plan start one after the other (numbers 1 to H: head i is homed
and parked), then every end of an action and every point within one that another
head waits for has a number, in the order of nominal ends. Last come H numbers for
heads that have printed all they have to, and H for heads whose end code has run:
it turns off the bed and the motors, so it must wait for the others, and it may
move, so one head goes after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.print.job import PrintJob
from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, JointPlan
from decmcts.print.signals import Action, Place, place_of, signals_of


@dataclass(frozen=True, slots=True)
class SyncPoints:
    """Which action signals which numbers, and which numbers each action waits for."""

    signals: Mapping[Action, int]  # number, given after it ends,
    at_rest: frozenset[Action]  # for which the head stands still: behind the others it goes on
    passed: Mapping[Action, Mapping[int, int]]  # vertex of its path -> number, given in motion
    waits: Mapping[Action, tuple[int, ...]]  # numbers, ascending
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
    waited = {
        (h, k): edges
        for h, head in enumerate(plan.heads)
        for k in np.flatnonzero(np.diff(head.after_offsets)).tolist()
        if (edges := [edge for edge in head.after_edges(k) if edge.head != h])
    }
    signals = signals_of(plan, job, interval_s)
    given = set(signals.at.values())
    first = len(plan.heads) + 1
    numbers = {at: first + n for n, at in enumerate(sorted(given, key=lambda at: _due(plan, at)))}
    last = first + len(numbers)
    done = tuple(range(last, last + len(plan.heads)))
    ended = tuple(range(last + len(plan.heads), last + 2 * len(plan.heads)))
    passed: dict[Action, dict[int, int]] = {}
    for (head, action, point), number in numbers.items():
        if point != ACTION_END:
            passed.setdefault((head, action), {})[point] = number
    return SyncPoints(
        {(h, a): number for (h, a, point), number in numbers.items() if point == ACTION_END},
        frozenset(signals.at_rest(plan, release)),
        passed,
        {
            at: tuple(sorted({numbers[signals.at[place_of(plan, edge)]] for edge in edges}))
            for at, edges in waited.items()
        },
        {
            at: lag
            for at, edges in waited.items()
            if (lag := max(edge.lag_s for edge in edges)) > 0.0
        },
        done,
        ended,
        signals.apart,
        _counted(len(plan.heads), numbers, done, ended),
    )


def _counted(
    heads: int, numbers: Mapping[Place, int], done: Sequence[int], ended: Sequence[int]
) -> dict[int, tuple[int, int]]:
    """Return the file and the count of each number, in the order in which files have them."""
    found = {}
    within: list[list[Place]] = [[] for _ in range(heads)]
    for place in sorted(numbers, key=lambda p: (p[0], p[1], p[2] == ACTION_END, p[2])):
        within[place[0]].append(place)
    for h, places in enumerate(within):
        every = [h + 1, *(numbers[place] for place in places), done[h], ended[h]]
        found.update({number: (h + 1, count) for count, number in enumerate(every, 1)})
    return found


def _due(plan: JointPlan, place: Place) -> tuple[float, int, int, bool, int]:
    """Return what sorts the numbers: nominal end of the action, and within it the points."""
    head, action, point = place
    end_s = float(plan.heads[head].end_s[action])
    return end_s, head, action, point == ACTION_END, point
