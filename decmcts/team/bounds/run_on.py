"""What a head saves at most if it runs on from one contour to the next without coming to rest.

Heads of a team stand still between actions, for they may have to wait there. A head alone
does not: through a short travel without retraction, or where contours abut, it keeps the speed
that the time model allows (`decmcts.print.motion`). For bounds.

The least time to print each contour: by the fastest eligible head, from the best vertex.

For bounds. Travel is `decmcts.team.bounds.least_travel`'s. Times are those of
`decmcts.print.motion`, from rest to rest (a head alone may run on: `decmcts.team.bounds.run_on`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.loops import rotated
from decmcts.print.loops_kernels import Rotated
from decmcts.print.machine import Machine, MotionLimits
from decmcts.print.motion import Program, limit_rows, segment_times
from decmcts.print.seam import SeamEntries, entry_points, exit_points
from decmcts.team.schedule.timing import habit_of


@dataclass(frozen=True, slots=True)
class LeastTimes:
    """No plan spends less on printing, in seconds."""

    contour: Floats  # (n,)
    segment: Floats
    """(n_points,) of the segment ending at each point, 0 at a start. Those of a contour may sum
    to less than the contour's, since each is by the head and entry that are best for it."""


def least_times(
    job: PrintJob,
    machine: Machine,
    eligible: NDArray[np.bool_],
    entries: SeamEntries | None = None,
) -> LeastTimes:
    """Return the least times over the heads that may print each contour, and over its entries.

    O(heads with limits of their own · entries of one contour · points).

    Parameters
    ----------
    eligible : (n, heads)
        A contour that no head may print is taken to be any head's.
    entries : SeamEntries | None
        Where loops may be entered besides as sliced; None: nowhere.
    """
    contours = job.contours
    may = eligible | ~eligible.any(axis=1, keepdims=True)
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    least = LeastTimes(np.full(len(contours), np.inf), np.full(len(contours.points), np.inf))
    limits = [machine.limits_of(head) for head in machine.heads]
    kinds = {own: [k for k, other in enumerate(limits) if other == own] for own in limits}
    for entry in choices(entries, len(contours)):
        run, offsets = rotated(contours, entry)
        running = replace(
            contours, points=run.points, extrusion=run.extrusion, feed=run.feed, offsets=offsets
        )
        set_by = None if job.acceleration is None else job.acceleration[run.rows]
        for kind, heads in kinds.items():
            mine = np.asarray(may[:, heads].any(axis=1))
            seconds = segment_times(running, kind, set_by)
            whole = np.add.reduceat(seconds, offsets[:-1])
            parts = np.bincount(run.rows, seconds, len(owner))
            np.minimum(least.contour, whole, out=least.contour, where=mine)
            np.minimum(least.segment, parts, out=least.segment, where=mine[owner])
    return least


def choices(entries: SeamEntries | None, n: int) -> Iterator[NDArray[np.int32]]:
    """Yield vertices of all contours, (n,), until each contour had all it may be entered at."""
    yield np.zeros(n, np.int32)
    if entries is None:
        return
    first, count = entries.offsets[:-1], np.diff(entries.offsets)
    for k in range(int(count.max(initial=0))):
        chosen = entries.vertices[first + np.minimum(k, count - 1)]
        if chosen.any():
            yield chosen


RUN_UP_MM = 1e5  # before and behind a contour: enough to have any speed at its ends
Floats = NDArray[np.float64]


def saved_by_running_on(
    job: PrintJob, machine: Machine, entries: SeamEntries | None = None
) -> Floats:
    """Return the seconds by which each contour may be faster than from rest to rest, (n,).

    Less the share of the travel to the next contour that its end has to pay; 0 for a team.
    """
    n = len(job.contours)
    if len(machine.heads) != 1 or not n:
        return np.zeros(n)
    limits = machine.limits_of(machine.heads[0])
    saved = np.zeros((n, 2))
    for entry in choices(entries, n):
        np.maximum(saved, _of_free_ends(job, limits, entry), out=saved)
    left = np.maximum(saved - _paid(job, machine, limits, entries), 0.0)
    return np.asarray(left.sum(axis=1))


def _of_free_ends(job: PrintJob, limits: MotionLimits, entry: NDArray[np.int32]) -> Floats:
    """Return what contours save if they begin, and end, at any speed, (n, 2).

    Both ends together save no more than the sum of the two.
    """
    rest, begin, end, both = (
        _seconds(job, limits, entry, flying)
        for flying in ((False, False), (True, False), (False, True), (True, True))
    )
    first = rest - begin
    return np.stack([first, np.maximum(rest - end, rest - both - first)], axis=1)


