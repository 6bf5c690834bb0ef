"""How long each action of a head takes: its moves, as they will be written, through the time model.

Wipe, retraction, lift and priming are counted. The code around the print (start and
end G-code, blocks) is not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.loops import rotated
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import Program, limit_rows, travel_acceleration, travel_feed
from decmcts.print.walls import retracted_paths, walls_for
from decmcts.team.schedule.timing_kernels import ContourSegments, Habit, write_moves


@dataclass(frozen=True, slots=True)
class ActionTimes:
    """How long the actions of a head take, and their moves."""

    seconds: Floats  # (k,)
    passed: Floats  # (moves + 1,) seconds from the first action's begin, without waits
    first: Ints  # (k,) first move of each action

    def until(self, action: Ints, point: Int32s) -> Floats:
        """Return the seconds from the begins of prints until a vertex is passed, (j,)."""
        first = self.first[action]
        return np.asarray(self.passed[first + point] - self.passed[first])

    def slowed(self, pace: float) -> ActionTimes:
        """Return the times of a head for which all takes `pace` times as long."""
        return ActionTimes(self.seconds * pace, self.passed * pace, self.first)


def action_times(
    job: PrintJob,
    limits: MotionLimits,
    path: Floats,
    offsets: Ints,
    contour: Int32s,
    is_reversed: Flags,
    entry: Int32s,
    *,
    rests: bool,
) -> ActionTimes:
    """Return how long the actions of one head take, k of them.

    Parameters
    ----------
    path : (m, 3) mm, of all actions one after the other
    offsets : (k + 1,) action i owns path[offsets[i]:offsets[i + 1]]
    contour, is_reversed, entry : (k,) what it prints and how; contour -1: it travels
    rests : bool
        Whether the head stands still between two actions, as where it may have to wait.
    """
    c, settings = job.contours, job.settings
    travelling = replace(limits, travel_acceleration=travel_acceleration(settings, limits))
    stated = np.full(len(c.points), np.nan) if job.acceleration is None else job.acceleration
    rows, row = limit_rows(travelling, stated)
    habits = np.array([habit_of(one, limits) for one in settings.each()])
    retracts = retracted_paths(walls_for(job), settings, path, offsets)
    entries = np.zeros(len(c), np.int32)
    entries[contour[contour >= 0]] = entry[contour >= 0]
    run, first = rotated(c, entries)
    segments = ContourSegments(first, run.extrusion, run.feed, row[run.rows])
    kinds = kinds_of(job, contour)
    moves = write_moves(path, offsets, contour, is_reversed, retracts, segments, habits, kinds)
    m = int(moves.used[0])
    action = moves.action[:m]
    rest = np.diff(action, prepend=-1) != 0 if rests else np.zeros(m, np.bool_)
    program = Program(
        moves.points[: m + 1], moves.filament[:m], moves.feed[:m], moves.row[:m], rows, rest
    )
    seconds = program.seconds()
    return ActionTimes(
        np.asarray(np.bincount(action, seconds, len(contour)), np.float64),
        np.concatenate([[0.0], np.cumsum(seconds)]),
        np.searchsorted(action, np.arange(len(contour))),
    )


def kinds_of(job: PrintJob, contour: Int32s) -> Ints:
    """Return for each action of a head which of `ProcessSettings.each` it is made with, (k,).

    A travel is made with the tool that prints next. `contour` (k,) is below 0 for travels.
    """
    printing = np.flatnonzero(contour >= 0)
    if not job.settings.of_tools or not len(printing):
        return np.zeros(len(contour), np.int64)
    of_contour = np.zeros(len(job.contours), np.int64)
    for k, (tool, _) in enumerate(job.settings.of_tools, 1):
        of_contour[job.contours.tool == tool] = k
    ahead = np.minimum(np.searchsorted(printing, np.arange(len(contour))), len(printing) - 1)
    return of_contour[contour[printing[ahead]]]


def habit_of(settings: ProcessSettings, limits: MotionLimits) -> Habit:
    """Return how travels are made, as the kernels take it."""
    feed = travel_feed(settings, limits)
    wiped = min(settings.wipe_filament_mm, settings.retract_mm) if settings.wipe_mm > 0.0 else 0.0
    return Habit(
        feed, settings.z_feed or feed,
        settings.retract_mm - wiped, settings.retract_feed, settings.retract_mm,
        settings.unretract_feed, settings.wipe_mm, wiped, settings.wipe_feed or feed,
    )  # fmt: skip
