"""From one toolpath per head to an exact plan that is safe for every timing.

Safe means rules J1-J5 of docs/definitions.md.

`decmcts.team.engine.order` decides who waits for whom; here every action gets its
path, checked against whatever may be printed by then, and its nominal times.
One head is a joint plan of one: same code. No search here.

The nominal times follow from the partial order and the time model: each action begins when
the one before it on its head, and those it comes after, have ended, and the head has
started again where it has stopped (`decmcts.team.schedule.standing`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.detours import Detours
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.plan import NO_CONTOUR, ActionKind, HeadActions, JointPlan
from decmcts.print.toolpath import Toolpath
from decmcts.print.walls import walls_for
from decmcts.team.engine.alone import hand_over
from decmcts.team.engine.joint_kernels import UNIT_PARK, UNIT_PRINT
from decmcts.team.engine.order import order_units, require_complete, visits_along
from decmcts.team.engine.space import build_space, fleet_of, printing_times
from decmcts.team.engine.waits_kernels import AT_END, UnitOrder, let_cool
from decmcts.team.schedule.standing import with_stops
from decmcts.team.schedule.timing import ActionTimes, action_times
from decmcts.team.schedule.travels import Paths, unit_travels
from decmcts.team.schedule.waits import LEAST_WAIT_S, STEP_S, with_rests


def schedule(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    toolpaths: Sequence[Toolpath],
    *,
    lags: Lags | None = None,
    detours: Detours | None = None,
) -> JointPlan:
    """Make the exact plan in which each head prints its toolpath in order.

    Parameters
    ----------
    toolpaths : Sequence[Toolpath]
        One per head of the machine, in the machine's order; together every
        contour once. A head may get none. If all but one get none, that one is
        an order for everything: contours its head can not print go to one that can.
    lags : Lags | None
        How long what is printed over must cool: heads rest where nothing else takes that
        long, to a quarter of a second. None: nothing has to.
    detours : Detours | None
        The paths of a single head's travels round outer walls. None: they go straight.

    Raises
    ------
    InputError
        A contour is missing, doubled, out of every head's reach or given to a
        head that can not print it, or the sequences contradict the precedence.
    """
    eligible = build_space(job, machine).eligible
    toolpaths = hand_over(toolpaths, eligible)
    require_complete(job, machine, eligible, toolpaths)
    seconds = printing_times(job, machine)
    entered, visits = visits_along(job, graph, machine, seconds, toolpaths, lags)
    order = order_units(visits, fleet_of(job, machine), machine, toolpaths)
    running = replace(job, contours=entered, acceleration=None)
    travels = unit_travels(running, machine, order, walls_for(job), detours)
    return _join_actions(job, machine, order, entered, travels, toolpaths, visits.lags)


def _join_actions(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    entered: Contours,
    travels: Paths,
    toolpaths: Sequence[Toolpath],
    lags: Lags,
) -> JointPlan:
    """Return the joint plan of these units.

    `travels` are the paths of units that do not print. Where something must cool the head rests
    where it is to print, until it may.
    """
    mine_of = [order.of_head(r) for r in range(len(machine.heads))]
    all_actions = [
        _untimed(head.name, entered, order, rows, travels, toolpath)
        for head, rows, toolpath in zip(machine.heads, mine_of, toolpaths, strict=True)
    ]
    times = [
        action_times(
            job, machine.limits_of(head), actions.path, actions.path_offsets, actions.contour,
            actions.reversed, actions.entry, rests=len(all_actions) > 1,
        ).slowed(head.pace)
        for head, actions in zip(machine.heads, all_actions, strict=True)
    ]  # fmt: skip
    seconds = np.zeros(len(order.head))
    for rows, timed in zip(mine_of, times, strict=True):
        seconds[rows] = timed.seconds
    passing = _passing(order, times)
    begin, rests = let_cool(order, passing, seconds, lags, LEAST_WAIT_S, STEP_S)
    plan = JointPlan(
        tuple(
            replace(actions, begin_s=begin[rows], end_s=begin[rows] + seconds[rows])
            for rows, actions in zip(mine_of, all_actions, strict=True)
        )
    )
    plan = with_rests(plan, order, rests) if len(lags.below) else plan
    return plan if len(machine.heads) < 2 else with_stops(plan, job, machine, times)


def _passing(order: UnitOrder, times: Sequence[ActionTimes]) -> Floats:
    """Return the seconds until what a unit waits for is passed, from its begin, (m, heads)."""
    passing = np.zeros(order.after.shape)
    for s, timed in enumerate(times):
        waits = np.flatnonzero(order.after[:, s] >= 0)
        action, point = order.after[waits, s], order.point[waits, s]
        passing[waits, s] = timed.seconds[action]
        within = point != AT_END
        passing[waits[within], s] = timed.until(action[within], point[within])
    return passing


def _untimed(
    name: str,
    entered: Contours,
    order: UnitOrder,
    rows: Ints,
    travels: Paths,
    toolpath: Toolpath,
) -> HeadActions:
    """Return the actions of one head, whose units are `rows`, all at time 0."""
    prints = order.kind[rows] == UNIT_PRINT
    kind = np.where(order.kind[rows] == UNIT_PARK, ActionKind.PARK, ActionKind.TRAVEL)
    contour = np.full(len(rows), NO_CONTOUR, np.int32)
    contour[prints] = order.contour[rows[prints]]
    is_reversed, entry = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    is_reversed[prints], entry[prints] = toolpath.reversed, toolpath.entry
    paths = _paths(entered, contour, is_reversed, rows, travels)
    waiting, head = np.nonzero(order.after[rows] >= 0)
    return HeadActions(
        head=name,
        kind=np.where(prints, ActionKind.PRINT, kind).astype(np.int8),
        contour=contour,
        reversed=is_reversed,
        entry=entry,
        path_offsets=paths.offsets,
        path=paths.points,
        begin_s=np.zeros(len(rows)),
        end_s=np.zeros(len(rows)),
        after_offsets=np.searchsorted(waiting, np.arange(len(rows) + 1)).astype(np.int64),
        after_head=head.astype(np.int32),
        after_action=order.after[rows[waiting], head].astype(np.int32),
        after_point=order.point[rows[waiting], head],
        after_lag_s=np.zeros(len(head)),
    )


def _paths(
    entered: Contours,
    contour: Int32s,
    is_reversed: Flags,
    rows: Ints,
    travels: Paths,
) -> Paths:
    """Return the nozzle's path of each action: that of its contour, else its unit's travel."""
    prints, printed = contour != NO_CONTOUR, entered.offsets + len(travels.points)
    begin = np.where(prints, printed[contour], travels.offsets[rows])
    end = np.where(prints, printed[contour + 1], travels.offsets[rows + 1])
    offsets = np.concatenate([[0], np.cumsum(end - begin)])
    first, step = np.where(is_reversed, end - 1, begin), np.where(is_reversed, -1, 1)
    along = np.arange(offsets[-1]) - np.repeat(offsets[:-1], end - begin)
    at = np.repeat(first, end - begin) + np.repeat(step, end - begin) * along
    return Paths(np.concatenate([travels.points, entered.points])[at], offsets)