def _seconds(
    job: PrintJob, limits: MotionLimits, entry: NDArray[np.int32], flying: tuple[bool, bool]
) -> Floats:
    """Return the seconds of each contour that begins or ends at speed or at rest, (n,).

    A straight run-up of the same kind stands before its first move, or behind its last: each
    contour has a point more at either side, where the first or last is, or far beyond.
    """
    run, offsets = rotated(job.contours, entry)
    stated = np.full(len(run.points), np.nan)
    if job.acceleration is not None:
        stated = job.acceleration[run.rows]
    rows, row = limit_rows(limits, stated)
    n, rim = len(offsets) - 1, np.column_stack([offsets[:-1], offsets[1:] - 1])
    source = np.insert(np.arange(len(run.points)), (rim + np.array([0, 1])).ravel(), rim.ravel())
    before, behind = (rim + 2 * np.arange(n)[:, None] + np.array([0, 2])).T
    inner = np.ones(len(source), np.bool_)
    inner[before] = inner[behind] = inner[before + 1] = False  # the first point has no segment
    filament = np.where(inner, run.extrusion[source], 0.0)
    feed = np.where(inner, run.feed[source], 0.0)
    points, kind = run.points[source], row[source]
    for side, (owner, move, far) in enumerate(_run_ups(run, offsets)):
        if flying[side]:
            point = (before, behind)[side][owner]
            points[point] += (
                (2 * side - 1) * far[:, None] * (run.points[move] - run.points[move - 1])
            )
            into = point + 1 - side
            filament[into], feed[into] = far * run.extrusion[move], run.feed[move]
            kind[into] = row[move]
    rest = np.zeros(len(source), np.bool_)
    rest[before] = True
    program = Program(points, filament[1:], feed[1:], kind[1:], rows, rest[1:])
    seconds = np.concatenate([[0.0], program.seconds()])
    return np.asarray(np.add.reduceat(np.where(inner, seconds, 0.0), before))


def _run_ups(
    run: Rotated, offsets: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], Floats]]:
    """Yield contours, their first moves, and how many of these make a run-up; then the last."""
    length = np.linalg.norm(np.diff(run.points, axis=0, prepend=run.points[:1]), axis=1)
    length = np.where(length > 0.0, length, np.abs(run.extrusion))
    moving = (run.feed > 0.0) & (length > 0.0)
    moving[offsets[:-1]] = False
    move = np.flatnonzero(moving)
    owner = np.searchsorted(offsets, move, side="right") - 1
    for edge in (np.diff(owner, prepend=-1) != 0, np.diff(owner, append=-1) != 0):
        yield owner[edge], move[edge], RUN_UP_MM / length[move[edge]]


def _paid(
    job: PrintJob, machine: Machine, limits: MotionLimits, entries: SeamEntries | None
) -> Floats:
    """Return the least seconds a head needs to leave, or reach, each end at speed, (n, 2).

    Half a bare travel to the nearest other contour, or to the park; or a wipe, if nothing is
    retracted before it. Infinite where travels are too long to be bare.
    """
    near = _distances(job, machine, entries)
    each = [_paid_by(settings, limits, near) for settings in job.settings.each()]
    return np.asarray(np.min(each, axis=0))


def _paid_by(settings: ProcessSettings, limits: MotionLimits, near: Floats) -> Floats:
    """Return the least seconds where a tool retracts so, (n, 2)."""
    habit = habit_of(settings, limits)
    paid = 0.5 * near / max(habit.feed, habit.z_feed)
    if settings.retract_mm <= 0.0:
        return paid
    bare = max(settings.retract_min_travel_mm, settings.bare_inside_mm)
    wipes = habit.wipe_mm > 0.0 and habit.pull_mm <= 0.0
    other = habit.wipe_mm / habit.wipe_feed + habit.push_mm / habit.push_feed if wipes else np.inf
    return np.where((near <= bare) | (near <= 0.0), np.minimum(paid, other), other)


def _distances(job: PrintJob, machine: Machine, entries: SeamEntries | None) -> Floats:
    """Return how far from each end the next other contour begins or ends, (n, 2) mm.

    0 for loops that may be entered elsewhere; of the others only two ends count.
    """
    contours, n = job.contours, len(job.contours)
    ends = np.stack([contours.start, contours.end], axis=1)
    places = np.concatenate([ends.reshape(-1, 3), [machine.heads[0].park]])
    owner = np.append(np.repeat(np.arange(n), 2), -1)
    moved = np.zeros(n, np.bool_)
    if entries is not None:
        moved = np.maximum.reduceat(entries.vertices, entries.offsets[:-1]) > 0
        elsewhere = entries.vertices > 0
        for found in (entry_points(contours, entries), exit_points(contours, entries)):
            places = np.concatenate([places, found[elsewhere]])
            owner = np.concatenate([owner, entries.contour()[elsewhere]])
    distance, found = cKDTree(places).query(ends.reshape(-1, 3), k=min(3, len(places)))
    mine = np.append(owner, -2)[found] == np.repeat(np.arange(n), 2)[:, None]
    near = np.where(mine, np.inf, distance).min(axis=1).reshape(n, 2)
    return np.where(moved[:, None], 0.0, near)
