"""The modal interpreter of G-code motion, on plain arrays.

Walks the scanned lines once and keeps what a controller keeps: position, feed,
absolute or relative axes, extruder value, retraction. Arcs are opened into
chords here too.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.gcode.scan import OFFSET_I, OFFSET_J, D, E, F, R, S
from decmcts._kernels.jit import kernel

# Columns of `modes`, the state after each line.
RELATIVE_XYZ, RELATIVE_E, TOOL, FIRMWARE_RETRACTED, MODE_SET = range(5)
N_MODES = 5
MAX_TOOLS = 16


@kernel
def _modal(letter: int, code: int, values: NDArray[np.float64], modes: NDArray[np.int16]) -> float:
    """Apply a command that is no move to `modes` in place; return a new E area or -1."""
    if letter == 71:
        if code == 900 or code == 910:
            modes[RELATIVE_XYZ] = 1 if code == 910 else 0
        elif (code == 100 or code == 110) and math.isnan(values[S]) and math.isnan(values[R]):
            modes[FIRMWARE_RETRACTED] = 1 if code == 100 else 0
    elif letter == 77:
        if code == 820 or code == 830:
            modes[RELATIVE_E] = 1 if code == 830 else 0
            modes[MODE_SET] = 1
        elif code == 2000 and not math.isnan(values[D]):
            return float(math.pi * values[D] * values[D] / 4.0)
    elif letter == 84:
        modes[TOOL] = min(code // 10, 32000)
    return -1.0


@kernel
def _place(code: int, values: NDArray[np.float64], position: NDArray[np.float64]) -> bool:
    """Apply G92 or G28 to `position` (x, y, z, e) in place; tell whether an axis moved."""
    any_axis, moved = False, False
    for axis in range(4):
        if not math.isnan(values[axis]):
            any_axis = True
            position[axis] = values[axis] if code == 920 else 0.0
            moved = moved or axis < 3
    if not any_axis:
        position[0:3] = 0.0
        if code == 920:
            position[3] = 0.0
        moved = True
    return moved


@kernel
def _step(
    values: NDArray[np.float64],
    modes: NDArray[np.int16],
    position: NDArray[np.float64],
    area: float,
) -> float:
    """Move `position` in place; return the filament pushed, mm."""
    for axis in range(3):
        if not math.isnan(values[axis]):
            if modes[RELATIVE_XYZ]:
                position[axis] += values[axis]
            else:
                position[axis] = values[axis]
    if math.isnan(values[E]):
        return 0.0
    if modes[RELATIVE_E] or modes[RELATIVE_XYZ]:
        pushed = values[E]
        position[3] += pushed
    else:
        pushed = values[E] - position[3]
        position[3] = values[E]
    return float(pushed / area if area > 0.0 else pushed)


@kernel
def interpret(
    letter: NDArray[np.uint8],
    code: NDArray[np.int32],
    values: NDArray[np.float64],
    modes: NDArray[np.int16],
    extruder: NDArray[np.float64],
    moves: NDArray[np.float64],
    line: NDArray[np.int64],
    placed: NDArray[np.bool_],
    relative_e: bool,
) -> None:
    """Fill the moves and the state after each line, all in place.

    `modes` is (lines, N_MODES), `extruder` (lines, 3): E value, retraction owed
    by the tool in use, cross-section of volumetric E (0: E is in mm). Row m of
    `moves` is end x, y, z, filament, feed; `line[m]` its line.
    """
    position, debt = np.zeros(4), np.zeros(MAX_TOOLS)
    state = np.zeros(N_MODES, np.int16)
    state[RELATIVE_E] = relative_e
    rate, area, m = 0.0, 0.0, 0
    for n in range(len(letter)):
        owner = state[TOOL] % MAX_TOOLS
        if letter[n] == 71 and code[n] <= 30:
            rate = rate if math.isnan(values[n, F]) else values[n, F] / 60.0
            pushed = _step(values[n], state, position, area)
            debt[owner] = max(0.0, debt[owner] - pushed)
            moves[m, 3], moves[m, 4] = pushed, rate
        elif letter[n] == 71 and (code[n] == 920 or code[n] == 280):
            placed[n] = _place(code[n], values[n], position)  # if an axis: a move without feed
        elif letter[n] != 0:
            new_area = _modal(letter[n], code[n], values[n], state)
            area = new_area if new_area >= 0.0 else area
        if placed[n] or (letter[n] == 71 and code[n] <= 30):
            moves[m, :3], line[m] = position[:3], n
            m += 1
        modes[n] = state
        extruder[n, 0], extruder[n, 1] = position[3], debt[state[TOOL] % MAX_TOOLS]
        extruder[n, 2] = area


@kernel
def arc_center(
    x0: float, y0: float, x1: float, y1: float, values: NDArray[np.float64], clockwise: bool
) -> Any:
    """Return the centre of an arc in I/J or R form; NaN when there is none."""
    if math.isnan(values[R]):
        i = 0.0 if math.isnan(values[OFFSET_I]) else values[OFFSET_I]
        j = 0.0 if math.isnan(values[OFFSET_J]) else values[OFFSET_J]
        return x0 + i, y0 + j
    dx, dy = x1 - x0, y1 - y0
    chord = math.hypot(dx, dy)
    radius = abs(values[R])
    if chord == 0.0 or chord > 2.0 * radius * (1.0 + 1e-3):
        return math.nan, math.nan
    height = math.sqrt(max(0.0, radius * radius - chord * chord / 4.0))
    side = -1.0 if clockwise else 1.0
    if values[R] < 0.0:
        side = -side
    return (x0 + x1) / 2.0 - side * dy / chord * height, (
        y0 + y1
    ) / 2.0 + side * dx / chord * height


@kernel
def arc_sweep(
    x0: float, y0: float, x1: float, y1: float, cx: float, cy: float, clockwise: bool
) -> float:
    """Return the signed angle of an arc; equal ends are a full circle."""
    sweep = math.atan2(y1 - cy, x1 - cx) - math.atan2(y0 - cy, x0 - cx)
    if x0 == x1 and y0 == y1:
        return -2.0 * math.pi if clockwise else 2.0 * math.pi
    if clockwise and sweep >= 0.0:
        sweep -= 2.0 * math.pi
    if not clockwise and sweep <= 0.0:
        sweep += 2.0 * math.pi
    return sweep


@kernel
def chord_count(radius: float, sweep: float, tolerance: float) -> int:
    """Return how many chords keep within `tolerance` of the arc."""
    if radius <= tolerance:
        return 1
    step = 2.0 * math.acos(1.0 - tolerance / radius)
    return max(1, math.ceil(abs(sweep) / step))


@kernel
def plan_arcs(
    before: NDArray[np.float64],
    end: NDArray[np.float64],
    line: NDArray[np.int64],
    code: NDArray[np.int32],
    values: NDArray[np.float64],
    tolerance: float,
    arcs: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Return the chords of each move; write centre and sweep into `arcs` in place."""
    count = np.ones(len(line), np.int64)
    for m in range(len(line)):
        if code[line[m]] != 20 and code[line[m]] != 30:
            continue
        clockwise = code[line[m]] == 20
        x0, y0, x1, y1 = before[m, 0], before[m, 1], end[m, 0], end[m, 1]
        cx, cy = arc_center(x0, y0, x1, y1, values[line[m]], clockwise)
        if math.isnan(cx):
            count[m] = 0
            continue
        sweep = arc_sweep(x0, y0, x1, y1, cx, cy, clockwise)
        radius = math.hypot(x0 - cx, y0 - cy)
        arcs[m, 0], arcs[m, 1], arcs[m, 2] = cx, cy, sweep
        count[m] = min(chord_count(radius, sweep, tolerance), 100000)
    return count


