"""How fast a controller moves: a queue of few moves, planned to stop at its end.

A controller knows only the moves in its queue, so it keeps a speed from which it can still stop at
the end of the last of them (Marlin: `BLOCK_BUFFER_SIZE`, 16 by default; RepRapFirmware: 40 or
more). Each move is a trapezoid of speed under the limits of the four axes. At a corner no axis
jumps by more than its jerk, or junction deviation limits the speed there. From rest, and to it, a
move may begin and end at the speed its jerk allows (`safe_speed` of Marlin and Prusa's firmware).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.brief import brief
from sim.controllers.compiled import compiled
from sim.controllers.program import HeadProgram

QUEUE = 16  # moves, as Marlin's
AXES = 4  # x, y, z and filament
_FEED, _RATE, _JERK, _OWN = 0, 4, 8, 12  # columns of a row of limits
_DEVIATION = 15
STILL = 1e-9
APART = -1.0  # for a speed between two moves: the head comes to rest there
STOP_SHARE = 0.99  # of a corner's speed: where stopping costs no more, controllers stop


@dataclass(frozen=True, slots=True)
class Profile:
    """The speeds of each move of a program, from the program's own start."""

    length: Floats  # (m,) mm, of the filament where nothing else moves
    enters: Floats  # (m,) mm/s
    leaves: Floats  # (m,)
    top: Floats  # (m,) the most within the move
    rate: Floats  # (m,) mm/s²
    seconds: Floats  # (m,)

    __repr__ = brief("length", "seconds")


def profile_of(program: HeadProgram, queue: int = QUEUE) -> Profile:
    """Return how a controller with a queue of so many moves runs a program; linear in its moves."""
    rows = np.array(
        [
            [*its.max_feed, *its.max_acceleration, *its.jerk, its.acceleration,
             its.retract_acceleration, its.travel_acceleration, its.junction_deviation]
            for its in program.limits
        ]
    )  # fmt: skip
    m = len(program.feed)
    found, safe, joint = np.zeros((m, 6)), np.zeros(m), np.full(m + 1, APART)
    if m:
        _shape(program.points, program.filament, program.feed, program.row, rows, found, safe)
        _corners(
            program.points, program.filament, program.row, rows, program.rests, found, safe, joint
        )
        _speeds(found, safe, joint, queue)
    return Profile(*(np.ascontiguousarray(column) for column in found.T))


@compiled
def _direction(points: Floats, filament: Floats, i: int, unit: Floats) -> float:
    """Write the direction of a move into `unit`, (4,); return its length, 0: nothing moves."""
    length = 0.0
    for axis in range(3):
        unit[axis] = points[i + 1, axis] - points[i, axis]
        length += unit[axis] ** 2
    unit[3] = filament[i]
    length = np.sqrt(length)
    if length <= STILL:
        length = abs(filament[i])
    if length <= STILL:
        return 0.0
    for axis in range(AXES):
        unit[axis] /= length
    return float(length)


@compiled
def _shape(
    points: Floats, filament: Floats, feed: Floats, row: Ints, rows: Floats, found: Floats,
    safe: Floats,
) -> None:  # fmt: skip
    """Write length, top speed and acceleration of moves into `found`, (m, 6), speeds to `safe`."""
    unit = np.zeros(AXES)
    for i in range(len(feed)):
        length = _direction(points, filament, i, unit)
        if length <= 0.0 or feed[i] <= 0.0:
            continue
        limits = rows[row[i]]
        still = max(abs(unit[0]), max(abs(unit[1]), abs(unit[2]))) <= STILL
        rate = limits[_OWN + 1] if still else limits[_OWN if filament[i] != 0.0 else _OWN + 2]
        top = feed[i]
        for axis in range(AXES):
            share = abs(unit[axis])
            if share > STILL:
                top = min(top, limits[_FEED + axis] / share)
                rate = min(rate, limits[_RATE + axis] / share)
        found[i, 0], found[i, 3], found[i, 4] = length, top, rate
        if limits[_DEVIATION] <= 0.0:
            safe[i] = _jerking(np.zeros(AXES), unit, top, limits[_JERK : _JERK + AXES])


