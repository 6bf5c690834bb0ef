"""The programs of a plan whose files are not at hand: its actions, as long as it says.

A plan states paths, feeds and accelerations, but neither retractions nor the feed of travels. So
an action takes what its motion takes, and the head stands before it for what the plan says it
takes longer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.machine import MotionLimits
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument
from decmcts.print.signals import Place, places_of
from sim.content.seams import laid_by
from sim.controllers.motion import QUEUE, profile_of
from sim.controllers.program import HeadProgram, StopKind, Stops, stops_of

HAIR_S = 1e-4  # by which an action may be shorter than the plan says


def programs_of_plan(document: PlanDocument, queue: int = QUEUE) -> tuple[HeadProgram, ...]:
    """Return the program of each head of a plan that the judge has passed, or not."""
    signals = _signals(document.plan)
    return tuple(_program(document, h, signals, queue) for h in range(len(document.plan.heads)))


def program_of_head(document: PlanDocument, h: int, queue: int = QUEUE) -> HeadProgram:
    """Return the program of one head, with signals numbered as among all of them."""
    return _program(document, h, _signals(document.plan), queue)


def _signals(plan: JointPlan) -> dict[Place, int]:
    """Return the number of the signal of each place that another head waits for."""
    given = {
        place for h, head in enumerate(plan.heads) for place in places_of(plan, head)
        if place[0] != h
    }  # fmt: skip
    return {place: k for k, place in enumerate(sorted(given))}


def _program(document: PlanDocument, h: int, signals: dict[Place, int], queue: int) -> HeadProgram:
    actions, machine = document.plan.heads[h], document.machine
    head = machine.head(actions.head)
    limits = machine.limits_of(head)
    first, sizes = actions.path_offsets[:-1], np.diff(actions.path_offsets)
    inner = np.ones(len(actions.path), np.bool_)
    inner[first[sizes > 0]] = False  # a path begins where the one before it ended
    action = np.repeat(np.arange(len(actions)), sizes)[inner]
    feed, filament, rate = _of_prints(document, actions, limits)
    begin = actions.path[:1] if len(actions) else np.array([head.park])
    points = np.concatenate([begin, actions.path[inner]])
    own = np.where(np.nan_to_num(rate[inner]) > 0.0, rate[inner], limits.acceleration)
    kinds, row = np.unique(own, return_inverse=True)
    rows = tuple(replace(limits, acceleration=kind) for kind in kinds.tolist())
    program = HeadProgram(
        actions.head, points, filament[inner], feed[inner], row.astype(np.int64), rows,
        np.diff(action, prepend=-1) != 0, action, np.zeros(len(action), np.int64), stops_of([]),
    )  # fmt: skip
    motion = np.zeros(len(actions))
    np.add.at(motion, action, profile_of(program, queue).seconds)
    return replace(program, stops=_stops(document, h, signals, action, motion))


def _of_prints(
    document: PlanDocument, actions: HeadActions, limits: MotionLimits
) -> tuple[Floats, Floats, Floats]:
    """Return feed, filament and acceleration (NaN: the head's own) of each path's segments, (n,).

    They stand at the point that ends a segment.
    """
    contours, n = document.contours, len(actions.path)
    feed, filament, rate = np.full(n, limits.travel_feed), np.zeros(n), np.full(n, np.nan)
    stated = document.acceleration
    for a in np.flatnonzero(actions.kind == ActionKind.PRINT).tolist():
        laid = laid_by(contours, actions, a)
        rows = slice(int(actions.path_offsets[a]) + 1, int(actions.path_offsets[a + 1]))
        if isinstance(laid, str) or len(laid.feed) != rows.stop - rows.start:
            continue  # a wrong path is the judge's to report
        feed[rows], filament[rows] = laid.feed, laid.extrusion
        if stated is not None:
            rate[rows] = stated[laid.rows]
    return feed, filament, rate


def _stops(
    document: PlanDocument, h: int, signals: dict[Place, int], action: Ints, motion: Floats
) -> Stops:
    actions, rows = document.plan.heads[h], list[tuple[int, int, int, float]]()
    at_rest = document.machine.release == "action"
    awaited = places_of(document.plan, actions)
    place = np.searchsorted(action, np.arange(len(actions) + 1))
    due = actions.end_s - actions.begin_s - motion
    mine: dict[int, list[tuple[int, int]]] = {}
    for (g, a, point), number in signals.items():
        if g == h:
            mine.setdefault(a, []).append((point, number))
    for a in range(len(actions)):
        for edge in range(int(actions.after_offsets[a]), int(actions.after_offsets[a + 1])):
            if awaited[edge][0] != h:
                number, lag_s = signals[awaited[edge]], float(actions.after_lag_s[edge])
                rows.append((int(place[a]), StopKind.WAIT, number, lag_s))
        if due[a] > HAIR_S:
            rows.append((int(place[a]), StopKind.DWELL, -1, float(due[a])))
        for point, number in sorted(mine.get(a, ()), key=lambda x: (x[0] == ACTION_END, x[0])):
            below = int(place[a + 1]) if point == ACTION_END else int(place[a]) + point
            stands = at_rest or actions.kind[a] == ActionKind.WAIT
            kind = StopKind.SIGNAL if stands and point == ACTION_END else StopKind.PASS
            rows.append((below, kind, number, 0.0))
    return stops_of(rows)
