"""Trapezoidal motion with look-ahead on bare arrays, as firmware planners do it.

Moves have four axes, x, y, z and the filament e. Each keeps the largest feed and
acceleration of every axis; from one move to the next no axis changes its speed
by more than its jerk, or the junction deviation limits the corner. Two passes
propagate what braking and speeding up allow (Marlin's planner, with look-ahead
over the whole program). Validation is the callers'.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.compiled import kernel

# Columns of a row of limits; the first three are four wide: x, y, z, e.
FEED, ACCELERATION, JERK = 0, 4, 8
PRINTING, RETRACTING, TRAVELLING = 12, 13, 14  # acceleration by what a move does
DEVIATION = 15  # mm of junction deviation; 0: jerk counts
FACTOR = 16  # of every feed
N_LIMITS = 17

# Columns of a block: a move as the planner sees it.
LENGTH, TOP, RATE, ENTER, LEAVE, LINKED = range(6)
N_BLOCK = 6
STRAIGHT = 1e-9  # change of direction that is none
STOP_SHARE = 0.99  # of the corner's speed: where stopping costs no more, moves are not joined


@kernel
def trapezoid_time(
    length: float, start: float, end: float, top: float, acceleration: float
) -> float:
    """Time of one straight move from speed `start` to `end`, at most `top`."""
    peak: float = np.sqrt(acceleration * length + 0.5 * (start * start + end * end))
    peak = max(peak, max(start, end))
    if peak <= top:
        return (2.0 * peak - start - end) / acceleration
    ramps = (2.0 * top * top - start * start - end * end) / (2.0 * acceleration)
    return (2.0 * top - start - end) / acceleration + (length - ramps) / top


@kernel
def shape_move(step: Floats, feed: float, limits: Floats, unit: Floats) -> Any:
    """Return (length, top speed, acceleration) of a move; writes its direction to `unit`, (4,).

    The length is that in space, or of the filament where nothing else moves.
    """
    length = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    rate = limits[TRAVELLING] if step[3] == 0.0 else limits[PRINTING]
    if length <= 0.0:
        length, rate = abs(step[3]), limits[RETRACTING]
    if length <= 0.0:
        return 0.0, 0.0, 0.0
    top = feed * limits[FACTOR]
    for axis in range(4):
        unit[axis] = step[axis] / length
        share = abs(unit[axis])
        if share * top > limits[FEED + axis]:
            top = limits[FEED + axis] / share
        if share * rate > limits[ACCELERATION + axis]:
            rate = limits[ACCELERATION + axis] / share
    return length, top, rate


@kernel
def stop_speed(unit: Floats, top: float, limits: Floats) -> float:
    """Speed at which a move may begin from, and end at, rest."""
    if limits[DEVIATION] > 0.0:
        return 0.0
    for axis in range(4):
        if abs(unit[axis]) * top > limits[JERK + axis]:
            top = limits[JERK + axis] / abs(unit[axis])
    return top


@kernel
def corner_speed(before: Floats, after: Floats, top: float, rate: float, limits: Floats) -> float:
    """Speed at which direction `before` may become `after`, at most `top`."""
    if limits[DEVIATION] > 0.0:
        return _deviating(before, after, top, rate * limits[DEVIATION])
    for axis in range(4):
        jump = abs(after[axis] - before[axis])
        if before[axis] * after[axis] < 0.0:  # reversal: through zero, each side for itself
            jump = max(abs(before[axis]), abs(after[axis]))
        if jump > STRAIGHT and jump * top > limits[JERK + axis]:
            top = limits[JERK + axis] / jump
    return top


@kernel
def _deviating(before: Floats, after: Floats, top: float, reach: float) -> float:
    """Corner speed by junction deviation; `reach` is acceleration times deviation."""
    moved, moves, cosine = 0.0, 0.0, 0.0
    for axis in range(3):
        moved += abs(before[axis])
        moves += abs(after[axis])
        cosine += before[axis] * after[axis]
    if (moved == 0.0) != (moves == 0.0):
        return 0.0  # filament alone on one side
    if moved == 0.0:
        cosine = before[3] * after[3]
    half = np.sqrt(max(0.0, 0.5 * (1.0 + cosine)))  # sine of half the angle between the legs
    if half > 1.0 - STRAIGHT:
        return top
    return min(top, float(np.sqrt(reach * half / (1.0 - half))))


@kernel
def join_blocks(
    blocks: Floats, n: int, before: Floats, after: Floats,
    stop: float, stopped: float, limits: Floats,
) -> None:  # fmt: skip
    """Set the speed between block n - 1 and block n in place.

    `stop` and `stopped` are the speeds at which the new and the old block may
    meet a standstill: where the corner is no faster, they do.
    """
    top = min(blocks[n, TOP], blocks[n - 1, TOP])
    rate = min(blocks[n, RATE], blocks[n - 1, RATE])
    speed = corner_speed(before, after, top, rate, limits)
    blocks[n, LINKED] = 1.0
    blocks[n, ENTER] = blocks[n - 1, LEAVE] = speed
    if stop > STOP_SHARE * speed and stopped > STOP_SHARE * speed:
        blocks[n, LINKED] = 0.0
        blocks[n, ENTER], blocks[n - 1, LEAVE] = stop, stopped


@kernel
def sweep_speeds(blocks: Floats, n: int) -> None:
    """Lower the speeds between blocks, in place, to what braking and ramps allow."""
    for i in range(n - 1, -1, -1):
        if i + 1 < n and blocks[i + 1, LINKED] > 0.0:
            blocks[i, LEAVE] = blocks[i + 1, ENTER]
        leave = blocks[i, LEAVE]
        reach = np.sqrt(leave * leave + 2.0 * blocks[i, RATE] * blocks[i, LENGTH])
        blocks[i, ENTER] = min(blocks[i, ENTER], reach)
    for i in range(n):
        if i > 0 and blocks[i, LINKED] > 0.0:
            blocks[i, ENTER] = min(blocks[i, ENTER], blocks[i - 1, LEAVE])
        enter = blocks[i, ENTER]
        reach = np.sqrt(enter * enter + 2.0 * blocks[i, RATE] * blocks[i, LENGTH])
        blocks[i, LEAVE] = min(blocks[i, LEAVE], reach)


@kernel
def program_times(
    points: Floats,
    filament: Floats,
    feed: Floats,
    row: Int32s,
    limits: Floats,
    rest: Flags,
) -> Floats:
    """Time of each move of a program, (m,).

    Move i goes from points[i] to points[i + 1] pushing `filament[i]` mm at
    `feed[i]` under limits[row[i]]; without feed or length it takes no time.
    Before moves with `rest` the machine stands still, as at both ends.
    """
    m = len(filament)
    blocks = np.empty((m, N_BLOCK))
    owner = np.empty(m, np.int64)
    step, unit, last = np.empty(4), np.zeros(4), np.zeros(4)
    n, stopped, still = 0, 0.0, True
    for i in range(m):
        still = still or rest[i]
        if feed[i] <= 0.0:
            continue
        step[:3] = points[i + 1] - points[i]
        step[3] = filament[i]
        length, top, rate = shape_move(step, feed[i], limits[row[i]], unit)
        if length <= 0.0:
            continue
        stop = stop_speed(unit, top, limits[row[i]])
        blocks[n, LENGTH], blocks[n, TOP], blocks[n, RATE] = length, top, rate
        blocks[n, ENTER], blocks[n, LEAVE], blocks[n, LINKED] = stop, stop, 0.0
        if not still:
            join_blocks(blocks, n, last, unit, stop, stopped, limits[row[i]])
        last[:] = unit
        stopped, still, owner[n] = stop, False, i
        n += 1
    sweep_speeds(blocks, n)
    seconds = np.zeros(m)
    for k in range(n):
        seconds[owner[k]] = trapezoid_time(
            blocks[k, LENGTH], blocks[k, ENTER], blocks[k, LEAVE], blocks[k, TOP], blocks[k, RATE]
        )
    return seconds
