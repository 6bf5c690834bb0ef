"""The judge's own motion model: when a head passes each point of a path.

Speed along each segment is a trapezoid under the machine's limits; at a corner
the speed of no axis may jump by more than its jerk; every action starts and ends at rest.
The planner's model is in `decmcts.print.motion` and is not used here.
"""

from __future__ import annotations

import numpy as np

from decmcts.print.machine import MotionLimits
from sim.arrays import Flags, Floats, Ints
from sim.replay.compiled import compiled


def arrival_times(
    path: Floats, offsets: Ints, feed: Floats, prints: Flags, limits: MotionLimits
) -> Floats:
    """Return the seconds from the start of each polyline to each of its points, (n,).

    Parameters
    ----------
    path : (n, 3) mm, all polylines one after the other
    offsets : (k + 1,) polyline i is path[offsets[i]:offsets[i + 1]], from rest to rest
    feed : (n,) mm/s of the segment that ends at each point; at a first point not used
    prints : (n,) whether that segment prints: printing has an acceleration of its own
    limits : MotionLimits
    """
    if len(path) < 2:
        return np.zeros(len(path))
    length, unit = steps_of(path)
    speed = np.minimum(feed, share(limits.max_feed, unit))
    wanted = np.where(prints, limits.acceleration, limits.travel_acceleration)
    acceleration = np.minimum(wanted, share(limits.max_acceleration, unit))
    seconds = np.zeros(len(path))
    jerk = np.array(limits.jerk[:3])
    if limits.junction_deviation > 0.0:  # the jerk that allows a right angle the same speed
        jerk[:] = np.sqrt(limits.acceleration * limits.junction_deviation / (np.sqrt(2.0) - 1.0))
    for_each_path(offsets, length, unit, speed, acceleration, jerk, seconds)
    return seconds


def steps_of(path: Floats) -> tuple[Floats, Floats]:
    """Return length, (n,) mm, and direction, (n, 3), of the segment that ends at each point."""
    step = np.diff(path, axis=0, prepend=path[:1])
    length = np.linalg.norm(step, axis=1)
    return length, step / np.maximum(length, 1e-12)[:, None]


@compiled
def for_each_path(
    offsets: Ints, length: Floats, unit: Floats, speed: Floats, acceleration: Floats, jerk: Floats,
    seconds: Floats,
) -> None:  # fmt: skip
    """Write the arrival times of every polyline into `seconds`."""
    for i in range(len(offsets) - 1):
        a, b = offsets[i] + 1, offsets[i + 1]
        if b > a:
            times = segment_times(length[a:b], unit[a:b], speed[a:b], acceleration[a:b], jerk)
            seconds[a:b] = np.cumsum(times)


def share(limits: tuple[float, float, float, float], unit: Floats) -> Floats:
    """Return the largest value along each direction whose parts keep the limits of x, y and z."""
    return np.asarray((np.array(limits[:3]) / np.maximum(np.abs(unit), 1e-9)).min(axis=1))


@compiled
def corner_speed(before: Floats, after: Floats, jerk: Floats) -> float:
    """Return the speed at which an axis jumps by its jerk from one direction to the next."""
    speed = np.inf
    for axis in range(3):
        turn = abs(after[axis] - before[axis])
        if turn > 1e-9:
            speed = min(speed, jerk[axis] / turn)
    return speed


@compiled
def segment_times(
    length: Floats, unit: Floats, speed: Floats, acceleration: Floats, jerk: Floats
) -> Floats:
    """Return the seconds of each segment of one path, (m,)."""
    m = len(length)
    limit = np.zeros(m + 1)  # speed at each point; at rest at both ends
    for i in range(1, m):
        corner = corner_speed(unit[i - 1], unit[i], jerk)
        limit[i] = min(corner, speed[i - 1], speed[i])
    for i in range(m - 1, -1, -1):
        reach = np.sqrt(limit[i + 1] ** 2 + 2 * acceleration[i] * length[i])
        limit[i] = min(limit[i], reach)
    for i in range(m):
        reach = np.sqrt(limit[i] ** 2 + 2 * acceleration[i] * length[i])
        limit[i + 1] = min(limit[i + 1], reach)
    seconds = np.zeros(m)
    for i in range(m):
        if length[i] > 0.0:
            seconds[i] = trapezoid(length[i], limit[i], limit[i + 1], speed[i], acceleration[i])
    return seconds


@compiled
def trapezoid(length: float, start: float, end: float, cruise: float, acceleration: float) -> float:
    """Return the seconds of one segment entered at `start` and left at `end` mm/s."""
    peak = np.sqrt(acceleration * length + (start**2 + end**2) / 2)
    top = min(cruise, peak)
    ramps = (2 * top**2 - start**2 - end**2) / (2 * acceleration)
    return float((2 * top - start - end) / acceleration + max(0.0, length - ramps) / top)
