"""How long motion takes: the planner's time model.

Trapezoids with look-ahead under the machine's limits (`decmcts.print.motion_kernels`).
The judge (`sim.replay.least`) has its own model; nothing here is imported there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print import motion_kernels as kernels
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import MotionLimits


@dataclass(frozen=True, slots=True)
class Program:
    """Moves of one head in order; move i goes from points[i] to points[i + 1]."""

    points: Floats  # (m + 1, 3) mm
    filament: Floats  # (m,) mm pushed
    feed: Floats  # (m,) mm/s; 0: takes no time
    row: Int32s  # (m,) row of `limits`
    limits: Floats  # (k, N_LIMITS) as `limit_row` makes them
    rest: Flags  # (m,) the head stands still before the move

    def seconds(self) -> Floats:
        """Return the seconds of each move, (m,); linear in their number."""
        return np.asarray(
            kernels.program_times(
                np.ascontiguousarray(self.points), self.filament, self.feed, self.row,
                self.limits, self.rest,
            )
        )  # fmt: skip


def limit_row(limits: MotionLimits) -> Floats:
    """Return the limits as the kernels take them, (N_LIMITS,), with every feed as it is."""
    return np.array(
        [
            *limits.max_feed, *limits.max_acceleration, *limits.jerk, limits.acceleration,
            limits.retract_acceleration, limits.travel_acceleration, limits.junction_deviation,
            1.0,  # M220
        ]
    )  # fmt: skip


def limits_of(row: Floats) -> MotionLimits:
    """Return the limits of a row; the feed of travels is not in it."""
    x = row.tolist()
    feed, acceleration, jerk = ((x[k], x[k + 1], x[k + 2], x[k + 3]) for k in (0, 4, 8))
    return MotionLimits(
        math.nan, feed, acceleration, jerk, *x[kernels.PRINTING : kernels.DEVIATION + 1]
    )


def limit_rows(limits: MotionLimits, acceleration: Floats) -> tuple[Floats, Int32s]:
    """Return one row of limits per different printing acceleration, and the row of each entry.

    Row 0 is `limits` as they are; entries that are NaN have it.
    """
    unsaid = np.isnan(acceleration)
    kinds = np.unique(acceleration[~unsaid])
    rows = np.tile(limit_row(limits), (len(kinds) + 1, 1))
    rows[1:, kernels.PRINTING] = kinds
    return rows, np.where(unsaid, 0, 1 + np.searchsorted(kinds, acceleration)).astype(np.int32)


def contour_times(
    contours: Contours, limits: MotionLimits, acceleration: Floats | None = None
) -> Floats:
    """Return the seconds each contour takes as sliced, from rest to rest, (n,).

    The model is symmetric in time, so a contour that is reversed takes as long.

    Parameters
    ----------
    acceleration : (n_points,) or None
        As in `PrintJob`.
    """
    return np.add.reduceat(segment_times(contours, limits, acceleration), contours.offsets[:-1])


def job_times(job: PrintJob, limits: MotionLimits) -> Floats:
    """Return the seconds each contour of a job takes, at the accelerations it sets, (n,)."""
    return contour_times(job.contours, limits, job.acceleration)


def segment_times(
    contours: Contours, limits: MotionLimits, acceleration: Floats | None = None
) -> Floats:
    """Return the seconds of the segment ending at each point, 0 at a start, (n_points,)."""
    return _polylines(
        contours.points, contours.offsets, contours.feed, contours.extrusion, limits, acceleration
    )


def path_times(points: Floats, offsets: Ints, feed: Floats, limits: MotionLimits) -> Floats:
    """Return the seconds of each travel points[offsets[i]:offsets[i + 1]], rest to rest, (n,).

    Parameters
    ----------
    points : (m, 3) mm
    offsets : (n + 1,) none of the polylines is empty
    feed : (m,) mm/s of the segment ending at each point; segments without feed take no time
    limits : MotionLimits
    """
    nothing = np.zeros(len(points))
    seconds = _polylines(points, offsets, feed, nothing, limits, None)
    return np.add.reduceat(seconds, offsets[:-1]) if len(points) else np.zeros(0)


def _polylines(
    points: Floats,
    offsets: Ints,
    feed: Floats,
    filament: Floats,
    limits: MotionLimits,
    acceleration: Floats | None,
) -> Floats:
    """Return the seconds of the segment ending at each point, rest to rest, (m,)."""
    seconds = np.zeros(len(points))
    if len(points) < 2:
        return seconds
    rows, row = limit_row(limits)[None], np.zeros(len(points), np.int32)
    if acceleration is not None:
        rows, row = limit_rows(limits, acceleration)
    first = np.zeros(len(points), np.bool_)
    first[offsets[:-1]] = True
    due = np.where(first, 0.0, feed)  # what leads from one polyline to the next takes no time
    program = Program(points, filament[1:], due[1:], row[1:], rows, first[1:])
    seconds[1:] = program.seconds()
    return seconds


def path_time(path: Floats, feed: float, limits: MotionLimits) -> float:
    """Return the seconds one travel (k, 3) takes at `feed` mm/s, from rest to rest.

    Examples
    --------
    >>> from decmcts.print.machine import MotionLimits
    >>> import numpy as np
    >>> limits = MotionLimits(travel_acceleration=1000.0, jerk=(0.0, 0.0, 0.0, 0.0))
    >>> round(path_time(np.array([[0.0, 0, 0], [100, 0, 0]]), 100.0, limits), 6)
    1.1
    """
    offsets = np.array([0, len(path)], np.int64)
    points = np.ascontiguousarray(path, np.float64)
    return float(path_times(points, offsets, np.full(len(path), feed), limits)[0])


def travel_feed(settings: ProcessSettings, limits: MotionLimits) -> float:
    """Return the feed of travels in mm/s: the source's own, or the machine's."""
    return settings.travel_feed if settings.travel_feed > 0.0 else limits.travel_feed


def travel_acceleration(settings: ProcessSettings, limits: MotionLimits) -> float:
    """Return the acceleration of travels in mm/s²: the source's own, or the machine's."""
    return settings.travel_acceleration or limits.travel_acceleration


def level_travel(settings: ProcessSettings, limits: MotionLimits) -> tuple[float, float]:
    """Return speed and acceleration that a level travel in any direction may have."""
    feed, rate = travel_feed(settings, limits), travel_acceleration(settings, limits)
    return min(feed, *limits.max_feed[:2]), min(rate, *limits.max_acceleration[:2])


def upright_travel(settings: ProcessSettings, limits: MotionLimits) -> tuple[float, float]:
    """Return speed and acceleration of travels in Z alone."""
    feed = settings.z_feed or travel_feed(settings, limits)
    rate = travel_acceleration(settings, limits)
    return min(feed, limits.max_feed[2]), min(rate, limits.max_acceleration[2])


def filament_time(length_mm: float, feed: float, limits: MotionLimits) -> float:
    """Return the seconds it takes to push or pull filament at rest."""
    if length_mm <= 0.0:
        return 0.0
    program = Program(
        np.zeros((2, 3)), np.array([length_mm]), np.array([feed]), np.zeros(1, np.int32),
        limit_row(limits)[None], np.zeros(1, np.bool_),
    )  # fmt: skip
    return float(program.seconds()[0])


def retraction_time(settings: ProcessSettings, limits: MotionLimits) -> float:
    """Return the seconds a retracted travel spends wiping, retracting and priming again."""
    if settings.retract_mm <= 0.0:
        return 0.0
    wiped = min(settings.wipe_filament_mm, settings.retract_mm) if settings.wipe_mm > 0.0 else 0.0
    leg = np.array([[0.0, 0.0, 0.0], [settings.wipe_mm / 2.0, 0.0, 0.0]])
    feed = settings.wipe_feed or travel_feed(settings, limits)
    return (
        filament_time(settings.retract_mm - wiped, settings.retract_feed, limits)
        + filament_time(settings.retract_mm, settings.unretract_feed, limits)
        + (2.0 * path_time(leg, feed, limits) if wiped > 0.0 else 0.0)
    )
