"""Units become actions: whole paths, waits and nominal times.

The times execute the partial order with the time model: each action begins
when the one before it on its head and those it comes after have ended.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.partial_order import earliest
from decmcts._kernels.units import UNIT_PARK, UNIT_PRINT, Visits
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import path_times, retraction_time, travel_feed
from decmcts.print.plan import NO_CONTOUR, ActionKind, HeadActions, JointPlan
from decmcts.print.toolpath import Toolpath, visit_points
from decmcts.team.order import UnitOrder


def join_actions(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    visits: Visits,
    travels: Sequence[NDArray[np.float64]],
    toolpaths: Sequence[Toolpath],
) -> JointPlan:
    """Return the joint plan of these units; `travels` are the paths of those that do not print."""
    seconds = _unit_seconds(job, machine, order, visits, travels)
    begin = earliest(order.head, order.own, order.rows, order.after, seconds)
    return JointPlan(
        tuple(
            _head_actions(machine.heads[r].name, r, job, order, begin, seconds, travels, toolpath)
            for r, toolpath in enumerate(toolpaths)
        )
    )


def _unit_seconds(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    visits: Visits,
    travels: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return how long each unit takes, (m,)."""
    feed = travel_feed(job.settings, machine.limits)
    offsets = np.cumsum([0, *(len(path) for path in travels)]).astype(np.int64)
    points = np.concatenate(travels) if travels else np.empty((0, 3))
    seconds = path_times(points, offsets, np.full(len(points), feed), machine.limits)
    flat = np.linalg.norm(points[offsets[1:] - 1, :2] - points[offsets[:-1], :2], axis=1)
    long = flat >= job.settings.retract_min_travel_mm
    seconds[long] += retraction_time(job.settings, np.inf)
    prints = order.kind == UNIT_PRINT
    seconds[prints] = visits.seconds[order.contour[prints]]
    return seconds


def _head_actions(
    name: str,
    r: int,
    job: PrintJob,
    order: UnitOrder,
    begin: NDArray[np.float64],
    seconds: NDArray[np.float64],
    travels: Sequence[NDArray[np.float64]],
    toolpath: Toolpath,
) -> HeadActions:
    """Write down the actions of head r."""
    rows = order.rows[r, : order.counts[r]]
    prints = order.kind[rows] == UNIT_PRINT
    kind = np.where(order.kind[rows] == UNIT_PARK, ActionKind.PARK, ActionKind.TRAVEL)
    contour = np.full(len(rows), NO_CONTOUR, np.int32)
    contour[prints] = order.contour[rows[prints]]
    flipped, entry = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    flipped[prints], entry[prints] = toolpath.reversed, toolpath.entry
    paths = _paths(job.contours, contour, flipped, entry, [travels[row] for row in rows])
    waiting, head = np.nonzero(order.after[rows] >= 0)
    return HeadActions(
        head=name,
        kind=np.where(prints, ActionKind.PRINT, kind).astype(np.int8),
        contour=contour,
        reversed=flipped,
        entry=entry,
        path_offsets=np.cumsum([0, *(len(path) for path in paths)]).astype(np.int64),
        path=np.concatenate(paths) if paths else np.empty((0, 3)),
        begin_s=begin[rows],
        end_s=begin[rows] + seconds[rows],
        after_offsets=np.searchsorted(waiting, np.arange(len(rows) + 1)).astype(np.int64),
        after_head=head.astype(np.int32),
        after_action=order.after[rows[waiting], head].astype(np.int32),
    )


def _paths(
    contours: Contours,
    contour: NDArray[np.int32],
    flipped: NDArray[np.bool_],
    entry: NDArray[np.int32],
    travels: Sequence[NDArray[np.float64]],
) -> list[NDArray[np.float64]]:
    """Return the nozzle's path of each action."""
    paths = list(travels)
    for i in np.flatnonzero(contour != NO_CONTOUR):
        c, turned, at = int(contour[i]), bool(flipped[i]), int(entry[i])
        paths[i] = visit_points(contours, c, reversed_=turned, entry=at)
    return paths
