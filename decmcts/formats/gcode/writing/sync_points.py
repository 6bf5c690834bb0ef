"""Numbers for the places where one head waits for another, the same in every file.

The heads of a plan start one after the other (numbers 1 to H: head i is homed
and parked), then every end of an action and every point within one that another
head waits for has a number, in the order of nominal ends. Last come H numbers for
heads that have printed all they have to, and H for heads whose end code has run:
it turns off the bed and the motors, so it must wait for the others, and it may
move, so one head goes after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, JointPlan

Action = tuple[int, int]  # head and action
Place = tuple[int, int, int]  # head, action and point
SPARE = 1.02  # times the interval, besides
SPARE_S = 1e-3  # for rounded paths and feeds

Fastest = Callable[[HeadActions, int], float]
"""The most speed, mm/s, a head has in one of its actions."""


@dataclass(frozen=True, slots=True)
class SyncPoints:
    """Which action signals which numbers, and which numbers each action waits for."""

    signals: Mapping[Action, int]  # number, given after it ends
    passed: Mapping[Action, Mapping[int, int]]  # vertex of its path -> number, given in motion
    waits: Mapping[Action, tuple[int, ...]]  # numbers, ascending
    lags: Mapping[Action, float]  # seconds to dwell after these; 0 is left out
    done: tuple[int, ...]  # (heads,) given when a head has nothing left to print and is parked
    ended: tuple[int, ...]  # (heads,) given when a head's end code has run
    apart: frozenset[Action] = frozenset()  # before whose signal the head has to stand a while;
    # the action behind its last one: before that it is done


def number_sync_points(
    plan: JointPlan, interval_s: float = 0.0, fastest: Fastest | None = None
) -> SyncPoints:
    """Return the synchronisation points of a joint plan.

    Signals nearer than `interval_s` by the speeds of `fastest` are one, at the later point of the
    same action. Within an action a head waits for nobody, so no wait becomes part of a cycle.
    """
    waited = {
        (h, k): edges
        for h, head in enumerate(plan.heads)
        for k in range(len(head))
        if (edges := [edge for edge in head.after_edges(k) if edge.head != h])
    }
    asked = {_place(plan, edge) for edges in waited.values() for edge in edges}
    at_place, apart = {place: place for place in asked}, frozenset[Action]()
    if interval_s > 0.0 and fastest is not None:
        at_place, apart = _merged(plan, asked, interval_s * SPARE + SPARE_S, fastest)
    given = set(at_place.values())
    first = len(plan.heads) + 1
    numbers = {at: first + n for n, at in enumerate(sorted(given, key=lambda at: _due(plan, at)))}
    last = first + len(numbers)
    passed: dict[Action, dict[int, int]] = {}
    for (head, action, point), number in numbers.items():
        if point != ACTION_END:
            passed.setdefault((head, action), {})[point] = number
    return SyncPoints(
        {(h, a): number for (h, a, point), number in numbers.items() if point == ACTION_END},
        passed,
        {
            at: tuple(sorted({numbers[at_place[_place(plan, edge)]] for edge in edges}))
            for at, edges in waited.items()
        },
        {
            at: lag
            for at, edges in waited.items()
            if (lag := max(edge.lag_s for edge in edges)) > 0.0
        },
        tuple(range(last, last + len(plan.heads))),
        tuple(range(last + len(plan.heads), last + 2 * len(plan.heads))),
        apart,
    )


def _merged(
    plan: JointPlan, asked: set[Place], interval_s: float, fastest: Fastest
) -> tuple[dict[Place, Place], frozenset[Action]]:
    """Return where each place is signalled, and the actions before whose signals heads stand."""
    found: dict[Place, Place] = {}
    apart: set[Action] = set()
    for h, head in enumerate(plan.heads):
        points: dict[int, list[int]] = {}
        for place in asked:
            if place[0] == h:
                points.setdefault(place[1], []).append(place[2])
        begun, told = 0.0, 0.0  # least seconds: of the action, and when the last signal was given
        for k in range(len(head)):
            clock = begun + _clock(head, k, fastest)
            begun = float(clock[-1])
            kept, target = _spread(points.get(k, []), clock, told, interval_s)
            found.update({(h, k, p): (h, k, to) for p, to in target.items()})
            if kept == [ACTION_END] and clock[-1] - told < interval_s:
                apart.add((h, k))
                begun += interval_s
            told = (begun if kept[-1] == ACTION_END else float(clock[kept[-1]])) if kept else told
        if begun - told < interval_s:
            apart.add((h, len(head)))
    return found, frozenset(apart)


def _clock(head: HeadActions, k: int, fastest: Fastest) -> NDArray[np.float64]:
    """Return the least seconds to each point of an action, from its begin, (n,)."""
    if head.kind[k] == ActionKind.WAIT:
        return np.array([float(head.end_s[k] - head.begin_s[k])])
    length = np.linalg.norm(np.diff(head.action_path(k), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(length) / fastest(head, k)])


def _spread(
    points: list[int], clock: NDArray[np.float64], told: float, interval_s: float
) -> tuple[list[int], dict[int, int]]:
    """Return the points of an action that are signalled, and for each point that which is its.

    Points are in their order, `ACTION_END` last. Each is at least `interval_s` after the one
    before and after `told`, but an end, at which the head can stand.
    """
    due = sorted(points, key=lambda p: len(clock) if p == ACTION_END else p)
    kept: list[int] = []
    for point in reversed(due):
        if not kept or clock[kept[-1]] - clock[point] >= interval_s:  # the end is clock[-1]
            kept.append(point)
    kept.reverse()
    while kept and kept[0] != ACTION_END and clock[kept[0]] - told < interval_s:
        kept = kept[1:] or [ACTION_END]
    rank = {p: len(clock) if p == ACTION_END else p for p in (*due, *kept)}
    return kept, {p: next(to for to in kept if rank[to] >= rank[p]) for p in due}


def _place(plan: JointPlan, edge: After) -> tuple[int, int, int]:
    """Return head, action and point of what is waited for; its last point is its end."""
    offsets = plan.heads[edge.head].path_offsets
    last = int(offsets[edge.action + 1] - offsets[edge.action]) - 1
    return edge.head, edge.action, ACTION_END if edge.point == last else edge.point


def _due(plan: JointPlan, place: tuple[int, int, int]) -> tuple[float, int, int, bool, int]:
    """Return what sorts the numbers: nominal end of the action, and within it the points."""
    head, action, point = place
    end_s = float(plan.heads[head].end_s[action])
    return end_s, head, action, point == ACTION_END, point