@kernel
def open_arcs(
    before: NDArray[np.float64],
    end: NDArray[np.float64],
    pushed: NDArray[np.float64],
    arcs: NDArray[np.float64],
    count: NDArray[np.int64],
    grid: NDArray[np.float64],
    points: NDArray[np.float64],
    extrusion: NDArray[np.float64],
    source: NDArray[np.int64],
) -> None:
    """Fill points, extrusion and source move of every chord, in place.

    Chord ends lie on the file's own decimals (`grid`: xy, e), so that writing
    and reading them again changes nothing; E is shared without drift.
    """
    k = 0
    for m in range(len(count)):
        given = 0.0
        for s in range(1, count[m] + 1):
            t = s / count[m]
            points[k] = end[m]
            if s < count[m]:
                angle = arcs[m, 2] * t
                dx, dy = before[m, 0] - arcs[m, 0], before[m, 1] - arcs[m, 1]
                c, sn = math.cos(angle), math.sin(angle)
                points[k, 0] = round((arcs[m, 0] + c * dx - sn * dy) * grid[0]) / grid[0]
                points[k, 1] = round((arcs[m, 1] + sn * dx + c * dy) * grid[0]) / grid[0]
                points[k, 2] = before[m, 2] + t * (end[m, 2] - before[m, 2])
                points[k, 2] = round(points[k, 2] * grid[0]) / grid[0]
            share = pushed[m]
            if count[m] > 1:
                share = round(pushed[m] * t * grid[1]) / grid[1] - given
                given += share
            extrusion[k] = share
            source[k] = m
            k += 1
