"""What heads lose where they stop for one another, in the times of a joint plan.

Behind a wait, and behind a signal at rest, a controller has run out of moves and takes
`rest_s` until the head moves again. Whether a wait is over already when a head comes to it
depends on the timing, so all of them cost that much. Where heads signal in motion, signals are
`signal_interval_s` apart (`decmcts.print.signals`): waits for points too near to another become
waits for later ones, and where a head must stand before it may signal, its action ends later.

Where a head has stood idle its next bead begins later: it is pushed forth again, and primed. Where
that is depends on the times, so these are found twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import filament_time
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan
from decmcts.print.signals import Signals, apart_s, places_of, signals_of
from decmcts.print.stands import practice_of, primed_before, stands_of
from decmcts.team.schedule.standing_kernels import times_with_stops
from decmcts.team.schedule.timing import ActionTimes


def with_stops(
    plan: JointPlan, job: PrintJob, machine: Machine, times: Sequence[ActionTimes]
) -> JointPlan:
    """Return the plan of several heads with waits for what is signalled, and times with stops.

    `times` are those of the heads' actions without their waits for cooling.
    """
    interval_s = machine.signal_interval_s if machine.release == "point" else 0.0
    signals = signals_of(plan, job, interval_s)
    plan = JointPlan(tuple(_waiting(plan, h, signals) for h in range(len(plan.heads))))
    stands = _stands(plan, machine, signals)
    seconds = [head.end_s - head.begin_s for head in plan.heads]
    for h, k in signals.apart:
        if k < len(plan.heads[h]):
            seconds[h][k] += apart_s(interval_s)
    first = np.cumsum([0, *map(len, plan.heads)]).astype(np.int64)
    counts = np.concatenate([np.diff(head.after_offsets) for head in plan.heads])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    after = np.concatenate([first[head.after_head] + head.after_action for head in plan.heads])

    def timed(more: Sequence[Floats]) -> JointPlan:
        longer = [own + beyond for own, beyond in zip(seconds, more, strict=True)]
        passing = [_passing(plan, head, longer, times, more) for head in plan.heads]
        taken = np.concatenate(longer)
        begin = times_with_stops(
            first, offsets, after.astype(np.int64), np.concatenate(passing),
            np.concatenate(stands), taken,
        )  # fmt: skip
        return JointPlan(
            tuple(
                replace(head, begin_s=begin[a:b], end_s=begin[a:b] + taken[a:b])
                for head, a, b in zip(plan.heads, first[:-1], first[1:], strict=True)
            )
        )

    found = timed([np.zeros(len(head)) for head in plan.heads])
    more = [_idle_seconds(head, h, job, machine) for h, head in enumerate(found.heads)]
    return timed(more) if any(beyond.any() for beyond in more) else found


def _waiting(plan: JointPlan, h: int, signals: Signals) -> HeadActions:
    """Return the actions of one head, which wait for what is signalled."""
    head = plan.heads[h]
    points, places = head.after_point.copy(), places_of(plan, head)
    for row in np.flatnonzero((points != ACTION_END) & (head.after_head != h)).tolist():
        points[row] = signals.at[places[row]][2]
    return replace(head, after_point=points)


def _stands(plan: JointPlan, machine: Machine, signals: Signals) -> list[Floats]:
    """Return the seconds that each head stands before its actions, so that it can start."""
    at_rest = signals.at_rest(plan, machine.release)
    stands = []
    for h, head in enumerate(plan.heads):
        stops = np.diff(head.after_offsets) > 0
        behind = [k + 1 for g, k in at_rest if g == h and k + 1 < len(head)]
        stops[behind] = True
        stands.append(np.where(stops, machine.rest_s, 0.0))
    return stands


def _passing(
    plan: JointPlan, head: HeadActions, seconds: Sequence[Floats], times: Sequence[ActionTimes],
    more: Sequence[Floats],
) -> Floats:  # fmt: skip
    """Return the seconds from the begin of what a head waits for until it may go on, (m,).

    `more` of those that each action takes pass before its head moves.
    """
    found = np.empty(len(head.after_head))
    for g, other in enumerate(plan.heads):
        mine = head.after_head == g
        action, point = head.after_action[mine].astype(np.int64), head.after_point[mine]
        timed = seconds[g][action].copy()
        within = point != ACTION_END
        unit = np.cumsum(other.kind != ActionKind.WAIT) - 1  # `times` has no waits
        timed[within] = times[g].until(unit[action[within]], point[within])
        timed[within] += more[g][action[within]]
        found[mine] = timed
    return np.asarray(found + head.after_lag_s)


def _idle_seconds(actions: HeadActions, h: int, job: PrintJob, machine: Machine) -> Floats:
    """Return by how much the actions of head number h take longer, (k,) seconds.

    It is pulled back while it stands, and hot again by then, which takes no time of the plan.
    """
    head, more = machine.heads[h], np.zeros(len(actions))
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    if not len(prints):
        return more
    practice, settings = practice_of(actions, job, head.idle)
    usual = settings.retract_mm
    deep = max(usual, practice.retract_mm)
    stands = stands_of(actions, h, job.contours.epoch, head.idle.after_s)
    pulled = np.zeros(len(actions), np.bool_)
    pulled[prints[np.searchsorted(prints, list(stands))]] = True
    primed = primed_before(actions, head.idle.after_s)
    limits, feed = machine.limits_of(head), settings.unretract_feed
    before = filament_time(usual, feed, limits)
    for k in np.flatnonzero(pulled | primed).tolist():
        pushed = (deep if pulled[k] else usual) + (practice.prime_mm if primed[k] else 0.0)
        more[k] = (filament_time(pushed, feed, limits) - before) * head.pace
    return more
