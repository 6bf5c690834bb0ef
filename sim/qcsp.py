"""Judging a schedule of cranes on one rail: where each crane is, moment by moment.

Slow and plain: it knows nothing of how schedules are made, only what a crane may
do. Each fault is a line. A crane stands where its path begins until it is ready,
never moves faster than the problem says, stands at a task's bay from its begin to
its end, and keeps its distance to all others the whole time; its path ends where
it then stays. Cranes that begin too near each other may only move apart until
they are as far apart as they must be, and keep that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations, pairwise

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.bare.qcsp import QcspProblem, QcspSchedule

TOLERANCE = 1e-6  # bays, and times relative to the makespan where that is above 1


def faults_of(problem: QcspProblem, schedule: QcspSchedule) -> list[str]:
    """Return what is wrong with a schedule, a line each; empty if it can be run as it is."""
    if faults := list(_malformed(problem, schedule)):
        return faults
    slack = TOLERANCE * max(1.0, schedule.makespan)
    faults = list(_wrong_times(problem, schedule, slack))
    for v, path in enumerate(schedule.paths):
        faults += _wrong_moves(problem, v, path, slack)
        faults += _wrong_stops(problem, schedule, v, path, slack)
    for (v, left), (w, right) in combinations(enumerate(schedule.paths), 2):
        faults += _too_near(v, w, left, right, problem.spacing * (w - v))
    return faults


def _position(path: Floats, time: float) -> float:
    return float(np.interp(time, path[:, 0], path[:, 1]))


def _malformed(problem: QcspProblem, schedule: QcspSchedule) -> Iterator[str]:
    """Yield what keeps a schedule from being judged at all."""
    n, q = len(problem), problem.cranes
    if len(schedule.crane) != n or len(schedule.begin) != n or len(schedule.paths) != q:
        yield f"not {n} tasks and {q} cranes"
        return
    for j, (v, begin) in enumerate(zip(schedule.crane, schedule.begin, strict=True)):
        if not 0 <= v < q:
            yield f"task {j + 1} is done by crane {v + 1}, there are {q}"
        if not (math.isfinite(begin) and begin >= 0.0):
            yield f"task {j + 1} begins at {begin}"
    for v, path in enumerate(schedule.paths):
        if path.ndim != 2 or path.shape[1] != 2 or not len(path):
            yield f"crane {v + 1} has no path"
        elif not np.isfinite(path).all() or (np.diff(path[:, 0]) <= 0.0).any():
            yield f"the path of crane {v + 1} does not go forward in time"
        elif path[0, 0] != 0.0:
            yield f"the path of crane {v + 1} begins at {path[0, 0]:g}, not at 0"
    if not math.isfinite(schedule.makespan):
        yield f"the makespan is {schedule.makespan}"


def _wrong_times(problem: QcspProblem, schedule: QcspSchedule, slack: float) -> Iterator[str]:
    """Yield tasks out of order, tasks a crane does at once, and a makespan that is not the end."""
    begin, end = schedule.begin, schedule.begin + problem.duration
    for i, j in problem.precedence:
        if begin[j] < end[i] - slack:
            yield f"task {j + 1} begins before task {i + 1} ends"
    for i, j in combinations(range(len(problem)), 2):
        at_once = begin[i] < end[j] - slack and begin[j] < end[i] - slack
        if at_once and schedule.crane[i] == schedule.crane[j]:
            yield f"crane {schedule.crane[i] + 1} does tasks {i + 1} and {j + 1} at once"
    last = max(end, default=0.0)
    if abs(last - schedule.makespan) > slack:
        yield f"the last task ends at {last:g}, not at {schedule.makespan:g}"


def _wrong_moves(problem: QcspProblem, v: int, path: Floats, slack: float) -> Iterator[str]:
    """Yield what a crane does before it is ready, and moves that are too fast."""
    start, ready = float(problem.start[v]), float(problem.ready[v])
    for time in [0.0, ready, *path[path[:, 0] < ready, 0]]:
        if abs(_position(path, time) - start) > TOLERANCE + slack / problem.travel:
            yield f"crane {v + 1} is not at bay {start:g} at {time:g}, ready from {ready:g} on"
    for (t0, x0), (t1, x1) in pairwise(path.tolist()):
        if abs(x1 - x0) * problem.travel > t1 - t0 + slack:
            yield f"crane {v + 1} moves from {x0:g} to {x1:g} in {t1 - t0:g}"


def _wrong_stops(
    problem: QcspProblem, schedule: QcspSchedule, v: int, path: Floats, slack: float
) -> Iterator[str]:
    """Yield tasks during which the crane is elsewhere, and tasks that begin before it is ready."""
    for j in np.flatnonzero(np.asarray(schedule.crane) == v).tolist():
        begin, bay = float(schedule.begin[j]), float(problem.bay[j])
        end = begin + float(problem.duration[j])
        if begin < problem.ready[v] - slack:
            yield f"task {j + 1} begins before crane {v + 1} is ready"
        within = path[(begin < path[:, 0]) & (path[:, 0] < end), 0]
        for time in [begin, *within, end]:
            if abs(_position(path, time) - bay) > TOLERANCE + slack / problem.travel:
                yield f"crane {v + 1} is not at task {j + 1} at {time:g}"
                break


def _too_near(v: int, w: int, left: Floats, right: Floats, needed: int) -> Iterator[str]:
    """Yield the first moment at which two cranes are nearer than they may be.

    Between rows of either path both move straight, so their distance does too.
    """
    least: float | None = None
    for time in np.union1d(left[:, 0], right[:, 0]).tolist():
        apart = _position(right, time) - _position(left, time)
        if least is not None and apart < least - TOLERANCE:
            yield (
                f"cranes {v + 1} and {w + 1} are {apart:g} bays apart at {time:g}, "
                f"{least:g} are needed"
            )
            return
        least = min(float(needed), apart if least is None else max(least, apart))