@compiled
def _corners(
    points: Floats, filament: Floats, row: Ints, rows: Floats, rests: Flags,
    found: Floats, safe: Floats, joint: Floats,
) -> None:  # fmt: skip
    """Write the most speed between moves i - 1 and i into `joint`, (m + 1,)."""
    before, unit = np.zeros(AXES), np.zeros(AXES)
    last = -1
    for i in range(len(found)):
        if rests[i]:
            last = -1
        if found[i, 0] <= 0.0:
            if last >= 0:
                joint[i] = found[last, 3]  # nothing moves: not in the way
            continue
        _direction(points, filament, i, unit)
        if last >= 0:
            limits = rows[row[i]]
            most = min(found[last, 3], found[i, 3])
            if limits[_DEVIATION] > 0.0:
                reach = min(found[last, 4], found[i, 4]) * limits[_DEVIATION]
                most = _deviating(before, unit, most, reach)
            else:
                most = _jerking(before, unit, most, limits[_JERK : _JERK + AXES])
            if min(safe[last], safe[i]) <= STOP_SHARE * most:
                joint[i] = most
        last = i
        before[:] = unit


@compiled
def _jerking(before: Floats, after: Floats, most: float, jerk: Floats) -> float:
    """Return the speed at which no axis jumps by more than its jerk."""
    for axis in range(AXES):
        jump = abs(after[axis] - before[axis])
        if before[axis] * after[axis] < 0.0:  # through zero: each side for itself
            jump = max(abs(after[axis]), abs(before[axis]))
        if jump > STILL:
            most = min(most, jerk[axis] / jump)
    return most


@compiled
def _deviating(before: Floats, after: Floats, most: float, reach: float) -> float:
    """Return the speed of a corner by junction deviation; `reach` is acceleration times it."""
    cosine, moved, moves = 0.0, 0.0, 0.0
    for axis in range(3):
        cosine -= before[axis] * after[axis]
        moved += abs(before[axis])
        moves += abs(after[axis])
    if moved <= STILL or moves <= STILL:
        return 0.0
    half = np.sqrt(max(0.0, 0.5 * (1.0 - cosine)))
    if half > 1.0 - STILL:
        return most
    return float(min(most, np.sqrt(reach * half / (1.0 - half))))


@compiled
def _speeds(found: Floats, safe: Floats, joint: Floats, queue: int) -> None:
    """Write speeds and seconds of all moves into `found`, each planned with a queue so long."""
    speed = 0.0
    for i in range(len(found)):
        length, top, rate = found[i, 0], found[i, 3], found[i, 4]
        if length <= 0.0:
            continue
        if joint[i] < 0.0:
            speed = min(safe[i], np.sqrt(rate * length))
        most = _may_leave(found, safe, joint, i, queue)
        leaves = min(min(most, top), np.sqrt(speed * speed + 2.0 * rate * length))
        # what was planned when this move came into the queue can still be kept
        leaves = max(leaves, np.sqrt(max(0.0, speed * speed - 2.0 * rate * length)))
        peak = min(top, np.sqrt(rate * length + 0.5 * (speed * speed + leaves * leaves)))
        peak = max(peak, max(speed, leaves))
        ramps = (2.0 * peak * peak - speed * speed - leaves * leaves) / (2.0 * rate)
        found[i, 1], found[i, 2], found[i, 3] = speed, leaves, peak
        found[i, 5] = (2.0 * peak - speed - leaves) / rate + max(0.0, length - ramps) / peak
        speed = leaves


@compiled
def _may_leave(found: Floats, safe: Floats, joint: Floats, i: int, queue: int) -> float:
    """Return the speed at which move i may be left so that the queue's end is reached at rest."""
    end, m = i + 1, len(found)
    last = i  # the last move of the queue that moves anything
    while end < m and end < i + queue and joint[end] >= 0.0:
        if found[end, 0] > 0.0:
            last = end
        end += 1
    speed = float(safe[last])
    for k in range(last, i, -1):
        if found[k, 0] > 0.0:
            speed = float(min(joint[k], np.sqrt(speed * speed + 2.0 * found[k, 4] * found[k, 0])))
    return speed
