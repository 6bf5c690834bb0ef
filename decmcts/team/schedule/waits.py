"""Puts the waits for cooling into a plan for one head.

The head does not wait on the print: it lifts off where it stands, waits there,
and then goes on as planned. Straight up is always clear.

Where the heads of a team rest so that what is below can cool, as actions of a plan.

Heads have no common clock. So only the time counts that a head spends itself after
another head's contour has surely ended. If that is too short, the head rests for what
is missing, at the place where it is to print.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.motion import path_time, travel_feed
from decmcts.print.plan import ACTION_END, NO_CONTOUR, ActionKind, HeadActions, JointPlan
from decmcts.team.engine.waits_kernels import Rests, UnitOrder
from decmcts.team.schedule.timing import action_times

LIFT_MM = 2.0  # off the print while it cools
LEAST_WAIT_S = 0.25  # a shorter wait cools nothing and costs a retraction
STEP_S = 1e-3  # files give a dwell in whole milliseconds


@dataclass(slots=True)
class _NewAction:
    """One action of the new plan; `action` is the old one it is or belongs to."""

    kind: int
    action: int
    path: Floats
    seconds: float


def add_waits(job: PrintJob, machine: Machine, plan: JointPlan, lags: Lags) -> JointPlan:
    """Return the plan with every wait its lags ask for, to a quarter of a second.

    Each becomes a travel straight up, a wait for what is then left if that is more than a
    quarter of a second, and the travel from there to the next contour. Beads on both sides begin
    and end at rest.

    Raises
    ------
    ValueError
        If the plan has several heads: these have no common clock, so no wait is surely
        long enough for what another head printed (`decmcts.team.schedule.waits`).
    """
    if len(plan.heads) != 1:
        raise ValueError(f"waits for cooling are for one head, the plan has {len(plan.heads)}")
    if not len(lags.below):
        return plan
    rows = _rows(job, machine, plan.heads[0], lags)
    return JointPlan((_actions(plan.heads[0], rows),))


def _rows(job: PrintJob, machine: Machine, old: HeadActions, lags: Lags) -> list[_NewAction]:
    ended = np.zeros(len(job.contours))
    at_rest: Floats | None = None  # found where there is a wait
    rows: list[_NewAction] = []
    now = 0.0
    travels: list[_NewAction] = []  # to the next contour, not yet begun
    for k in range(len(old)):
        row = _NewAction(
            int(old.kind[k]), k, old.action_path(k), float(old.end_s[k] - old.begin_s[k])
        )
        if row.kind != ActionKind.PRINT:
            travels.append(row)
            continue
        contour = int(old.contour[k])
        below = slice(int(lags.offsets[contour]), int(lags.offsets[contour + 1]))
        cool = (ended[lags.below[below]] + lags.seconds[below]).max(initial=0.0)
        begin = now + sum(t.seconds for t in travels)
        if cool > begin + LEAST_WAIT_S:
            at_rest = _seconds_at_rest(job, machine, old) if at_rest is None else at_rest
            _stop(row, at_rest)
            if rows:  # the bead before the wait ends later, so what is due may as well
                now += _stop(rows[-1], at_rest)
                ended[old.contour[rows[-1].action]] = now
            travels = list(_waiting(job, machine, row, travels, cool - begin))
        now += sum(t.seconds for t in travels) + row.seconds
        ended[contour] = now
        rows += [*travels, row]
        travels = []
    return rows + travels


def _seconds_at_rest(job: PrintJob, machine: Machine, old: HeadActions) -> Floats:
    """Return how long each action takes from rest to rest, (k,)."""
    head = machine.head(old.head)
    times = action_times(
        job, machine.limits_of(head), old.path, old.path_offsets, old.contour, old.reversed,
        old.entry, rests=True,
    )  # fmt: skip
    return times.slowed(head.pace).seconds


def _stop(row: _NewAction, at_rest: Floats) -> float:
    """Let a bead begin and end at rest; returns how much longer it takes (mutates row)."""
    longer = max(0.0, float(at_rest[row.action]) - row.seconds)
    row.seconds += longer
    return longer


def _waiting(
    job: PrintJob, machine: Machine, to: _NewAction, travels: list[_NewAction], wait_s: float
) -> Iterator[_NewAction]:
    """Yield the path to a contour with a wait of `wait_s` in it, high above where it begins."""
    path = np.concatenate([t.path for t in travels] or [to.path[:1]])
    start, k = path[0], to.action
    rises = len(path) > 1 and (path[1, :2] == start[:2]).all() and path[1, 2] >= start[2]
    up = start.copy()
    up[2] = max(start[2], min(start[2] + LIFT_MM, machine.heads[0].reach_max[2]))
    if rises:
        up[2] = max(up[2], path[1, 2])
    rest = np.concatenate([up[None], path[1:] if rises else path])
    feed = travel_feed(job.settings, machine.limits)
    lift = path_time(np.stack([start, up]), feed, machine.limits)
    onward = max(sum(t.seconds for t in travels), path_time(rest, feed, machine.limits))
    saved = lift + onward - sum(t.seconds for t in travels)
    dwell = np.ceil((wait_s - saved) / STEP_S) * STEP_S
    if up[2] > start[2]:
        yield _NewAction(ActionKind.TRAVEL, k, np.stack([start, up]), lift)
    if dwell > LEAST_WAIT_S:
        yield _NewAction(ActionKind.WAIT, k, up[None], float(dwell))
    yield _NewAction(ActionKind.TRAVEL, k, rest, onward)


def _actions(old: HeadActions, rows: list[_NewAction]) -> HeadActions:
    kind = np.array([row.kind for row in rows], np.int8)
    was = np.array([row.action for row in rows], np.int64)
    printing = kind == ActionKind.PRINT
    end = np.cumsum([row.seconds for row in rows])
    return replace(
        old,
        kind=kind,
        contour=np.where(printing, old.contour[was], NO_CONTOUR).astype(np.int32),
        reversed=printing & old.reversed[was],
        entry=np.where(printing, old.entry[was], 0).astype(np.int32),
        path_offsets=np.cumsum([0, *(len(row.path) for row in rows)]).astype(np.int64),
        path=np.concatenate([row.path for row in rows]),
        begin_s=np.concatenate([[0.0], end[:-1]]),
        end_s=end,
        after_offsets=np.zeros(len(rows) + 1, np.int64),  # one head waits for no other
    )


def with_rests(plan: JointPlan, order: UnitOrder, rests: Rests) -> JointPlan:
    """Return the plan with the heads' rests as waits, and what they rest for."""
    mine_of = [order.of_head(r) for r in range(len(order.counts))]
    resting = [rests.seconds[rows] > 0.0 for rows in mine_of]
    shifted = [np.arange(len(mine)) + np.cumsum(mine) for mine in resting]
    count = int(rests.used[0])
    row, other = rests.row[:count], rests.other[:count]
    unit, first = rests.unit[:count], rests.first[:count]
    all_actions = []
    for r, (head, rows) in enumerate(zip(plan.heads, mine_of, strict=True)):
        mine, at = resting[r], shifted[r]
        edges = [
            (int(at[k]), g, int(shifted[g][a]), point)
            for k in np.flatnonzero(np.diff(head.after_offsets)).tolist()
            for g, a, point, _ in head.after_edges(k)
        ]
        cooling = np.flatnonzero(order.head[row] == r)
        edges += [
            (int(at[order.own[row[i]]]) - int(first[i]), int(other[i]),
             int(shifted[int(other[i])][unit[i]]), ACTION_END)
            for i in cooling.tolist()
        ]  # fmt: skip
        all_actions.append(
            _rested(head, mine, rests.begin[rows], rests.seconds[rows], sorted(edges))
        )
    return JointPlan(tuple(all_actions))


