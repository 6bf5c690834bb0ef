"""Which places of a plan heads signal, so that their controllers tell any two apart.

A controller that drops changes of an output nearer than some interval must not give two signals
within it. Of nearer ones one is given, at the later point of the same action. At the end of an
action the head may stand until it is time. Planner and writer of files ask here; the judge has
logic of its own (`sim.heads.order`, `sim.replay.nominal`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.job import DEFAULT_TRAVEL, PrintJob
from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, JointPlan

Action = tuple[int, int]  # head and action
Place = tuple[int, int, int]  # head, action and point
SPARE = 1.02  # times the interval, besides
SPARE_S = 1e-3  # for rounded paths and feeds
ROUNDING_MM = 1e-3  # of positions in files


@dataclass(frozen=True, slots=True)
class Signals:
    """What each head signals."""

    at: Mapping[Place, Place]  # where each place that is waited for is signalled
    apart: frozenset[Action] = frozenset()  # before whose signal the head has to stand a while;
    # the action behind its last one: before that it is done

    def at_rest(self, plan: JointPlan, release: Release) -> set[Action]:
        """Return the actions behind which a head stands still to signal that they have ended.

        Where controllers signal in motion it does where it has not moved, and where it has to
        stand anyway.
        """
        ended = {(h, k) for h, k, point in self.at.values() if point == ACTION_END}
        if release == "action":
            return ended
        stays = [_stays(head) for head in plan.heads]
        return {(h, k) for h, k in ended if (h, k) in self.apart or stays[h][k]}


def _stays(head: HeadActions) -> list[bool]:
    """Tell for which actions a head's file has no move."""
    farther = np.zeros(len(head.path), np.bool_)
    for axis in head.path.T:
        farther[1:] |= np.abs(np.diff(axis)) > ROUNDING_MM
    farther[head.path_offsets[:-1]] = False
    moved = np.concatenate([[0], np.cumsum(farther)])
    still = moved[head.path_offsets[1:]] == moved[head.path_offsets[:-1]]
    still = (head.kind == ActionKind.WAIT) | (still & (head.kind != ActionKind.PRINT))
    found: list[bool] = still.tolist()
    return found


def place_of(plan: JointPlan, edge: After) -> Place:
    """Return head, action and point of what is waited for; its last point is its end."""
    offsets = plan.heads[edge.head].path_offsets
    last = int(offsets[edge.action + 1] - offsets[edge.action]) - 1
    return edge.head, edge.action, ACTION_END if edge.point == last else edge.point


def places_of(plan: JointPlan, head: HeadActions) -> list[Place]:
    """Return the place of each edge into a head, as `place_of` does."""
    point = head.after_point.copy()
    for g, other in enumerate(plan.heads):
        mine = head.after_head == g
        last = np.diff(other.path_offsets)[head.after_action[mine]] - 1
        point[mine] = np.where(point[mine] == last, ACTION_END, point[mine])
    columns = head.after_head, head.after_action, point
    return list(zip(*(column.tolist() for column in columns), strict=True))


def apart_s(interval_s: float) -> float:
    """Return how far apart signals are put for a controller that needs this interval, s."""
    return interval_s * SPARE + SPARE_S


def signals_of(plan: JointPlan, job: PrintJob, interval_s: float) -> Signals:
    """Return where heads signal what others wait for, at least `interval_s` apart.

    Times are the least that the moves of a file can take, so they do not depend on limits. Within
    an action a head waits for nobody, so no wait becomes part of a cycle. Complexity O(points).
    """
    asked = {
        place
        for h, head in enumerate(plan.heads)
        for place in places_of(plan, head)
        if place[0] != h
    }
    if interval_s <= 0.0:
        return Signals({place: place for place in asked})
    due_s = apart_s(interval_s)
    points: dict[Action, list[int]] = {}
    for h, k, point in asked:
        points.setdefault((h, k), []).append(point)
    found: dict[Place, Place] = {}
    apart: set[Action] = set()
    for h, head in enumerate(plan.heads):
        clock, stood, given_s = _clock(job, head), 0.0, 0.0  # when the last signal was given
        for k in sorted(action for g, action in points if g == h):
            first, end = int(head.path_offsets[k]), int(head.path_offsets[k + 1])
            passed = clock[first:end] + stood
            kept, target = _spread(points[h, k], passed, given_s, due_s)
            found.update({(h, k, p): (h, k, to) for p, to in target.items()})
            if kept == [ACTION_END] and passed[-1] - given_s < due_s:
                apart.add((h, k))
                stood += due_s
                given_s = float(passed[-1]) + due_s
            else:
                given_s = float(passed[-1] if kept[-1] == ACTION_END else passed[kept[-1]])
        if (float(clock[-1]) if len(clock) else 0.0) + stood - given_s < due_s:
            apart.add((h, len(head)))
    return Signals(found, frozenset(apart))


def _clock(job: PrintJob, head: HeadActions) -> Floats:
    """Return the least seconds until a head has come to each point of its paths, (n,)."""
    prints, c = head.kind == ActionKind.PRINT, job.contours
    fastest = np.full(
        len(head), max(job.settings.travel_feed or DEFAULT_TRAVEL, job.settings.z_feed)
    )
    if prints.any():
        most = np.maximum(np.maximum.reduceat(c.feed, c.offsets[:-1]), 1e-3)
        fastest[prints] = most[head.contour[prints]]
    length = np.linalg.norm(np.diff(head.path, axis=0, prepend=head.path[:1]), axis=1)
    length[head.path_offsets[:-1]] = 0.0
    seconds = length / np.repeat(fastest, np.diff(head.path_offsets))
    waits = np.flatnonzero(head.kind == ActionKind.WAIT)
    seconds[head.path_offsets[waits + 1] - 1] += head.end_s[waits] - head.begin_s[waits]
    return np.asarray(np.cumsum(seconds))


def _spread(
    points: list[int], clock: Floats, given_s: float, interval_s: float
) -> tuple[list[int], dict[int, int]]:
    """Return the points of an action that are signalled, and for each point that which is its.

    Points are in their order, `ACTION_END` last. Each is at least `interval_s` after the one
    before and after `given_s`, but an end, at which the head can stand.
    """
    due = sorted(points, key=lambda p: len(clock) if p == ACTION_END else p)
    kept: list[int] = []
    for point in reversed(due):
        if not kept or clock[kept[-1]] - clock[point] >= interval_s:  # the end is clock[-1]
            kept.append(point)
    kept.reverse()
    while kept and kept[0] != ACTION_END and clock[kept[0]] - given_s < interval_s:
        kept = kept[1:] or [ACTION_END]
    rank = {p: len(clock) if p == ACTION_END else p for p in (*due, *kept)}
    return kept, {p: next(to for to in kept if rank[to] >= rank[p]) for p in due}
