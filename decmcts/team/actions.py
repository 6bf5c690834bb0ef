"""Units become actions: travels and prints with whole paths, waits and nominal times.

The exact times execute the partial order: each action begins when the one
before it on its head and those it comes after have ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.schedule import UNIT_PARK, UNIT_PRINT, Visits
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import path_times, retraction_time, travel_feed
from decmcts.print.plan import NO_CONTOUR, ActionKind, HeadActions, JointPlan
from decmcts.print.toolpath import Toolpath, visit_points
from decmcts.team.order import UnitOrder


@dataclass(frozen=True, slots=True)
class _UnitTimes:
    """Seconds and nominal times of each unit."""

    travel_s: NDArray[np.float64]  # (m,)
    print_s: NDArray[np.float64]  # (m,)
    begin_s: NDArray[np.float64]  # (m,)


def join_actions(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    visits: Visits,
    travels: Sequence[NDArray[np.float64]],
    toolpaths: Sequence[Toolpath],
) -> JointPlan:
    """Return the joint plan of these units; `travels` are the paths to where each works."""
    times = _time_units(job, machine, order, visits, travels)
    moves = np.array(
        [
            len(path) > 1 or kind != UNIT_PRINT
            for path, kind in zip(travels, order.kind, strict=True)
        ]
    )
    actions = moves.astype(np.int64) + (order.kind == UNIT_PRINT)
    last = _last_actions(order, actions)
    return JointPlan(
        tuple(
            _head_actions(job, machine, order, r, times, travels, moves, last, toolpaths[r])
            for r in range(len(order.counts))
        )
    )


def _last_actions(order: UnitOrder, actions: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index, within its head's actions, of the last action of each unit."""
    last = np.empty(len(order.head), np.int64)
    for r in range(len(order.counts)):
        mine = order.rows[r, : order.counts[r]]
        last[mine] = np.cumsum(actions[mine]) - 1
    return last


def _time_units(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    visits: Visits,
    travels: Sequence[NDArray[np.float64]],
) -> _UnitTimes:
    """Execute the partial order with the time model."""
    feed = travel_feed(job.settings, machine.limits)
    offsets = np.cumsum([0, *(len(path) for path in travels)]).astype(np.int64)
    points = np.concatenate(travels) if travels else np.empty((0, 3))
    travel = path_times(points, offsets, np.full(len(points), feed), machine.limits)
    for row, path in enumerate(travels):
        flat = float(np.hypot(*(path[-1, :2] - path[0, :2])))
        travel[row] += retraction_time(job.settings, flat)
    printing = np.where(order.contour >= 0, visits.seconds[order.contour], 0.0)
    begin = _earliest(order, travel + printing)
    return _UnitTimes(travel, printing, begin)


def _earliest(order: UnitOrder, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return when each unit begins if all begin as early as the partial order allows, (m,)."""
    begin, end = np.zeros(len(seconds)), np.zeros(len(seconds))
    for row in range(len(seconds)):
        r = order.head[row]
        waits = [order.rows[s, k] for s, k in enumerate(order.after[row]) if k >= 0]
        if order.own[row]:
            waits.append(order.rows[r, order.own[row] - 1])
        begin[row] = max((end[wait] for wait in waits), default=0.0)
        end[row] = begin[row] + seconds[row]
    return begin


def _head_actions(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    r: int,
    times: _UnitTimes,
    travels: Sequence[NDArray[np.float64]],
    moves: NDArray[np.bool_],
    last: NDArray[np.int64],
    toolpath: Toolpath,
) -> HeadActions:
    """Write down the actions of head r."""
    rows: list[tuple[int, int, bool, int, float, float]] = []
    paths: list[NDArray[np.float64]] = []
    after: list[list[tuple[int, int]]] = []
    printed = 0
    for unit in order.rows[r, : order.counts[r]]:
        waits = [
            (s, int(last[order.rows[s, k]])) for s, k in enumerate(order.after[unit]) if k >= 0
        ]
        begin, middle = times.begin_s[unit], times.begin_s[unit] + times.travel_s[unit]
        if moves[unit]:
            kind = ActionKind.PARK if order.kind[unit] == UNIT_PARK else ActionKind.TRAVEL
            rows.append((kind, NO_CONTOUR, False, 0, begin, middle))
            paths.append(travels[unit])
            after.append(waits)
            waits = []
        if order.kind[unit] == UNIT_PRINT:
            contour = int(order.contour[unit])
            flip, entry = bool(toolpath.reversed[printed]), int(toolpath.entry[printed])
            printed += 1
            end = middle + times.print_s[unit]
            rows.append((ActionKind.PRINT, contour, flip, entry, middle, end))
            paths.append(visit_points(job.contours, contour, reversed_=flip, entry=entry))
            after.append(waits)
    return _pack(machine.heads[r].name, rows, paths, after)


def _pack(
    name: str,
    rows: list[tuple[int, int, bool, int, float, float]],
    paths: list[NDArray[np.float64]],
    after: list[list[tuple[int, int]]],
) -> HeadActions:
    """Turn lists into the arrays of `HeadActions`."""
    kind, contour, flipped, entry, begin, end = zip(*rows, strict=True) if rows else ((),) * 6
    flat = [pair for waits in after for pair in waits]
    pairs = np.array(flat, np.int32).reshape(-1, 2)
    return HeadActions(
        head=name,
        kind=np.array(kind, np.int8),
        contour=np.array(contour, np.int32),
        reversed=np.array(flipped, np.bool_),
        entry=np.array(entry, np.int32),
        path_offsets=np.cumsum([0, *(len(path) for path in paths)]).astype(np.int64),
        path=np.concatenate(paths) if paths else np.empty((0, 3)),
        begin_s=np.array(begin, np.float64),
        end_s=np.array(end, np.float64),
        after_offsets=np.cumsum([0, *(len(waits) for waits in after)]).astype(np.int64),
        after_head=np.ascontiguousarray(pairs[:, 0]),
        after_action=np.ascontiguousarray(pairs[:, 1]),
    )