def _rested(
    head: HeadActions,
    resting: Flags,
    begin: Floats,
    seconds: Floats,
    edges: list[tuple[int, int, int, int]],
) -> HeadActions:
    """Return the actions of one head with a wait before each of those that rest.

    `edges` are action, other head, its action and its point, by the new actions' numbers.
    """
    repeats = 1 + resting.astype(np.int64)
    was = np.repeat(np.arange(len(resting)), repeats)
    waits = np.zeros(len(was), np.bool_)
    waits[np.cumsum(repeats)[resting] - 2] = True
    counts = np.where(waits, 1, np.diff(head.path_offsets)[was])
    offsets = np.cumsum([0, *counts]).astype(np.int64)
    source = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    source += np.repeat(head.path_offsets[was], counts)
    action, g, a, point = (
        np.array(column, np.int64) for column in (zip(*edges, strict=True) if edges else ((),) * 4)
    )
    return HeadActions(
        head=head.head,
        kind=np.where(waits, ActionKind.WAIT, head.kind[was]).astype(np.int8),
        contour=np.where(waits, NO_CONTOUR, head.contour[was]).astype(np.int32),
        reversed=head.reversed[was] & ~waits,
        entry=np.where(waits, 0, head.entry[was]).astype(np.int32),
        path_offsets=offsets,
        path=head.path[source],
        begin_s=np.where(waits, begin[was], head.begin_s[was]),
        end_s=np.where(waits, begin[was] + seconds[was], head.end_s[was]),
        after_offsets=np.searchsorted(action, np.arange(len(was) + 1)).astype(np.int64),
        after_head=g.astype(np.int32),
        after_action=a.astype(np.int32),
        after_point=point.astype(np.int32),
        after_lag_s=np.zeros(len(edges)),
    )
